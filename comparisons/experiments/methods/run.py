"""Times all methods of a family in all settings of its series."""

import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np

from comparisons.experiments.methods import timing
from comparisons.experiments.methods.timing import Prepared, Time
from comparisons.experiments.methods.trials import SERIES, Draw, Series, Trial, methods
from reference_rt.accel import bvh
from reference_rt.rendering.render import Progress
from reference_rt.util.files import temporary_folder


class Effort(NamedTuple):
    """rays: in a setting;  runs: how often each method is timed."""

    rays: int
    runs: int


QUICK = Effort(rays=8192, runs=7)
FULL = Effort(rays=32768, runs=15)


@dataclass(frozen=True)
class Row:
    """One method in one setting;  build: seconds, None without an acceleration structure."""

    family: str
    series: str
    axis: str
    x: float
    method: str
    time: Time
    build: float | None


def run(family: str, effort: Effort, seed: int, progress: Progress) -> list[Row]:
    """Time all settings of a family."""
    rows: list[Row] = []
    every = [(one, x) for one in SERIES if one.family == family for x in one.values]
    progress(family, 0.0)
    for done, (series, x) in enumerate(every, start=1):
        rows += _setting(series, x, effort, seed)
        progress(family, done / len(every))
    return rows


def _setting(series: Series, x: float, effort: Effort, seed: int) -> Iterator[Row]:
    """A row for each method;  the same trials for the same seed, whatever else is timed."""
    number = zlib.crc32(f"{series.family} {series.name} {x!r}".encode())
    with temporary_folder() as folder:
        rng = np.random.default_rng((seed, number))
        trials = series.make(Draw(rng, effort.rays, folder), x)
        prepared = {name: Prepared(m, trials) for name, m in methods(series.family).items()}
        for name, found in timing.measure(prepared, effort.runs).items():
            built = _build(name, trials[0]) if series.family == "hierarchy" else None
            yield Row(series.family, series.name, series.axis, x, name, found, built)


def _build(method: str, trial: Trial) -> float:
    """Seconds to build a hierarchy, the best of three: other load on the machine only adds to
    it."""
    triangles = trial.part.scene.tables.geometry.shapes.triangles
    v = triangles.vertices.reshape(-1, 3, 3)
    bounds, corners = (v.min(axis=1), v.max(axis=1)), v.reshape(-1, 9)
    kind = next(k for k in get_args(bvh.Method) if method == f"hierarchy.{k}")
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        bvh.build(*bounds, kind, corners)
        times.append(time.perf_counter() - begin)
    return min(times)
