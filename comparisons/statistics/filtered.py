"""Pixels of a known reference that share samples through a filter."""

import math

import numpy as np
from scipy import special
from scipy.ndimage import correlate1d

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import tile_sums
from comparisons.statistics.metrics import ratio

NEAR = 4
"""Pixels: beyond the diameter of usual filters, whose radii are 2 at most."""

FAR = 8
"""Pixels: noise is not correlated from NEAR on to here."""

CLEAR = 2.0
"""Standard errors of the excess below which it counts as none: one independent reference in forty
has more by chance, and costs a little sensitivity. What is overlooked is at most 0.4 of the
variance for 48 x 48 pixels, which is 0.2 of the standard error."""

PAIRS = (2 * NEAR + 1) ** 2 - 1
"""The neighbours of a pixel that are near."""


def excess_by_filter(candidate: FloatArray, reference: FloatArray, variance: FloatArray) -> float:
    """By which fraction the variance of a mean of many pixels of a known reference exceeds that of
    independent ones; 0 if that is not clear;  variance: the reference's; all (height, width, 3).

    The variance of each pixel does not show that pixels share samples through a filter: that of a
    mean of many is then larger, by the sum of the correlations with all neighbours.  These are
    measured on the difference of the pictures, over the reference's standard deviation.  What the
    pictures differ by besides noise is correlated over longer distances, too, and is subtracted as
    the covariance there; the candidate's own correlation counts as the reference's, to the safe
    side.
    """
    noisy = variance > 0.0
    height, width = reference.shape[:2]
    if min(height, width) <= 2 * FAR:
        return 0.0
    weights = np.where(noisy, 1.0 / np.sqrt(np.where(noisy, variance, 1.0)), 0.0)
    z, picture = (candidate - reference) * weights, reference * weights
    z -= picture * ratio((z * picture).sum(axis=(0, 1)), (picture**2).sum(axis=(0, 1)))
    near, far = (tile_sums(x) for x in _products(z))
    pairs_near, pairs_far = (tile_sums(x) for x in _products(noisy.astype(np.float64)))
    some = (pairs_near > 0.0) & (pairs_far > 0.0)
    covariances = near[some] / pairs_near[some] - far[some] / pairs_far[some]
    if not len(covariances):
        return 0.0
    # The lower quartile, which the errors of half of the tiles do not move, and what it is below
    # the mean by chance. Each pair of pixels is of the same products twice.
    power = float((z**2).sum()) / float(noisy.sum())
    error = PAIRS * power * math.sqrt(2.0 / float(pairs_near.sum()))
    quartile = PAIRS * float(np.quantile(covariances, 0.25))
    total = quartile - special.ndtri(0.25) * error * math.sqrt(len(covariances))
    return total if total > CLEAR * error else 0.0


def _products(z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(height, width) each: of each pixel's z (height, width, 3) with those near it, and further
    off; summed over channels."""
    boxes = [
        correlate1d(
            correlate1d(z, np.ones(2 * r + 1), 0, mode="constant"),
            np.ones(2 * r + 1),
            1,
            mode="constant",
        )
        for r in (NEAR, FAR)
    ]
    return (z * (boxes[0] - z)).sum(axis=-1), (z * (boxes[1] - boxes[0])).sum(axis=-1)
