"""Times all methods of a family in all settings of its series, in nanoseconds per ray; the methods
take turns.
"""

import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np

from comparisons.experiments.methods.trials import SERIES, Draw, Series, Trial, methods
from reference_rt.accel import bvh
from reference_rt.rendering.render import Progress
from reference_rt.textbook import Method
from reference_rt.util.files import temporary_folder

LONGEST = 15e6
"""Nanoseconds of one run: fewer rays are traced where all would take longer."""

PROBE = 64
"""Rays of each trial from whose time that of all is estimated."""


class Prepared:
    """A method with its precomputed data for some trials, to be run repeatedly."""

    def __init__(self, method: Method, trials: list[Trial]) -> None:
        self.run, self.trials = method.run, trials
        with np.errstate(all="ignore"):
            self.parts = [method.prepare(trial.part) for trial in trials]
        self._t = np.empty(max(len(trial.o) for trial in trials))

    def nanoseconds(self, rays: int) -> float:
        """Time one run over the first `rays` rays of all trials: nanoseconds per ray."""
        jobs = [
            (part, trial.o[:rays], trial.d[:rays], self._t[: min(rays, len(trial.o))])
            for trial, part in zip(self.trials, self.parts, strict=True)
        ]
        with np.errstate(all="ignore"):
            begin = time.perf_counter_ns()
            for job in jobs:
                self.run(*job)
            return (time.perf_counter_ns() - begin) / sum(len(o) for _, o, _, _ in jobs)


@dataclass(frozen=True)
class Time:
    """Nanoseconds per ray: median and quartiles of `runs` runs of `rays` rays."""

    median: float
    low: float
    high: float
    runs: int
    rays: int


def measure(prepared: Mapping[str, Prepared], runs: int) -> dict[str, Time]:
    """Times by method.  The methods take turns, so that other load on the machine slows them all
    alike."""
    rays = {name: _affordable(method) for name, method in prepared.items()}
    found: dict[str, list[float]] = {name: [] for name in prepared}
    for _ in range(runs):
        for name, method in prepared.items():
            found[name].append(method.nanoseconds(rays[name]))
    times = {}
    for name, values in found.items():
        low, median, high = (float(q) for q in np.quantile(values, (0.25, 0.5, 0.75)))
        traced = sum(min(rays[name], len(trial.o)) for trial in prepared[name].trials)
        times[name] = Time(median, low, high, runs, traced)
    return times


def _affordable(method: Prepared) -> int:
    """How many rays of each trial take LONGEST; the first runs compile or load the kernel."""
    method.nanoseconds(1)
    expected = method.nanoseconds(PROBE)
    longest = max(len(trial.o) for trial in method.trials)
    return int(min(max(LONGEST / (expected * len(method.trials)), PROBE), longest))


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
        for name, found in measure(prepared, effort.runs).items():
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
