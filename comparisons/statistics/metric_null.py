"""The null distribution of image metrics: their values if two pictures differ only by noise.

It is resampled from the replicates: a random half of each side's against the other half.  Their
difference d* has mean zero whatever the sides' means are, and has the tails of the noise and the
correlation of neighbouring pixels.  The sides' noise may have different strength: d* is added to a
weighted mean of both pictures, split in proportion to their variances in the tile.  For Gaussian
noise these pairs are distributed as the given pair would be without bias.
"""

import math

import numpy as np
from scipy import special

from comparisons.results.case import FloatArray, Images
from comparisons.statistics.cells import HALF, TILE, tile_sums
from comparisons.statistics.metrics import LocalErrors, local_errors, relative_squares
from comparisons.statistics.rare import share_unmet, unmet_variance
from comparisons.statistics.sides import side_of

NOISE_LIMIT = 1.25
"""Largest permitted squared difference of noisy pictures over that of their noise: Mitsuba's
systematic error (float32, its ray epsilon) may reach half the standard deviation of a pixel."""

LEVEL = 1e-5
"""Chance of a false alarm at each threshold.  The seven thresholds make less than 1e-4 a case."""

TILES = 64
"""Least number of tiles that estimate the scatter of a metric: for small pictures more pairs are
drawn."""


FEWEST = 4
"""Least number of replicates of a side for resampling: halves of fewer lack the tails."""

FEWEST_PIXELS = 16
"""Least effective number of pixels that must have the noise of the squared difference.  A draw
turns each replicate either way, so that two samples that met a lamp in one pixel cancel in half of
the draws.  Of a large picture there are two draws: they show none of that noise in a quarter of all
cases if one pixel has it, and in 4^-16 of them if 16 have."""

MOST_NOISE = 0.5
"""Largest noise of the pictures' difference, as a fraction of the median tile's radiance: with
more, the mean of skewed noise is far from normal (measured with gamma distributions, 100 runs each:
no false alarm at 0.7, three at 1.0).  Then, or with fewer replicates than FEWEST, only the squared
difference and the bias are judged."""


MOST_UNMET = 0.01
"""Largest share of pixels that differ by more than the spread of their replicates shows, though not
by more than light does that few replicates met (`share_unmet`): with more, contrasts of the
replicates are smaller than the noise. Measured with 8 and 16 replicates: at most 0.11 % in the
scenes of the suite, 1.5 to 46 % with small lamps that are found only by scattered rays."""


def can_draw(replicates: tuple[FloatArray, FloatArray]) -> bool:
    """Whether there are enough replicates, little enough noise, and little enough rare light, for
    resampling."""
    if any(len(x) < FEWEST and not is_known(x) for x in replicates):
        return False
    if _has_rare_light(replicates):
        return False
    noise = _tile_sums(_variance(*replicates))
    seen = _tile_sums(np.asarray(sum(x.mean(axis=0) for x in replicates)) ** 2) / 4.0
    lit = seen > 0.0
    return bool(lit.any() and np.median(noise[lit] / seen[lit]) <= MOST_NOISE**2)


def _variance(*sides: FloatArray) -> FloatArray:
    """(height, width, 3): of the difference of the means of replicates, or of one side's mean."""
    return np.asarray(sum(x.var(axis=0, ddof=1) / len(x) for x in sides))


def _has_rare_light(replicates: tuple[FloatArray, FloatArray]) -> bool:
    if any(is_known(x) or len(x) < 2 for x in replicates):
        return False
    return share_unmet(*(side_of(x) for x in replicates)) > MOST_UNMET


def noise_alone(
    images: Images, replicates: tuple[FloatArray, FloatArray], seed: int = 0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means of the `LocalErrors`, (5,) each: of the pictures, from noise alone, and the highest
    that are permitted: those of NOISE_LIMIT times the noise, plus the scatter at LEVEL.  These are
    infinite where fewer than FEWEST_PIXELS have the noise: draws do not show how far it scatters.

    Exposure is set by the weighted mean of both pictures, which is the same in all draws.
    """
    rng = np.random.default_rng(seed)
    share = _share(replicates)
    middle = (1.0 - share) * images.candidate + share * images.reference
    height, width = images.reference.shape[:2]
    tiles = math.ceil(height / TILE) * math.ceil(width / TILE)

    def errors(difference: FloatArray) -> LocalErrors:
        drawn = Images(middle + share * difference, middle - (1.0 - share) * difference)
        return local_errors(drawn, middle)

    mixing = _channel_mixing(images.candidate - images.reference)
    drawn = []
    for k in range(max(2, math.ceil(TILES / tiles))):
        a, b = (_contrast(rng, pictures, mixing) for pictures in replicates)
        difference = a - b
        drawn.append(errors(difference))
        if k == 0:
            more = errors(math.sqrt(NOISE_LIMIT) * difference)
    expected, highest = np.empty(5), np.empty(5)
    for k, maps in enumerate(zip(*drawn, strict=True)):
        expected[k] = np.mean(maps)
        allowance = max(0.0, float(more[k].mean() - maps[0].mean()))
        highest[k] = expected[k] + allowance + _scatter(np.stack(maps))
    measured = np.array([m.mean() for m in errors(images.candidate - images.reference)])
    variance = _variance(*replicates)
    darker = np.minimum(images.candidate, images.reference)
    relative = relative_squares(Images(darker + np.sqrt(variance), darker), middle)
    # The other maps are bounded: no pixel has more than its share of them.
    for k, noise in ((-2, variance.mean(axis=-1)), (-1, relative)):
        if noise.sum() ** 2 < FEWEST_PIXELS * (noise**2).sum():
            highest[k] = math.inf
    return measured, expected, highest


def _share(replicates: tuple[FloatArray, FloatArray]) -> FloatArray:
    """(height, width, 1): the candidate's share of the variance of each pixel's tile.  By tiles,
    since one firefly has more variance than all the rest of a picture."""
    ours, both = (_tile_sums(_variance(*sides)) for sides in (replicates[:1], replicates))
    share = np.divide(ours, both, out=np.full_like(both, 0.5), where=both > 0.0)
    height, width = replicates[0].shape[1:3]
    share = share.reshape(math.ceil(height / TILE), -1)
    return share.repeat(TILE, axis=0).repeat(TILE, axis=1)[:height, :width, None]


def _channel_mixing(difference: FloatArray) -> FloatArray:
    """(3, 3): gives independent normal numbers the correlations that the channels of a difference
    have.  The variance of a known reference does not tell them; FLIP sees noise of hues more.

    From the share of pixels where two channels have one sign (Sheppard 1899), which no firefly
    changes.
    """
    signs = np.sign(difference).reshape(-1, 3)
    pairs = np.maximum(np.abs(signs).T @ np.abs(signs), 1.0)
    correlation = np.sin(0.5 * math.pi * (signs.T @ signs) / pairs)
    np.fill_diagonal(correlation, 1.0)
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _contrast(rng: np.random.Generator, pictures: FloatArray, mixing: FloatArray) -> FloatArray:
    """(replicates, height, width, 3) -> (height, width, 3): a draw of the noise of their mean;
    mixing: of the channels, if only moments are known."""
    count = len(pictures)
    if is_known(pictures):
        normal = rng.standard_normal(pictures.shape[1:]) @ mixing.T
        return np.asarray(0.5 * (pictures[0] - pictures[1]) * normal)
    signs = np.zeros(count)
    half = count // 2
    signs[:half], signs[half : 2 * half] = 1.0, -1.0
    weights = rng.permutation(signs) / math.sqrt(2 * half * count)
    return np.asarray(np.tensordot(weights, pictures, axes=1))


def is_known(pictures: FloatArray) -> bool:
    """Whether the two pictures of a side are not replicates, but a mean plus and minus its standard
    error: by chance no picture is below another everywhere."""
    if len(pictures) != 2:
        return False
    difference = pictures[0] - pictures[1]
    return bool((difference >= 0.0).all() or (difference <= 0.0).all())


def _scatter(maps: FloatArray) -> float:
    """How far the mean of one map exceeds the mean of `maps` (draws, height, width), at LEVEL.

    Estimated from the variance of tiles between draws; the degrees of freedom are the effective
    number of tiles: 1 if a single tile has all the variance.
    """
    sums = np.stack([tile_sums(m) for m in maps]) / maps[0].size
    variance = sums.var(axis=0, ddof=1)
    total = max(float(variance.sum()), float(sums.sum(axis=1).var(ddof=1)))
    if not total > 0.0:
        return 0.0
    # Over the total first: squares of dim pictures' variances would be 0.
    dof = max(1.0, 1.0 / max(float(((variance / total) ** 2).sum()), 1e-300))
    quantile = -float(special.stdtrit(dof, LEVEL))
    return quantile * math.sqrt(total * (1.0 + 1.0 / len(maps)))


def noise_ratio(candidate: FloatArray, reference: FloatArray) -> tuple[float, float]:
    """The squared difference of the mean pictures over its expectation from the replicates'
    variances, averaged over tiles (1 if only noise differs), and its standard error.

    (replicates, height, width, 3) on both sides.  Tiles have equal weight: the edge of a lamp has
    most of a picture's variance, and would hide the rest.  0, 0 without noise and difference.
    """
    sides = (candidate, reference)
    difference2 = (candidate.mean(axis=0) - reference.mean(axis=0)) ** 2
    variance = _variance(*sides)
    if _has_rare_light(sides):
        variance = variance + unmet_variance(*(side_of(x) for x in sides))
    observed, noise = _tile_sums(difference2), _tile_sums(variance)
    rounding = _tile_sums((HALF * reference.mean(axis=0)) ** 2)
    # Without noise, as in a background, the bound is twice the rounding of stored values.
    noisy = noise > rounding
    if np.any(observed[~noisy] > 4.0 * (noise + rounding)[~noisy]):
        return np.inf, 0.0
    if not noisy.any():
        return 0.0, 0.0
    ratios = observed[noisy] / noise[noisy]
    return float(ratios.mean()), float(ratios.std() / np.sqrt(max(len(ratios) - 1, 1)))


def _tile_sums(picture: FloatArray) -> FloatArray:
    """Sums over channels and over tiles."""
    return tile_sums(picture.sum(axis=-1))
