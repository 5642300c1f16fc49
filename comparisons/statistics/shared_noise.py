"""Tests whether replicates that should be independent share noise."""

import math

import numpy as np

from comparisons.results.case import FloatArray
from comparisons.statistics.scales import tile_sums

FEWEST_PIXELS = 256
"""Least number of noisy pixels for these tests."""

WHITE = 0.15
"""Largest correlation of neighbouring pixels for noise that is independent between pixels; errors
of a picture lie along edges or over surfaces, and are correlated."""

LIKE_PICTURE = 0.1
"""Largest fraction of common noise that the reference, its gradient and its curvature may explain:
a gain, a shift or a filter causes such a difference in a picture with fine texture."""

EVERYWHERE = 0.5
"""Least common noise of the median tile, as a fraction of the mean: shared noise is everywhere."""


def largest_correlation(pictures: FloatArray) -> tuple[int, int, float] | None:
    """The two replicates of (R, height, width, 3), R > 2, with the most correlated noise, and the
    correlation; None if there is too little noise.

    Deviations of independent replicates from the common mean have a correlation of -1 / (R - 1),
    which is subtracted.
    """
    count = len(pictures)
    deviation = pictures - pictures.mean(axis=0)
    scale = np.sqrt((deviation**2).mean(axis=0))
    noisy = scale > 1e-9 * max(float(np.abs(pictures).max()), 1e-300)
    if np.count_nonzero(noisy.any(axis=-1)) < FEWEST_PIXELS:
        return None
    z = deviation[:, noisy] / scale[noisy]
    correlation = z @ z.T / z.shape[1]
    np.fill_diagonal(correlation, -np.inf)
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(correlation), correlation.shape))
    return i, j, float(correlation[i, j]) * (count - 1) / count + 1.0 / count


def common_noise(candidate: FloatArray, reference: FloatArray) -> float | None:
    """The variance of the error common to all replicates of the candidate, over the variance of one
    replicate; None if that error does not look like noise.

    Both (replicates, height, width, 3).  Unlike the error of a wrong picture, noise is independent
    between pixels, present everywhere, and unlike the picture and its gradient.
    """
    sides = (candidate, reference)
    variances = [x.var(axis=0, ddof=1) for x in sides]
    own = variances[0].sum(axis=-1)
    difference = candidate.mean(axis=0) - reference.mean(axis=0)
    noise = sum(v.sum(axis=-1) / len(x) for v, x in zip(variances, sides, strict=True))
    noisy = own > 1e-12 * float((reference**2).mean())
    if np.count_nonzero(noisy) < FEWEST_PIXELS:
        return None
    total = tile_sums(np.where(noisy, (difference**2).sum(axis=-1) - noise, 0.0))
    of_own = tile_sums(np.where(noisy, own, 0.0))
    some = of_own > 0.0
    ratios = total[some] / of_own[some]
    share = float(total.sum() / of_own.sum())
    scatter = float(ratios.std()) / math.sqrt(max(len(ratios) - 1, 1))
    if not float(ratios.mean()) > 5.0 * scatter:  # one false alarm in a million, were it normal
        return None
    if not (share > 0.0 and float(np.median(ratios)) > EVERYWHERE * float(ratios.mean()) > 0.0):
        return None
    z = np.where(noisy, difference.sum(axis=-1) / np.sqrt(np.where(noisy, own, 1.0)), 0.0)
    if max(abs(_neighbours(z)), abs(_neighbours(z.T))) > WHITE:
        return None
    if _explained(z, reference.mean(axis=0).sum(axis=-1), own, noisy) > LIKE_PICTURE:
        return None
    return share


def _neighbours(z: FloatArray) -> float:
    """The correlation of horizontal neighbours."""
    left, right = z[:, :-1], z[:, 1:]
    power = math.sqrt(float((left**2).sum()) * float((right**2).sum()))
    return float((left * right).sum()) / power if power else 0.0


def _explained(z: FloatArray, picture: FloatArray, own: FloatArray, noisy: FloatArray) -> float:
    """The fraction of z that the picture, its gradient and its curvature explain, fitted
    jointly."""
    if min(picture.shape) < 3:
        return 1.0
    dy, dx = (np.asarray(slope) for slope in np.gradient(picture))
    curvature = np.asarray(np.gradient(dy, axis=0)) + np.asarray(np.gradient(dx, axis=1))
    weights = 1.0 / np.sqrt(own[noisy])
    basis = np.stack([x[noisy] * weights for x in (picture, dx, dy, curvature)], axis=1)
    wanted = z[noisy]
    fitted = basis @ np.linalg.lstsq(basis, wanted, rcond=None)[0]
    return float((fitted**2).sum() / (wanted**2).sum())
