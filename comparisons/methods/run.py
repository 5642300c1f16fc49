"""All settings of a family, measured."""

import tempfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from comparisons.methods import timing
from comparisons.methods.errors import Checked, Errors, measure
from comparisons.methods.of_box import BOX
from comparisons.methods.of_csg import CSG
from comparisons.methods.of_hierarchy import HIERARCHY
from comparisons.methods.of_polygon import POLYGON
from comparisons.methods.of_sphere import SPHERE
from comparisons.methods.of_triangle import TRIANGLE
from comparisons.methods.setting import Draw, Family, Series, Trial
from comparisons.methods.timing import Prepared, Time

FAMILIES = {f.name: f for f in (SPHERE, TRIANGLE, BOX, POLYGON, CSG, HIERARCHY)}

Say = Callable[[str, float], None]


@dataclass(frozen=True)
class Effort:
    """rays: of a setting;  checked: how many of them exact arithmetic is asked about;  runs: how
    often each is timed."""

    rays: int
    checked: int
    runs: int


QUICK = Effort(rays=8192, checked=768, runs=7)
FULL = Effort(rays=32768, checked=4096, runs=15)


@dataclass(frozen=True)
class Row:
    """One method in one setting.

    differs: rays of all, checked or not, whose t is not that of the family's first method, bit for
    bit: for hierarchies, of which all should find the same;  build: seconds.
    """

    family: str
    series: str
    x: float
    extreme: bool
    method: str
    rays: int
    errors: Errors
    time: Time
    differs: int
    build: float | None


def settings(families: Sequence[Family]) -> list[tuple[Family, Series, float]]:
    """All, in the order in which they are measured."""
    return [(f, series, x) for f in families for series in f.series for x in series.values]


def draw_trials(
    series: Series, family: str, x: float, draw_from: int, rays: int, folder: Path
) -> list[Trial]:
    """The same for the same seed, whatever else is measured."""
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
                    x,
                    x >= series.extreme,
                    name,
                    sum(len(trial.o) for trial in trials),
                    measure(checked, method.answer, seed),
                    times[name],
                    int(np.sum(answers != first)),
                    family.build(name, trials[0].parts[0]) if family.build else None,
                )
            )
    return rows


def run(families: Sequence[Family], effort: Effort, seed: int, say: Say) -> Iterator[Row]:
    """Rows, setting after setting."""
    every = settings(families)
    for done, (family, series, x) in enumerate(every):
        say(family.name, done / len(every))
        yield from measure_setting(family, series, x, effort, seed)
    say("", 1.0)
