"""Replicates without noise, or the same as others bit for bit: an error, or chance.

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


def same_pairs(x: FloatArray) -> list[tuple[int, int]]:
    """The pairs of replicates (n, h, w, 3) that are identical."""
    return [(i, j) for i, j in combinations(range(len(x)), 2) if np.array_equal(x[i], x[j])]


def may_be_the_same(x: FloatArray, other: FloatArray) -> bool:
    """Whether identical pairs of the replicates x may be chance;  other: the other side's
    replicates, whose noise counts where all of x are the same."""
    repeated = {j for _, j in same_pairs(x)}
    return _is_chance(len(repeated), _differing(x), _differing(other) if len(other) > 1 else [])


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
