"""Measures all settings of a family."""

import tempfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from comparisons.experiments.methods import timing
from comparisons.experiments.methods.errors import Checked, Errors, measure
from comparisons.experiments.methods.of_box import BOX
from comparisons.experiments.methods.of_csg import CSG
from comparisons.experiments.methods.of_hierarchy import HIERARCHY
from comparisons.experiments.methods.of_polygon import POLYGON
from comparisons.experiments.methods.of_sphere import SPHERE
from comparisons.experiments.methods.of_triangle import TRIANGLE
from comparisons.experiments.methods.setting import Draw, Family, Series, Trial
from comparisons.experiments.methods.timing import Prepared, Time
from reference_rt.rendering.render import Progress

FAMILIES = {f.name: f for f in (SPHERE, TRIANGLE, BOX, POLYGON, CSG, HIERARCHY)}


class Effort(NamedTuple):
    """rays: in a setting;  checked: how many of them are checked by exact arithmetic;  runs: how
    often each method is timed."""

    rays: int
    checked: int
    runs: int


QUICK = Effort(rays=8192, checked=768, runs=7)
FULL = Effort(rays=32768, checked=4096, runs=15)


@dataclass(frozen=True)
class Row:
    """One method in one setting.

    extreme: whether the setting counts as such;  rays: in the setting, a part of which is checked
    and timed;  parts: shapes that each ray is traced against;  differs: of `compared` rays, those
    whose t differs in any bit from that of the family's first method (acceleration structures must
    all give the same);  build: seconds, None without an acceleration structure.
    """

    family: str
    series: str
    axis: str
    x: float
    extreme: bool
    relative: bool
    method: str
    rays: int
    parts: int
    errors: Errors
    time: Time
    compared: int
    differs: int
    build: float | None


def settings(family: Family) -> list[tuple[Series, float]]:
    """(series, x) of all settings, in the order in which they are measured."""
    return [(series, x) for series in family.series for x in series.values]


def draw_trials(
    series: Series, family: str, x: float, draw_from: int, rays: int, folder: Path
) -> list[Trial]:
    """The trials of a setting: the same for the same seed, whatever else is measured."""
    name = zlib.crc32(f"{family} {series.name} {x!r}".encode())
    return series.make(Draw(np.random.default_rng((draw_from, name)), rays, folder), x)


def measure_setting(
    family: Family, series: Series, x: float, effort: Effort, seed: int
) -> list[Row]:
    """A row for each method of the family."""
    with tempfile.TemporaryDirectory(prefix="reference_rt_methods_") as folder:
        trials = draw_trials(series, family.name, x, seed, effort.rays, Path(folder))
        prepared = {name: Prepared(method, trials) for name, method in family.methods.items()}
        times = timing.measure(prepared, effort.runs)
        share = -(-family.checked(x, effort.checked) // len(trials))
        checked = [Checked.of(family, series, trial, share) for trial in trials]
        rows, first = [], None
        for name, method in prepared.items():
            shared = min(times[other].rays for other in prepared) // len(trials)
            answers = np.concatenate([method.answer(trial, shared) for trial in trials])
            first = answers if first is None else first
            rows.append(
                Row(
                    family.name,
                    series.name,
                    series.axis,
                    x,
                    x >= series.extreme,
                    series.relative,
                    name,
                    sum(len(trial.o) for trial in trials),
                    len(trials[0].parts),
                    measure(checked, method.answer, seed),
                    times[name],
                    len(answers),
                    int(np.sum(answers != first)),
                    family.build(name, trials[0].parts[0]) if family.build else None,
                )
            )
    return rows


def run(family: Family, effort: Effort, seed: int, progress: Progress) -> list[Row]:
    """Measure all settings of a family."""
    rows: list[Row] = []
    every = settings(family)
    progress(family.name, 0.0)
    for done, (series, x) in enumerate(every, start=1):
        rows += measure_setting(family, series, x, effort, seed)
        progress(family.name, done / len(every))
    return rows
