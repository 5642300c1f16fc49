"""Image metrics of a candidate against its reference: SSIM, FLIP, PSNR, RMSE, relMSE, bias.

None of them alone is a test: a picture 20 % too bright still has an SSIM of 0.995.
`comparisons.rungs.images` sets the thresholds, given the noise.
"""

import functools
import importlib.util
import math
import os
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from skimage.metrics import structural_similarity

from comparisons.results.case import FloatArray, Images, Metrics
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
    it is undefined and NaN; so is FLIP without its package (`has_flip`). PSNR of equal pictures is
    infinite, and so is relMSE or the bias of a channel where the reference is black and the
    candidate is not. Raises ValueError for pictures that are not (height, width, 3), are empty, or
    differ in shape.
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
    shown = _flip(a, b, white, flip_exposures(b / white))
    return np.where(bad, np.nan, shown)


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


def has_flip() -> bool:
    """Whether FLIP can be measured here.  Its package has no wheels for some versions of Python."""
    return importlib.util.find_spec("flip_evaluator") is not None


def _flip(a: FloatArray, b: FloatArray, white: float, stops: tuple[float, float]) -> FloatArray:
    if not has_flip():
        return np.full(a.shape[:2], math.nan)
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
    similarity: Any = structural_similarity(
        a, b, win_size=window, channel_axis=-1, data_range=1.0, full=True
    )
    margin = window // 2
    inside = similarity[1][margin : a.shape[0] - margin, margin : a.shape[1] - margin]
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
