"""The layer `variance` against the spread of independent pictures.

Of two pictures a, b of a pixel with the estimates va, vb, the mean of (a - b)² / 2 is the true
variance, and so is the mean of (va + vb) / 2.  Their difference is 0 in the mean, for every
pixel, pair and channel, whatever the noise is.  It is summed with weights that come from the
other pictures, so that bright pixels do not count alone and the mean stays 0.
"""

import math
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray

VARIANCE_LIMIT = 6.0
"""Largest sum, in units of its standard error: a chance of 1e-9 each way by the normal
distribution.  The summands are skewed, hence so large."""

SMALLEST = 0.03
"""Smallest relative error of the variance that is reported: of the standard deviation half of it.
It covers what the skewness of few bright pixels leaves of the bound above."""


class Spread(NamedTuple):
    """ratio: the estimated variance over the pictures' spread, weighted means;  score: the
    difference in units of its standard error, positive where the estimate is too large."""

    ratio: float
    score: float

    def differs(self, upper: bool) -> bool:
        """Whether the estimate is wrong;  upper: it may be too large, as for stratified samples."""
        if not math.isfinite(self.score):
            return True
        if abs(self.ratio - 1.0) <= SMALLEST or abs(self.score) <= VARIANCE_LIMIT:
            return False
        return self.score < 0.0 or not upper


def compare_spread(pictures: FloatArray, variances: FloatArray) -> Spread:
    """Compare estimates of the variance of each pixel's mean with the spread of independent
    pictures: both (replicates, height, width, 3), an even number of at least four."""
    count = len(pictures) // 2
    a, b = pictures[0::2], pictures[1::2]
    spread = 0.5 * (a - b) ** 2
    estimate = 0.5 * (variances[0::2] + variances[1::2])
    if not (np.isfinite(spread).all() and np.isfinite(estimate).all()):
        return Spread(math.nan, math.nan)
    if (estimate < 0.0).any():
        return Spread(float(estimate.min()), -math.inf)
    total = estimate + spread
    others = (total.sum(axis=0) - total) / (count - 1)
    typical = others.mean(axis=(1, 2), keepdims=True)
    if not typical.all():
        return Spread(1.0, 0.0)  # a channel without any noise, or nearly
    weight = 1.0 / (others + typical)
    off = weight * (estimate - spread)
    error = math.sqrt(float(np.sum(off * off)))
    ratio = float(np.sum(weight * estimate)) / max(float(np.sum(weight * spread)), 1e-300)
    return Spread(ratio, float(off.sum()) / error if error > 0.0 else 0.0)
