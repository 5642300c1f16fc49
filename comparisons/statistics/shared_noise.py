"""Tests whether replicates that should be independent share noise."""

import math

import numpy as np
import numpy.typing as npt
from scipy import ndimage, special
from scipy.linalg import helmert

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import HALF, tile_sums
from comparisons.statistics.order import deviations

FEWEST_PIXELS = 256
"""Least number of noisy pixels for these tests."""

CORRELATED = 0.1
"""Correlation of the noise of two replicates above which it matters."""

FEWEST_REPLICATES = 6
"""Least number of replicates whose pairs are compared: four or five have too few pairs to show how
far correlations scatter if all pixels share a few random numbers."""

OUTLYING = (4.0, 48.0)
"""(a, b): a correlation must lie a + b / R times the scatter of ordinary pairs above these before
two of R replicates share noise, 12 times for R = 6 and 7 times for R = 16. For noise that all
pixels have in common, of 1 to 1,000 components, normal or Laplace distributed, the largest of
independent replicates was 8 and 5 times away once in 1,000 runs; of one uniform random number, once
in 300 runs 8 times for R = 8."""

OUTLYING_ALONE = (5.0, 250.0)
"""(a, b): the same for one pair against the other R - 2 replicates alone: a + b / (R - 3)^2 times
their scatter. Of noise with 1 to 1,000 components, normal, Laplace or uniform, the largest of
independent pairs was 27.6, 9.4, 6.6 and 5.1 times away once in 1,000 runs for R = 6, 8, 12, 16."""

ORDINARY = 0.65
"""The fraction of pairs below which a pair is an ordinary one. If a single random number makes all
noise, pairs have correlations of +1 or -1, and at least 0.4 of them have +1. If each replicate
shares noise with the next one, 0.33 of the pairs of six do."""

WHITE = 0.15
"""Largest correlation of neighbouring pixels for noise that is independent between pixels; errors
of a picture lie along edges or over surfaces, and are correlated."""

LIKE_PICTURE = 0.1
"""Largest fraction of common noise that the reference's channels, their gradient and curvature may
explain: a gain, exchanged or mixed channels, a shift or a filter cause such a difference in a
picture with fine texture."""

BY_CHANCE = 5e-4
"""Chance that independent replicates have as much noise in common; the other conditions make an
alarm rarer still."""

SHARING = 2.0
"""How many times as much as that of independent tiles the squares of a difference of replicates
scatter if pixels far from each other share random numbers."""

FEWEST_TILES = 4
"""Least number of tiles whose scatter is compared with that of whole pictures."""

EVERYWHERE = 0.5
"""Least common noise of the median tile, as a fraction of the mean: shared noise is everywhere."""


def correlated_pair(pictures: FloatArray) -> tuple[int, int, float] | None:
    """The two replicates of (R, height, width, 3) that share noise, and its correlation; None if no
    two do, or if that cannot be told.

    Pixels may depend on each other, as in a photon map or after a denoiser. The correlations of
    independent replicates then scatter by 1 / sqrt(the number of independent pixels), which is the
    same for all pairs. So two share noise if their correlation is an outlier among all pairs, and
    much further from ordinary ones than any negative correlation. It must be so for the noise and
    for its detail: a rare event that brightens two pictures is smooth, equal seeds repeat detail.
    """
    count = len(pictures)
    z = deviations(pictures)
    pixels = int(np.count_nonzero(z.any(axis=(0, 3))))
    if count < FEWEST_REPLICATES or pixels < FEWEST_PIXELS:
        return None
    products = [_products(band) for band in (z, _detail(z))]
    bands = [_correlations(band) for band in products]
    lowest = np.min([band - _highest_by_chance(band, pixels) for band in bands], axis=0)
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(lowest), lowest.shape))
    if lowest[i, j] > 0.0:
        return i, j, float(bands[0][i, j])
    # Two that share noise pull the common mean towards them: their correlations with all others
    # become negative, and hide that they are outliers. So they are judged by the others alone.
    least = np.min(bands, axis=0)
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(least), least.shape))
    alone = [_beyond_others(band, i, j, pixels) for band in products]
    return (i, j, float(bands[0][i, j])) if min(alone) > 0.0 else None


def _detail(z: FloatArray) -> FloatArray:
    """Deviations from the mean of the neighbours."""
    around = np.array([[0.0, 0.25, 0.0], [0.25, 0.0, 0.25], [0.0, 0.25, 0.0]])
    return np.asarray(z - ndimage.convolve(z, around[None, :, :, None], mode="reflect"))


def _products(deviations: FloatArray) -> FloatArray:
    """(R, R): of the deviations of replicates, summed over a picture."""
    z = deviations.reshape(len(deviations), -1)
    return np.asarray(z @ z.T)


def _correlations(products: FloatArray) -> FloatArray:
    """(R, R): between replicates, -inf on the diagonal;  products: of deviations from their mean.

    Deviations of independent replicates from the common mean have a correlation of -1 / (R - 1),
    which is removed.
    """
    count = len(products)
    length = np.sqrt(np.maximum(np.diag(products), 1e-300))
    correlations = products / np.outer(length, length) * (count - 1) / count + 1.0 / count
    np.fill_diagonal(correlations, -np.inf)
    return np.asarray(correlations)


def _beyond_others(products: FloatArray, i: int, j: int, pixels: int) -> float:
    """By how much the correlation of replicates i and j, about the mean of the others, exceeds what
    the correlations of the others permit."""
    count = len(products)
    others = np.delete(np.arange(count), (i, j))
    about = np.eye(count)  # takes that mean from each replicate
    about[:, others] -= 1.0 / (count - 2)
    of_all = about @ products @ about.T
    # Both contain the noise of that mean, which is a correlation of 1 / (R - 1).
    length = math.sqrt(max(float(of_all[i, i] * of_all[j, j]), 1e-300))
    correlation = (float(of_all[i, j]) / length - 1.0 / (count - 1)) * (count - 1) / (count - 2)
    pairs = _correlations(of_all[np.ix_(others, others)])[np.triu_indices(count - 2, 1)]
    scatter = max(math.sqrt(float((pairs**2).mean())), 1.0 / math.sqrt(pixels))
    times = OUTLYING_ALONE[0] + OUTLYING_ALONE[1] / (count - 3) ** 2
    return correlation - max(CORRELATED, times * scatter, -2.0 * float(pairs.min()))


def _highest_by_chance(correlations: FloatArray, pixels: int) -> float:
    """The correlation that two independent replicates hardly ever exceed."""
    count = len(correlations)
    pairs = correlations[np.triu_indices(count, 1)]
    ordinary = float(np.quantile(pairs, ORDINARY, method="lower"))
    below = np.maximum(ordinary - pairs, 0.0)
    scatter = math.sqrt(float((below**2).sum()) / (ORDINARY * len(pairs)))
    scatter = max(scatter, 1.0 / math.sqrt(pixels))
    times = OUTLYING[0] + OUTLYING[1] / count
    return max(CORRELATED, ordinary + max(times * scatter, 2.0 * float(below.max())))


def common_noise(
    candidate: FloatArray, reference: FloatArray, step: FloatArray | None = None
) -> float | None:
    """The variance of the error common to all replicates of the candidate, over the variance of one
    replicate; None if that error does not look like noise.

    Both (replicates, height, width, 3).  step (height, width, 3): that of the rounding that alone
    makes the candidate's replicates differ; the variance is then that of the reference's.

    Unlike the error of a wrong picture, noise is independent between pixels, present everywhere,
    and unlike the picture and its gradient.  So is the rounding of texels that one side stores as
    half floats: what that may make is subtracted.  The error must exceed what the scatter of the
    replicates' own differences makes, which is large where all pixels use the same random numbers.
    """
    sides = (candidate, reference)
    variances = [x.var(axis=0, ddof=1) for x in sides]
    own = variances[0 if step is None else 1].sum(axis=-1)
    difference = candidate.mean(axis=0) - reference.mean(axis=0)
    noise = sum(v.sum(axis=-1) / len(x) for v, x in zip(variances, sides, strict=True))
    noise = noise + ((HALF * reference.mean(axis=0)) ** 2).sum(axis=-1)
    if step is not None:
        noise = noise + (0.25 * step**2).sum(axis=-1)  # a value is half a step off at most
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
    squares = float((difference[noisy] ** 2).sum())
    by_chance = sum(_factor_by_chance(x, noisy) for x in (sides if step is None else sides[1:]))
    if not math.log(max(squares, 1e-300) / float(noise[noisy].sum())) > by_chance:
        return None
    if not (share > 0.0 and float(np.median(ratios)) > EVERYWHERE * float(ratios.mean()) > 0.0):
        return None
    # Each channel by itself: errors of channels that are exchanged cancel in their sum.
    z = np.where(noisy[..., None], difference / np.sqrt(np.where(noisy, own, 1.0))[..., None], 0.0)
    if max(abs(_neighbours(np.moveaxis(side, -1, 0))) for side in (z, z.swapaxes(0, 1))) > WHITE:
        return None
    if _explained(z, reference.mean(axis=0), variances[1] / len(reference), own, noisy) > (
        LIKE_PICTURE
    ):
        return None
    return share


def _factor_by_chance(pictures: FloatArray, noisy: npt.NDArray[np.bool_]) -> float:
    """The logarithm of the factor by which the squares of the mean's noise hardly ever exceed their
    expectation: from R - 1 orthogonal differences of R replicates, each with the noise of one."""
    if len(pictures) < 3:
        return 0.0
    squares = (_differences(pictures)[:, noisy] ** 2).sum(axis=(1, 2))
    return _log_factor(squares)


def excess_by_sharing(pictures: FloatArray) -> float:
    """The factor by which the squares of the mean's noise hardly ever exceed their expectation if
    pixels far from each other share random numbers; 1 if they do not.  It may be infinite.

    pictures: replicates (R, height, width, 3).  It is 1 too for fewer than four replicates, which
    do not show it.
    """
    noise = tile_sums(pictures.var(axis=0, ddof=1).sum(axis=-1)) if len(pictures) > 3 else None
    if noise is None or not (noise > 0.0).any():
        return 1.0
    lit = noise > 0.0
    squares = (_differences(pictures) ** 2).sum(axis=-1)
    ratios = np.stack([tile_sums(x)[lit] / noise[lit] for x in squares])
    means = ratios.mean(axis=1)
    if ratios.shape[1] < FEWEST_TILES:
        return _factor(means)
    of_tiles = math.sqrt(float((ratios.var(axis=1, ddof=1) / ratios.shape[1]).mean()))
    if float(means.std(ddof=1)) < SHARING * of_tiles:
        return 1.0
    return _factor(means)


def _differences(pictures: FloatArray) -> FloatArray:
    """(R - 1, height, width, 3): orthogonal, each with the noise of one replicate and no mean."""
    return np.asarray(np.tensordot(helmert(len(pictures)), pictures, axes=1))


def _factor(squares: FloatArray) -> float:
    with np.errstate(over="ignore"):  # infinite where some differences vanish
        return float(np.exp(_log_factor(squares)))


def _log_factor(squares: FloatArray) -> float:
    scatter = float(np.log(np.maximum(squares, 1e-300)).std(ddof=1))
    return -float(special.stdtrit(len(squares) - 1, BY_CHANCE)) * scatter


def _neighbours(z: FloatArray) -> float:
    """The correlation of horizontal neighbours in pictures (..., height, width)."""
    left, right = z[..., :-1], z[..., 1:]
    power = math.sqrt(float((left**2).sum()) * float((right**2).sum()))
    return float((left * right).sum()) / power if power else 0.0


def _explained(
    z: FloatArray, picture: FloatArray, noise: FloatArray, own: FloatArray, noisy: FloatArray
) -> float:
    """The fraction of z (height, width, 3) that the picture's channels, and the gradient and
    curvature of their sum, explain, fitted jointly;  noise: the picture's variance."""
    if min(picture.shape[:2]) < 3:
        return 1.0
    grey = picture.sum(axis=-1)
    dy, dx = (np.asarray(slope) for slope in np.gradient(grey))
    curvature = np.asarray(np.gradient(dy, axis=0)) + np.asarray(np.gradient(dx, axis=1))
    weights = 1.0 / np.sqrt(own[noisy])
    channels = picture[noisy] * weights[:, None]
    # Mixtures of channels that are mostly noise, as where all have one hue, would explain noise.
    noise_of = (noise[noisy] * weights[:, None] ** 2).sum(axis=0) + 1e-300
    power, mixtures = np.linalg.eigh(channels.T @ channels / np.sqrt(np.outer(noise_of, noise_of)))
    seen = mixtures[:, power > SEEN] / np.sqrt(noise_of)[:, None]
    basis = np.column_stack([channels @ seen, *(x[noisy] * weights for x in (dx, dy, curvature))])
    wanted = z[noisy]
    fitted = basis @ np.linalg.lstsq(basis, wanted, rcond=None)[0]
    return float((fitted**2).sum() / (wanted**2).sum())


SEEN = 10.0
"""Least power of a mixture of channels over that of its noise: noise is then at most a tenth of
what the mixture explains, which is LIKE_PICTURE."""
