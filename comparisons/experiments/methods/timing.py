"""Nanoseconds per ray; the methods take turns."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from comparisons.experiments.methods.trials import Trial
from reference_rt.textbook import Method

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
