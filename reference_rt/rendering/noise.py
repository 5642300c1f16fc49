"""The noise of a picture, estimated from the spread of its passes.

Each pass adds n_k samples to a pixel, whose sum is S_k; all of them, S = sum S_k of n = sum n_k
samples.  If samples are independent,

    sum over k of n_k (S_k / n_k - S / n)^2  =  sum S_k^2 / n_k - S^2 / n

has the mean (passes - 1) times the variance of a sample, so that dividing it by (passes - 1) n
estimates the variance of the pixel's mean.  Samples of Sobol' points are better than independent
ones: for them the estimate is too large, so that a picture is at least as good as it says.

What is kept for this is summed over the pixels and channels of a chunk.  The difference above
cancels only where the noise is below 1e-7 of the picture, far below what a limit asks for.
"""

import math

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray

BETWEEN, PASSES, ENERGY, TOTAL = range(4)
"""Columns of the statistics of a chunk: the sum of S_k^2 / n_k, the number of passes, the sums of
S^2 and of S."""

COLUMNS = 4


def statistics(before: FloatArray, after: FloatArray, samples: int, chunk: int) -> FloatArray:
    """Statistics (chunks, COLUMNS) of a unit; those of its first two columns are to be added.

    before, after: the sums of colour (n, 3) of its pixels;  samples: how many it adds to each.
    """
    with np.errstate(all="ignore"):  # infinite radiance
        added = _over_channels(np.square(after - before)) / samples
        values = (added, _over_channels(np.square(after)), _over_channels(after))
        starts = np.arange(0, len(after), chunk)
        between, energy, total = (np.add.reduceat(one, starts) for one in values)
        return np.stack([between, np.ones_like(between), energy, total], axis=1)


def _over_channels(values: FloatArray) -> FloatArray:
    """The sums (n,) of values (n, 3).  By columns: `sum(axis=1)` takes six times as long, which
    was a twentieth of a picture of one sample a pixel (measured)."""
    return values[:, 0] + values[:, 1] + values[:, 2]


def relative_error(found: FloatArray, done: IntArray, pixels: int) -> float | None:
    """The relative standard error of a picture: the root mean square, over pixels and channels, of
    the standard error, divided by the mean; None as long as a chunk has fewer than two passes.

    found (chunks, COLUMNS): statistics;  done (chunks,): samples.  inf for a black picture.
    """
    if len(done) == 0 or found[:, PASSES].min() < 2.0:
        return None
    with np.errstate(all="ignore"):
        squares = found[:, BETWEEN] - found[:, ENERGY] / done
        variance = (squares / ((found[:, PASSES] - 1.0) * done)).sum() / (3 * pixels)
        mean = abs((found[:, TOTAL] / done).sum()) / (3 * pixels)
        if not mean > 0.0:
            return math.inf
        if not np.isfinite(variance):
            return math.inf
        return math.sqrt(max(float(variance), 0.0)) / float(mean)
