"""Image metrics of a candidate against its reference: SSIM, FLIP, PSNR, RMSE, relMSE, bias.

None of them alone is a test: a picture 20 % too bright still has an SSIM of 0.995.
`comparisons.rungs.images` sets the thresholds, given the noise."""

import functools
import math
import os
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats
from skimage.metrics import structural_similarity

from comparisons.results.case import FloatArray, Images, Metrics
from comparisons.statistics.rare import share_unmet, unmet_variance
from comparisons.statistics.sides import HALF, TILE, side_of, tile_sums
from reference_rt.rendering.image import srgb

WHITE_PERCENTILE = 99.0
"""The brightest percent of the lit values (lamps, highlights) may clip; the rest is resolved."""

SSIM_WINDOW = 7
"""Pixels; the side of the uniform window of Wang et al. 2004 as scikit-image does it."""

RELMSE_EPSILON = 0.01
"""The field's customary guard against dark pixels (Rousselle et al. 2011, "Adaptive sampling and
reconstruction using greedy error minimization"), which presumes a picture of mean about 1; it is
multiplied by the squared mean of the reference, so that exposure does not change the result."""


FLIP_DEGREE = 67.0
"""Pixels per degree of view: FLIP's default, a 0.7 m wide 4K display seen from 0.7 m."""

FLIP_WHITE = 0.85
"""The value to which FLIP's first exposure maps the brightest radiance, by its tone curve
(Andersson et al. 2021, "Visualizing and communicating errors in rendered images"); here
`white_level`."""

FLIP_STOPS = 4.0
"""Most stops between FLIP's first exposure and its last, which maps the median of the lit pixels to
FLIP_WHITE.  The library itself uses the median of all pixels: with a black background that grows to
22 stops, and shows only the rounding of black."""

FLIP_HIGHEST = 1e4
"""Clipping level, times white: above it a pixel is saturated in all exposures, and float32 must not
overflow."""


def image_metrics(images: Images) -> Metrics:
    """Measure how far the candidate is from the reference.

    SSIM and PSNR are taken on the sRGB-encoded pictures, both exposed by `white_level(reference)`
    and clipped to [0, 1], FLIP on several exposures (`flip_map`); the others on linear radiance.
    If any pixel of either picture is not finite, the pixel is counted and every other number is
    NaN, so that no threshold is passed.

    SSIM uses a 7 px window, or the largest odd one that fits into a smaller picture; below 3 px
    it is undefined and NaN. PSNR of equal pictures is infinite, and so is relMSE or the bias of
    a channel where the reference is black and the candidate is not. Raises ValueError for pictures
    that are not (height, width, 3), are empty, or differ in shape.
    """
    a, b = _checked(images)
    nonfinite = count_nonfinite(a, b)
    if nonfinite:
        nan = math.nan
        return Metrics(nan, nan, nan, nan, nan, (nan, nan, nan), nonfinite)

    errors = local_errors(Images(a, b))
    return Metrics(
        ssim=1.0 - float(errors.dissimilarity.mean()),
        flip=float(errors.flip.mean()),
        psnr=decibels(float(errors.encoded2.mean())),
        rmse=math.sqrt(errors.squared.mean()),
        relmse=float(errors.relative2.mean()),
        mean_bias=_mean_bias(a, b),
        nonfinite=0,
    )


class LocalErrors(NamedTuple):
    """The metrics pixel by pixel, (height, width); each metric comes from the mean of its map.

    dissimilarity: 1 - SSIM, without the margin in which windows leave the picture;  flip: FLIP;
    encoded2: the squared difference of the encoded pictures;  squared: that of radiance;
    relative2: that relative to the reference;  the last three are means over the channels.
    """

    dissimilarity: FloatArray
    flip: FloatArray
    encoded2: FloatArray
    squared: FloatArray
    relative2: FloatArray


def local_errors(images: Images, measure: FloatArray | None = None) -> LocalErrors:
    """The metrics' maps, of finite pictures of one shape.

    measure: the picture that sets exposures and the mean that errors are relative to; None for the
    reference.
    """
    a, b = images.candidate, images.reference
    measure = b if measure is None else measure
    white = white_level(measure)
    encoded_a, encoded_b = encode(a, white), encode(b, white)
    return LocalErrors(
        _dissimilarity(encoded_a, encoded_b),
        _flip(a, b, white, flip_exposures(measure / white)),
        ((encoded_a - encoded_b) ** 2).mean(axis=-1),
        ((a - b) ** 2).mean(axis=-1),
        relative_squares(images, measure),
    )


def relative_squares(images: Images, measure: FloatArray) -> FloatArray:
    """(height, width): `LocalErrors.relative2`."""
    weight = images.reference**2 + RELMSE_EPSILON * measure.mean() ** 2
    relative = ratio((images.candidate - images.reference) ** 2, weight)
    return np.asarray(relative.mean(axis=-1))


def flip_map(images: Images) -> FloatArray:
    """HDR-FLIP's error (height, width), 0 to 1: the largest over exposures of how different the
    pictures look (Andersson et al. 2020, 2021).

    The exposures are fixed by the reference alone, so that a bad candidate cannot choose them.
    NaN where a pixel of either picture is not finite; for its neighbours the pixel counts as black,
    as FLIP itself does not handle it.
    """
    a, b = _checked(images)
    bad = nonfinite_pixels(a, b)
    a, b = (np.where(bad[..., None], 0.0, image) for image in (a, b))
    white = white_level(b)
    found = _flip(a, b, white, flip_exposures(b / white))
    return np.where(bad, np.nan, found)


def flip_exposures(reference: FloatArray) -> tuple[float, float]:
    """FLIP's first and last exposure in stops, for a reference divided by `white_level`."""
    # FLIP's tone curve is Narkowicz's (2015) fit to ACES, of 0.6 times the radiance:
    # v = (2.51 x² + 0.03 x) / (2.43 x² + 0.59 x + 0.14), solved for x.
    a, b, c = 2.51 - 2.43 * FLIP_WHITE, 0.03 - 0.59 * FLIP_WHITE, -0.14 * FLIP_WHITE
    first = math.log2((-b + math.sqrt(b * b - 4.0 * a * c)) / (2.0 * a) / 0.6)
    luminance = reference @ LUMINANCE
    lit = luminance[luminance > 0.0]
    median = float(np.median(lit)) if lit.size else 1.0
    return first, first + min(max(-math.log2(median), 0.0), FLIP_STOPS)


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Luminance weights of linear sRGB (IEC 61966-2-1)."""


def _checked(images: Images) -> tuple[FloatArray, FloatArray]:
    a = np.asarray(images.candidate, dtype=np.float64)
    b = np.asarray(images.reference, dtype=np.float64)
    for name, image in (("candidate", a), ("reference", b)):
        if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
            raise ValueError(f"{name}: expected (height, width, 3) pixels, got shape {image.shape}")
    if a.shape != b.shape:
        raise ValueError(f"the pictures differ in shape: candidate {a.shape}, reference {b.shape}")
    return a, b


def _flip(a: FloatArray, b: FloatArray, white: float, stops: tuple[float, float]) -> FloatArray:
    first, last = stops
    # FLIP needs radiance >= 0; clipping comes before the division, which cannot overflow then.
    a, b = (np.clip(image, 0.0, FLIP_HIGHEST * white) / white for image in (a, b))
    settings = {
        "ppd": FLIP_DEGREE,
        "startExposure": first,
        "stopExposure": last,
        "numExposures": max(2, math.ceil(last - first)),
    }
    shown, _, _ = _flip_evaluator().evaluate(
        b.astype(np.float32),
        a.astype(np.float32),
        "HDR",
        applyMagma=False,
        computeMeanError=False,
        parameters=settings,
    )
    return np.asarray(shown, dtype=np.float64)[..., 0]


def nonfinite_pixels(*images: FloatArray) -> npt.NDArray[np.bool_]:
    """(..., 3) pictures of one shape -> (...), true where any has a NaN or an infinity."""
    bad = [~np.isfinite(image).all(axis=-1) for image in images]
    return np.asarray(np.logical_or.reduce(bad), dtype=np.bool_)


def count_nonfinite(*images: FloatArray) -> int:
    """The number of `nonfinite_pixels`."""
    return int(np.count_nonzero(nonfinite_pixels(*images)))


def white_level(reference: FloatArray) -> float:
    """The radiance that is shown as white: the 99th percentile of the reference's positive values.

    Black is left out so that the exposure does not depend on how much of the frame is empty.
    A black reference gives 1. Values that are not finite are ignored.
    """
    lit = reference[np.isfinite(reference) & (reference > 0.0)]
    return float(np.percentile(lit, WHITE_PERCENTILE)) if lit.size else 1.0


def encode(image: FloatArray, white: float) -> FloatArray:
    """Linear radiance to sRGB in [0, 1] (IEC 61966-2-1), with `white` mapped to 1 and clipped."""
    # Clipping before the division: a picture far brighter than `white` cannot overflow.
    return srgb(np.clip(image, 0.0, white) / white)


@functools.cache
def _flip_evaluator() -> Any:
    """The FLIP library, with OpenMP threads that sleep while they wait: with spinning threads a
    small picture takes seconds instead of hundredths of a second on a busy machine."""
    before = os.environ.get("OMP_WAIT_POLICY")
    os.environ["OMP_WAIT_POLICY"] = "passive"  # read when the library is loaded
    try:
        import flip_evaluator
    finally:
        if before is None:
            del os.environ["OMP_WAIT_POLICY"]
        else:
            os.environ["OMP_WAIT_POLICY"] = before
    return flip_evaluator


def _dissimilarity(a: FloatArray, b: FloatArray) -> FloatArray:
    side = min(SSIM_WINDOW, *a.shape[:2])
    window = side if side % 2 else side - 1
    if window < 3:
        return np.full(a.shape[:2], np.nan)
    # scikit-image has no type stubs.
    found: Any = structural_similarity(
        a, b, win_size=window, channel_axis=-1, data_range=1.0, full=True
    )
    margin = window // 2
    inside = found[1][margin : a.shape[0] - margin, margin : a.shape[1] - margin]
    return np.asarray(1.0 - inside.mean(axis=-1))


def decibels(mse: float) -> float:
    """PSNR of pictures in [0, 1] from their mean squared difference."""
    return -10.0 * math.log10(mse) if mse > 0.0 else math.inf


def _mean_bias(a: FloatArray, b: FloatArray) -> tuple[float, float, float]:
    mean = b.mean(axis=(0, 1))
    red, green, blue = ratio(a.mean(axis=(0, 1)) - mean, mean)
    return float(red), float(green), float(blue)


def ratio(x: FloatArray, y: FloatArray) -> FloatArray:
    """x / y, with 0 / 0 = 0 (no error) and x / 0 = ±inf."""
    # Divides by one where y is zero, which avoids NumPy's warning.
    quotient = x / np.where(y == 0.0, 1.0, y)
    of_nothing = np.where(x == 0.0, 0.0, np.copysign(np.inf, x))
    return np.asarray(np.where(y == 0.0, of_nothing, quotient))


# The null distribution of image metrics: their values if two pictures differ only by noise.
#
# It is resampled from the replicates: a random half of each side's against the other half.  Their
# difference d* has mean zero whatever the sides' means are, and has the tails of the noise and the
# correlation of neighbouring pixels.  The sides' noise may have different strength: d* is added to
# a weighted mean of both pictures, split in proportion to their variances in the tile.  For
# Gaussian noise these pairs are distributed as the given pair would be without bias.


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
by more than light does that few replicates met (`unmet.share_unmet`): with more, contrasts of the
replicates are smaller than the noise. Measured with 8 and 16 replicates: at most 0.11 % in the
scenes of the suite, 1.5 to 46 % with small lamps that are found only by scattered rays."""


def can_draw(replicates: tuple[FloatArray, FloatArray]) -> bool:
    """Whether there are enough replicates, little enough noise, and little enough rare light, for
    resampling."""
    if any(len(x) < FEWEST and not is_known(x) for x in replicates):
        return False
    if _has_rare_light(replicates):
        return False
    noise = _tile_sums(np.asarray(sum(x.var(axis=0, ddof=1) / len(x) for x in replicates)))
    seen = _tile_sums(np.asarray(sum(x.mean(axis=0) for x in replicates)) ** 2) / 4.0
    lit = seen > 0.0
    return bool(lit.any() and np.median(noise[lit] / seen[lit]) <= MOST_NOISE**2)


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
    variance = np.asarray(sum(x.var(axis=0, ddof=1) / len(x) for x in replicates))
    darker = np.minimum(images.candidate, images.reference)
    relative = relative_squares(Images(darker + np.sqrt(variance), darker), middle)
    # The other maps are bounded: no pixel has more than its share of them.
    for k, noise in ((-2, variance.mean(axis=-1)), (-1, relative)):
        if noise.sum() ** 2 < FEWEST_PIXELS * (noise**2).sum():
            highest[k] = math.inf
    return found, expected, highest


def _share(replicates: tuple[FloatArray, FloatArray]) -> FloatArray:
    """(height, width, 1): the candidate's share of the variance of each pixel's tile.  By tiles,
    since one firefly has more variance than all the rest of a picture."""
    ours, both = (
        _tile_sums(np.asarray(sum(x.var(axis=0, ddof=1) / len(x) for x in sides)))
        for sides in (replicates[:1], replicates)
    )
    share = np.divide(ours, both, out=np.full_like(both, 0.5), where=both > 0.0)
    height, width = replicates[0].shape[1:3]
    share = share.reshape(math.ceil(height / TILE), -1)
    return share.repeat(TILE, axis=0).repeat(TILE, axis=1)[:height, :width, None]


def _contrast(rng: np.random.Generator, pictures: FloatArray) -> FloatArray:
    """(replicates, height, width, 3) -> (height, width, 3): a draw of the noise of their mean."""
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
    dof = max(1.0, total**2 / float((variance**2).sum()))
    quantile = float(stats.t.isf(LEVEL, dof))
    return quantile * math.sqrt(total * (1.0 + 1.0 / len(maps)))


def noise_ratio(candidate: FloatArray, reference: FloatArray) -> tuple[float, float]:
    """The squared difference of the mean pictures over its expectation from the replicates'
    variances, averaged over tiles (1 if only noise differs), and its standard error.

    (replicates, height, width, 3) on both sides.  Tiles have equal weight: the edge of a lamp has
    most of a picture's variance, and would hide the rest.  0, 0 without noise and difference.
    """
    sides = (candidate, reference)
    difference2 = (candidate.mean(axis=0) - reference.mean(axis=0)) ** 2
    variance = sum(x.var(axis=0, ddof=1) / len(x) for x in sides)
    if _has_rare_light(sides):
        variance = variance + unmet_variance(*(side_of(x) for x in sides))
    observed, noise = _tile_sums(difference2), _tile_sums(np.asarray(variance))
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
