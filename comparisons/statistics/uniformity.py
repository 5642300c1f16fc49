"""Whether the p-values of small blocks are uniform: the spread of the difference as a whole.

The candidate's and the reference's G replicates are 2G pictures, and their difference is one of
2G - 1 Walsh functions of them, all orthogonal: every other one takes as many pictures of a side
with a plus as with a minus, so that it holds the same noise and no bias. Where the replicates of
both sides are alike, the automorphisms of the Walsh functions make no difference between the
first and the others, whatever the law of the noise; so the rank of its absolute value among
them is uniform in each block, and the mean of the ranks over all blocks is one of 2G - 1
exchangeable numbers. Blocks may depend on each other: then all these numbers scatter more, which
is measured. (The p-values of Student's t would not be uniform with heavy tails.)

A mean p-value that is too small tells of blocks that differ systematically, or of replicates
that are not independent of each other; one too large of a candidate and a reference that share
their noise.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.linalg import hadamard

from comparisons.results.case import FloatArray
from comparisons.statistics.scales import DARK, UNIFORMITY_LEVEL, Margins, cell_means
from comparisons.statistics.sides import Side

BLOCK = 4
"""Side of a block in pixels: larger than a filter's reach, and many blocks even in small ones."""

LEAST = 4
"""Replicates on each side without which there are too few Walsh functions to compare with."""


@dataclass(frozen=True)
class Uniformity:
    """The mean p-value of the blocks, expected to be near `expected`, by `error` (one standard
    deviation); wide: that of differences beyond the margin.  p_wide, p_narrow: of either side."""

    mean: float
    expected: float
    error: float
    mean_beyond_margin: float
    p_wide: float
    p_narrow: float
    blocks: int
    replicates: int

    @property
    def wide(self) -> bool:
        """The blocks differ more than replicates of one side do."""
        return self.p_wide < UNIFORMITY_LEVEL / 2.0

    @property
    def narrow(self) -> bool:
        """The blocks differ less than independent replicates do."""
        return self.p_narrow < UNIFORMITY_LEVEL / 2.0


def uniformity(a: Side, b: Side, margins: Margins) -> Uniformity | None:
    """None where there are too few replicates, or no block with noise."""
    if a.pictures is None or b.pictures is None or min(a.count, b.count) < LEAST:
        return None
    half = 2 ** int(math.log2(min(a.count, b.count)))
    pictures = a.pictures[:half], b.pictures[:half]
    blocks = np.concatenate([cell_means(side, BLOCK) for side in pictures])
    # Row 0 of the matrix is constant; row `half` is the difference candidate - reference.
    contrasts = np.tensordot(hadamard(2 * half)[1:] / half, blocks, axes=1)
    difference = half - 1
    mean = cell_means(b.mean, BLOCK)
    scale = np.maximum(np.abs(mean), DARK * abs(float(b.mean.mean())))
    size = np.abs(contrasts)
    size[size <= margins.constant * scale] = 0.0
    # Of equal sides there is noise in half of the others only.
    noisy = np.count_nonzero(np.delete(size, difference, axis=0), axis=0) >= half - 1
    if not noisy.any():
        return None
    size = size[:, noisy]
    # A bias has the noise's sign as often as not, and so adds to its square.
    permitted = margins.tile * scale[noisy]
    beyond = np.sqrt(np.maximum(size[difference] ** 2 - permitted**2, 0.0))
    means = _mean_p_values(size)
    others = np.delete(means, difference)
    expected, dof = float(others.mean()), len(others) - 2
    # Where replicates of the two sides are alike in pairs, the functions that take both of a pair
    # with one sign scatter about another mean than the others.
    halves = others[: half - 1], others[half - 1 :]
    squares = sum(float(((part - part.mean()) ** 2).sum()) for part in halves)
    error = math.sqrt(squares / dof * (1.0 + 1.0 / len(others)))
    beyond_mean = float(_p_values(beyond, np.delete(size, difference, axis=0)).mean())
    # No fewer than the scatter of so many uniform numbers if all were independent.
    error = max(error, math.sqrt(1.0 / 12.0 / size.shape[1]))
    return Uniformity(
        mean=float(means[difference]),
        expected=expected,
        error=error,
        mean_beyond_margin=beyond_mean,
        p_wide=float(stats.t.cdf((beyond_mean - expected) / error, dof)),
        p_narrow=float(stats.t.sf((means[difference] - expected) / error, dof)),
        blocks=int(noisy.any(axis=-1).sum()),
        replicates=half,
    )


def _p_values(value: FloatArray, others: FloatArray) -> FloatArray:
    """The fraction of others (K, n) above each value (n,), equal ones counting half."""
    above = np.count_nonzero(others > value, axis=0)
    level = np.count_nonzero(others == value, axis=0)
    return np.asarray((above + 0.5 * level) / len(others))


def _mean_p_values(sizes: FloatArray) -> FloatArray:
    """For each row of (K, n) the mean of its p-values among the other rows."""
    ranks = stats.rankdata(sizes, axis=0)
    return np.asarray((len(sizes) - ranks).mean(axis=1) / (len(sizes) - 1))
