"""Alternating measurements of two things, and their medians and quartiles."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from comparisons.runs.elsewhere import cool_down

ROUNDS = 7
"""Default number of rounds: one or two disturbances do not move the median far."""


class Spread(NamedTuple):
    """The median of some numbers, and the quartiles around it."""

    low: float
    median: float
    high: float


def spread(numbers: Sequence[float]) -> Spread:
    """Median and quartiles.  Raises ValueError for none."""
    if len(numbers) == 0:
        raise ValueError("nothing was measured")
    low, median, high = np.quantile(np.asarray(numbers, dtype=np.float64), [0.25, 0.5, 0.75])
    return Spread(float(low), float(median), float(high))


def ratios(ours: Sequence[float], peer: Sequence[float]) -> Spread:
    """The spread of ours / peer, round by round: a disturbance of a whole round cancels."""
    return spread([a / b for a, b in zip(ours, peer, strict=True)])


def seconds(run: Callable[[], object]) -> float:
    """Wall-clock seconds of one call."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def alternate(
    measures: Mapping[str, Callable[[], float]],
    rounds: int = ROUNDS,
    say: Callable[[str, float], None] = lambda what, fraction: None,
) -> dict[str, list[float]]:
    """The values of each of `measures` in each round, by name.

    Every other round runs in the reverse order, so that a drift favours neither.  say: called with
    what is being measured, and the fraction that is done.
    """
    found: dict[str, list[float]] = {name: [] for name in measures}
    done, total = 0, rounds * len(measures)
    for k in range(rounds):
        for name in list(measures)[:: 1 if k % 2 == 0 else -1]:
            say(name, done / total)
            cool_down()
            found[name].append(measures[name]())
            done += 1
    return found
