"""What the metrics of two noisy pictures are if only their noise differs.

It is drawn from the replicates: half of each side's, at random, and the other halves make two
pictures that have the same mean whatever the sides' means are.  So their difference d* is noise as
it is, with its tails, and however that of neighbouring pixels hangs together.  As the sides may
have noise of different strength, d* is put upon the mean of both, weighted by the other's variance,
in these strengths' proportion: for Gaussian noise that makes pairs distributed as the given one.
"""

import math

import numpy as np
from scipy import stats

from comparisons.results.case import FloatArray, Images
from comparisons.statistics.metrics import LocalErrors, local_errors

NOISE_LIMIT = 1.25
"""How much more than their noise noisy pictures may differ, as a ratio of squares: Mitsuba's own
systematic error (float32, its ray epsilon) may reach half the standard deviation of a pixel."""

FLOAT32 = 1e-5
"""Of a pixel: what float32 may do to Mitsuba's where there is no noise, a background say; the bound
that the Whitted rung holds pixels to."""

LEVEL = 1e-5
"""Chance of a false alarm of each threshold.  The seven of them make less than 1e-4 of a case."""

TILE = 16

TILES = 64
"""So many tiles tell how a metric scatters: of small pictures more pairs are drawn."""


FEWEST = 4
"""Replicates of a side from which noise is drawn: of fewer the halves are too few to have the tails
of the whole."""

MOST_NOISE = 0.5
"""Of the pictures' difference, as a fraction of what is seen in the median tile: with more, skewed
noise is far from normal even as a mean (measured with noise of gamma distributions, 100 runs each:
no false alarm at 0.7, three at 1.0).  Then, or with FEWEST missing, the squared difference and the
bias are judged alone."""


def can_draw(replicates: tuple[FloatArray, FloatArray]) -> bool:
    """Whether there are enough replicates, and little enough noise, to draw from."""
    if any(len(x) < FEWEST and not is_known(x) for x in replicates):
        return False
    noise = _tile_sums(np.asarray(sum(x.var(axis=0, ddof=1) / len(x) for x in replicates)))
    seen = _tile_sums(np.asarray(sum(x.mean(axis=0) for x in replicates)) ** 2) / 4.0
    lit = seen > 0.0
    return bool(lit.any() and np.median(noise[lit] / seen[lit]) <= MOST_NOISE**2)


def noise_alone(
    images: Images, replicates: tuple[FloatArray, FloatArray], seed: int = 0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The means of `LocalErrors` (5,): of the pictures, what noise alone gives, and the highest
    that are borne, which are those of NOISE_LIMIT times the noise, and the scatter at LEVEL.

    Exposed by the mean of both pictures, for what is not the same in all draws.
    """
    rng = np.random.default_rng(seed)
    variances = [float((x.var(axis=0, ddof=1) / len(x)).mean()) for x in replicates]
    # Of the candidate in the variance: where neither has any, nothing is drawn.
    share = variances[0] / sum(variances) if sum(variances) else 0.5
    middle = (1.0 - share) * images.candidate + share * images.reference
    height, width = images.reference.shape[:2]
    tiles = math.ceil(height / TILE) * math.ceil(width / TILE)

    def errors(difference: FloatArray) -> LocalErrors:
        drawn = Images(middle + share * difference, middle - (1.0 - share) * difference)
        return local_errors(drawn, middle)

    drawn = []
    for k in range(max(2, math.ceil(TILES / tiles))):
        difference = _contrast(rng, replicates[0]) - _contrast(rng, replicates[1])
        drawn.append(errors(difference))
        if k == 0:
            more = errors(math.sqrt(NOISE_LIMIT) * difference)
    expected, highest = np.empty(5), np.empty(5)
    for k, maps in enumerate(zip(*drawn, strict=True)):
        expected[k] = np.mean(maps)
        allowance = max(0.0, float(more[k].mean() - maps[0].mean()))
        highest[k] = expected[k] + allowance + _scatter(np.stack(maps))
    found = np.array([m.mean() for m in errors(images.candidate - images.reference)])
    return found, expected, highest


def _contrast(rng: np.random.Generator, pictures: FloatArray) -> FloatArray:
    """(replicates, height, width, 3) -> (height, width, 3): noise like that of their mean."""
    count = len(pictures)
    if is_known(pictures):
        return np.asarray(
            0.5 * (pictures[0] - pictures[1]) * rng.normal(size=(*pictures.shape[1:3], 1))
        )
    signs = np.zeros(count)
    half = count // 2
    signs[:half], signs[half : 2 * half] = 1.0, -1.0
    weights = rng.permutation(signs) / math.sqrt(2 * half * count)
    return np.asarray(np.tensordot(weights, pictures, axes=1))


def is_known(pictures: FloatArray) -> bool:
    """Whether a side is no pair of replicates, but a mean with its standard error added to it and
    taken from it: by chance no picture is below another everywhere."""
    if len(pictures) != 2:
        return False
    difference = pictures[0] - pictures[1]
    return bool((difference >= 0.0).all() or (difference <= 0.0).all())


def _scatter(maps: FloatArray) -> float:
    """How far the mean of such a map is above the mean of `maps` (draws, height, width), at LEVEL.

    From how tiles scatter from draw to draw; the degrees of freedom are the tiles that matter:
    where one of them has all the scatter, the estimate is worth one draw.
    """
    sums = np.stack([_tile_sums(m[..., None]) for m in maps]) / maps[0].size
    variance = sums.var(axis=0, ddof=1)
    total = max(float(variance.sum()), float(sums.sum(axis=1).var(ddof=1)))
    if not total > 0.0:
        return 0.0
    dof = max(1.0, total**2 / float((variance**2).sum()))
    quantile = float(stats.t.isf(LEVEL, dof))
    return quantile * math.sqrt(total * (1.0 + 1.0 / len(maps)))


def noise_ratio(candidate: FloatArray, reference: FloatArray) -> tuple[float, float]:
    """The squared difference of the mean pictures over its expectation from the replicates' own
    variances, as the mean over tiles (1 where only noise differs), and its standard error.

    (replicates, height, width, 3) on both sides.  Tiles count alike: the edge of a lamp has most
    of a picture's variance, and would drown the rest.  0, 0 where nothing differs or is noisy.
    """
    sides = (candidate, reference)
    difference2 = (candidate.mean(axis=0) - reference.mean(axis=0)) ** 2
    variance = sum(x.var(axis=0, ddof=1) / len(x) for x in sides)
    observed, noise = _tile_sums(difference2), _tile_sums(np.asarray(variance))
    rounding = _tile_sums((FLOAT32 * reference.mean(axis=0)) ** 2)
    # A background has no noise to measure by: there the bound is float32's, twice over.
    noisy = noise > rounding
    if np.any(observed[~noisy] > 4.0 * (noise + rounding)[~noisy]):
        return np.inf, 0.0
    if not noisy.any():
        return 0.0, 0.0
    ratios = observed[noisy] / noise[noisy]
    return float(ratios.mean()), float(ratios.std() / np.sqrt(max(len(ratios) - 1, 1)))


def _tile_sums(picture: FloatArray) -> FloatArray:
    """Sums over TILE x TILE tiles; those at the right and the bottom may be smaller."""
    rows = np.add.reduceat(picture.sum(axis=-1), np.arange(0, picture.shape[0], TILE), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, picture.shape[1], TILE), axis=1).ravel())
