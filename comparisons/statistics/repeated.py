"""Replicates without noise, or the same as others, bit for bit or but for rounding: an error, or
chance.

Renderers with several threads add samples in another order each time, so that the same seed makes
pictures that differ by rounding; half floats or 8 bits hide that in most values.

A few noisy pixels, at the edges of a flat picture or where a small lamp is met, may well be the
same again.  Of independent pixels that differ with the probabilities q, none does with a
probability of at most exp(-sum q); the sum is estimated by the number of pixels that differ.
"""

import math
from collections.abc import Callable
from itertools import combinations

import numpy as np

from comparisons.results.case import FloatArray

CHANCE = 1e-6
"""Probability below which it is no chance."""


FINE = 2.0**-16
"""Relative difference up to which it is rounding of float32: a sum of 65,536 samples differs by
less, and independent noise of less takes a hundred million samples."""

HALF_STEP = 2.0**-10
"""The largest relative distance of neighbouring half floats; of the smallest it is 2^-24."""

FEW_VALUES = 256
"""A side with no more different values is rounded to 8 bits."""

MOST_MOVED = 0.1
"""Largest fraction of the values that rounding may move to a neighbour: what differs by
FINE / 4 does so to a hundredth of the half floats."""


class Rounding:
    """How the replicates (n, h, w, 3) of one side are rounded.

    coarse: whether to half floats or to 8 bits.
    """

    def __init__(self, x: FloatArray) -> None:
        self._x, self.coarse = x, True
        levels = np.unique(x[0])
        if len(levels) <= FEW_VALUES and len(levels := np.unique(x)) <= FEW_VALUES:
            places = np.searchsorted(levels, x)
            ends = [np.clip(places + k, 0, len(levels) - 1) for k in (-1, 1)]
            self._step = np.asarray(levels[ends[1]] - levels[ends[0]])
            self._places, self._most = places.astype(np.float64), np.ones_like(x)
            return
        with np.errstate(over="ignore"):
            self.coarse = bool(np.array_equal(x.astype(np.float16), x))
        self._step = HALF_STEP * np.abs(x) + 2.0**-24 if self.coarse else FINE * np.abs(x)
        self._places, self._most = x, self._step

    @property
    def step(self) -> FloatArray:
        """(h, w, 3): the distance of neighbouring values, or somewhat more."""
        return np.asarray(self._step.max(axis=0))

    def beyond(self, i: int, j: int) -> int:
        """The number of pixels of two replicates that differ by more than rounding."""
        most = np.maximum(self._most[i], self._most[j])
        apart = np.abs(self._places[i] - self._places[j]) > most
        return int(np.count_nonzero(apart.any(axis=-1)))

    def repeats(self) -> list[tuple[int, int]]:
        """The pairs of replicates that are the same but for rounding."""
        most = MOST_MOVED * np.count_nonzero(self._x.any(axis=0))
        return [
            (i, j)
            for i, j in combinations(range(len(self._x)), 2)
            if self.beyond(i, j) == 0
            and (not self.coarse or np.count_nonzero(self._x[i] != self._x[j]) <= most)
        ]

    def may_repeat(self, pairs: list[tuple[int, int]], other: "Rounding") -> bool:
        """Whether these pairs may be chance;  other: the other side's, whose noise counts where all
        of these are the same.  Coarse rounding may hide all noise of many samples."""
        counts, others = (
            [side.beyond(i, j) for i, j in combinations(range(len(side._x)), 2)]
            for side in (self, other)
        )
        if self.coarse and not any(counts):
            return True
        return _is_chance(len({j for _, j in pairs}), counts, others)


def same_pairs(x: FloatArray) -> list[tuple[int, int]]:
    """The pairs of replicates (n, h, w, 3) that are identical."""
    return [(i, j) for i, j in combinations(range(len(x)), 2) if np.array_equal(x[i], x[j])]


def may_be_the_same(x: FloatArray, other: FloatArray) -> bool:
    """Whether identical pairs of the replicates x may be chance;  other: the other side's
    replicates, whose noise counts where all of x are the same."""
    repeated = {j for _, j in same_pairs(x)}
    return _is_chance(len(repeated), _differing(x), _differing(other) if len(other) > 1 else [])


def may_all_be_the_same(n: int, other: FloatArray) -> bool:
    """Whether all of n replicates may be identical by chance, where some of the other side's are.

    Independent pictures of which the fraction q of all pairs is identical have no picture more
    often than the square root of q, so that n are identical with a chance of at most that to the
    power n - 1.
    """
    pairs = math.comb(len(other), 2)
    share = (1 + len(same_pairs(other))) / (1 + pairs)
    return 0.5 * (n - 1) * math.log(share) > math.log(CHANCE)


def may_be_flat(x: FloatArray, other: FloatArray, deviating: Callable[[FloatArray], int]) -> bool:
    """Whether pictures of x without a deviating pixel may be chance;  deviating: the number of
    pixels of one picture (h, w, 3)."""
    counts = [deviating(picture) for picture in x]
    others = [deviating(picture) for picture in other] if len(other) > 1 else []
    return _is_chance(counts.count(0), counts, others)


def _is_chance(times: int, counts: list[int], others: list[int]) -> bool:
    """Whether a number of pixels may be 0 so many times among `counts`.

    Its mean is that of `counts`, or if they are all 0 that of `others`; if that is not known
    either, nothing is chance.  By the union bound over which ones are 0.
    """
    known = counts if any(counts) else others
    if not any(known):
        return False
    ways = math.log(math.comb(len(counts), times))
    return ways - times * float(np.mean(known)) > math.log(CHANCE)


def _differing(x: FloatArray) -> list[int]:
    """The number of pixels that differ, for each pair."""
    pairs = combinations(range(len(x)), 2)
    return [int(np.count_nonzero((x[i] != x[j]).any(axis=-1))) for i, j in pairs]
