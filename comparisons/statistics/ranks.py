"""`uniformity`: a test by ranks of the p-values of small blocks, exact whatever the noise is.

The candidate's and the reference's G replicates are 2G pictures. Their difference is one of 2G - 1
orthogonal Walsh functions of these pictures; every other one has as many pictures of a side with a
plus as with a minus, so that it holds the same noise and no bias. If the replicates of both sides
are identically distributed, the symmetries of the Walsh functions make the first one and the others
exchangeable, whatever the distribution of the noise. So the rank of its absolute value among them
is uniform in each block, and the mean of the ranks over all blocks is one of 2G - 1 exchangeable
numbers. If blocks are correlated, all these numbers scatter more, which is measured. (The p-values
of Student's t would not be uniform with heavy tails.)

Where the pictures of the sides have unequal numbers of samples, their noise is of different laws,
and the test is left out: of skewed noise the first function is skewed and the others are not. (Of
Pareto noise with exponent 1.2, 32 pictures against 16 means of 16, 2 of 400 right ones differed.)

Too small a mean p-value means that blocks differ systematically, or that replicates are not
independent of each other; too large a one that candidate and reference share their noise, or that
the replicates of a side make up for each other (`order.shared_by_sides`).
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import special
from scipy.linalg import hadamard

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import (
    Margins,
    cell_means,
    divisor,
    ranks_of,
    tiles,
)
from comparisons.statistics.order import shared_by_sides
from comparisons.statistics.rare import Events
from comparisons.statistics.sides import Side
from comparisons.statistics.welch import are_unequal, noise_ratio

BLOCK = 4
"""Side of a block in pixels: larger than a filter's radius, and many blocks even in small
pictures."""

LEVEL = 0.0001
"""Chance of a false alarm of both tests together; see `scales` for the other families."""

LEAST = 4
"""Least number of replicates on each side: fewer give too few Walsh functions."""


@dataclass(frozen=True)
class Uniformity:
    """mean: the mean p-value of the blocks;  expected, error: its expectation and standard
    deviation;  mean_beyond_margin: the mean p-value of the differences minus the margin;  p_wide,
    p_narrow: chance of a mean as small, or as large;  p_reversed: p_narrow, if the pictures of one
    side may be those of the other in reverse order;  blocks, replicates: how many were used."""

    mean: float
    expected: float
    error: float
    mean_beyond_margin: float
    p_wide: float
    p_narrow: float
    p_reversed: float
    blocks: int
    replicates: int
    shared: bool = False
    """The blocks are `narrow` because the sides share noise."""
    level: float = LEVEL

    @property
    def wide(self) -> bool:
        """The blocks differ more than replicates of one side do."""
        return self.p_wide < self.level / 2.0

    @property
    def narrow(self) -> bool:
        """The blocks differ less than independent replicates do."""
        return 2.0 * min(self.p_narrow, self.p_reversed) < self.level / 2.0


def uniformity(a: Side, b: Side, margins: Margins, level: float = 1.0) -> Uniformity | None:
    """The test; None if there are too few replicates, unequal samples, or no block with noise.

    level: the share of the family's level that is used.
    """
    if a.pictures is None or b.pictures is None or min(a.count, b.count) < LEAST:
        return None
    if are_unequal(noise_ratio(a, b)):
        return None
    half = 2 ** int(math.log2(min(a.count, b.count)))
    pictures = a.pictures[:half], b.pictures[:half]
    blocks = np.concatenate([cell_means(side, BLOCK) for side in pictures])
    # Row 0 of the matrix is constant; row `half` is the difference candidate - reference.
    contrasts = np.tensordot(hadamard(2 * half)[1:] / half, blocks, axes=1)
    difference = half - 1
    mean = cell_means(b.size, BLOCK)
    scale = divisor(mean, float(b.size.mean()))
    size = np.abs(contrasts)
    size[size <= margins.constant * scale] = 0.0
    # If the sides are equal, only half of the other functions contain noise.
    noisy = np.count_nonzero(np.delete(size, difference, axis=0), axis=0) >= half - 1
    if not noisy.any():
        return None
    size = size[:, noisy]
    # Bias and noise have equal signs half of the time, so their squares add.
    permitted = (margins.tile * scale[noisy]) ** 2 + _unmet(a, b)[noisy]
    beyond = np.sqrt(np.maximum(size[difference] ** 2 - permitted, 0.0))
    means = _mean_p_values(size)
    others = np.delete(means, difference)
    expected = float(others.mean())
    error, dof = _spread(others, size.shape[1], 0)
    of_reversed = _spread(others, size.shape[1], half - 1)
    excess = float(means[difference]) - expected
    beyond_mean = float(_p_values(beyond, np.delete(size, difference, axis=0)).mean())
    found = Uniformity(
        mean=float(means[difference]),
        expected=expected,
        error=error,
        mean_beyond_margin=beyond_mean,
        p_wide=float(special.stdtr(dof, (beyond_mean - expected) / error)),
        p_narrow=float(special.stdtr(dof, -excess / error)),
        p_reversed=float(special.stdtr(of_reversed[1], -excess / of_reversed[0])),
        blocks=int(noisy.any(axis=-1).sum()),
        replicates=half,
        level=level * LEVEL,
    )
    return replace(found, shared=found.narrow and shared_by_sides(*pictures))


def _spread(others: FloatArray, blocks: int, order: int) -> tuple[float, int]:
    """The standard error of the difference's mean p-value, from those of the other functions, and
    its degrees of freedom.

    If the two sides' replicates are correlated in pairs, the functions with equal signs within
    pairs have another mean than the rest. Picture i may be paired with picture i of the other side
    (order 0), or with the one that is as far from the end (order half - 1): Walsh functions then
    have equal or opposite signs by the parity of their index.
    """
    half = len(others) // 2 + 1
    index = np.delete(np.arange(1, 2 * half), half - 1)
    group = 2 * (index >= half) + np.bitwise_count(index & order) % 2
    means = {k: others[group == k].mean() for k in np.unique(group)}
    squares = sum(float(((others[group == k] - mean) ** 2).sum()) for k, mean in means.items())
    dof = len(others) - len(means)
    error = math.sqrt(squares / dof * (1.0 + 1.0 / len(others)))
    # At least the standard deviation of the mean of as many independent uniform numbers.
    return max(error, math.sqrt(1.0 / 12.0 / blocks)), dof


def _unmet(a: Side, b: Side) -> FloatArray:
    """The square of two standard errors of rare light (see `rare`) in the blocks' differences. The
    ranks presume noise of one distribution on both sides; of a side that seldom meets a light, most
    blocks are darker, though none by more than a few events."""
    difference = cell_means(a.mean - b.mean, BLOCK)
    events = Events.of(a, b, tiles(b.mean, BLOCK))
    return np.asarray(8.0 * np.abs(difference) * events.missed_by(difference))


def _p_values(value: FloatArray, others: FloatArray) -> FloatArray:
    """The fraction of others (K, n) above each value (n,), equal ones counting half."""
    above = np.count_nonzero(others > value, axis=0)
    level = np.count_nonzero(others == value, axis=0)
    return np.asarray((above + 0.5 * level) / len(others))


def _mean_p_values(sizes: FloatArray) -> FloatArray:
    """For each row of (K, n) the mean of its p-values among the other rows."""
    return np.asarray((len(sizes) - ranks_of(sizes)).mean(axis=1) / (len(sizes) - 1))
