"""Image metrics of our picture against Mitsuba's: what a reader expects, and never the only gate.

A picture 20 % too bright still has an SSIM of 0.995, so these numbers describe a difference; the
rungs before them decide about it.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from skimage.metrics import structural_similarity

from comparisons.results import FloatArray, Metrics
from reference_rt.image import srgb

WHITE_PERCENTILE = 99.0
"""The brightest percent of the lit values (lamps, highlights) may clip; the rest is resolved."""

SSIM_WINDOW = 7
"""Pixels; the side of the uniform window of Wang et al. 2004 as scikit-image does it."""

RELMSE_EPSILON = 0.01
"""The field's customary guard against dark pixels (Rousselle et al. 2011, "Adaptive sampling and
reconstruction using greedy error minimization"), which presumes a picture of mean about 1; it is
multiplied by the squared mean of the reference, so that exposure does not change the result."""


def image_metrics(ours: npt.ArrayLike, mitsuba: npt.ArrayLike) -> Metrics:
    """Compare two pictures of linear radiance, (height, width, 3), Mitsuba's being the reference.

    SSIM and PSNR are taken on the sRGB-encoded pictures, both exposed by `white_level(mitsuba)`
    and clipped to [0, 1]; the others on linear radiance. If any pixel of either picture is not
    finite, the pixel is counted and every other number is NaN, so that no threshold is passed.

    SSIM uses a 7 px window, or the largest odd one that fits into a smaller picture; below 3 px
    it is undefined and NaN. PSNR of equal pictures is infinite, and so is relMSE or the bias of
    a channel where the reference is black and ours is not. Raises ValueError for pictures that
    are not (height, width, 3), are empty, or differ in shape.
    """
    a = np.asarray(ours, dtype=np.float64)
    b = np.asarray(mitsuba, dtype=np.float64)
    for name, image in (("ours", a), ("mitsuba", b)):
        if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
            raise ValueError(f"{name}: expected (height, width, 3) pixels, got shape {image.shape}")
    if a.shape != b.shape:
        raise ValueError(f"the pictures differ in shape: ours {a.shape}, mitsuba {b.shape}")

    nonfinite = count_nonfinite(a, b)
    if nonfinite:
        nan = math.nan
        return Metrics(nan, nan, nan, nan, (nan, nan, nan), nonfinite)

    white = white_level(b)
    encoded_a, encoded_b = encode(a, white), encode(b, white)
    squared_error = (a - b) ** 2
    weight = b**2 + RELMSE_EPSILON * b.mean() ** 2
    return Metrics(
        ssim=_ssim(encoded_a, encoded_b),
        psnr=_psnr(encoded_a, encoded_b),
        rmse=math.sqrt(squared_error.mean()),
        relmse=float(ratio(squared_error, weight).mean()),
        mean_bias=_mean_bias(a, b),
        nonfinite=0,
    )


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
    A reference without any light gives 1. Values that are not finite are passed over.
    """
    lit = reference[np.isfinite(reference) & (reference > 0.0)]
    return float(np.percentile(lit, WHITE_PERCENTILE)) if lit.size else 1.0


def encode(image: FloatArray, white: float) -> FloatArray:
    """Linear radiance to sRGB in [0, 1] (IEC 61966-2-1), with `white` mapped to 1 and clipped."""
    # Clipping before the division: a picture far brighter than `white` cannot overflow.
    return srgb(np.clip(image, 0.0, white) / white)


def _ssim(a: FloatArray, b: FloatArray) -> float:
    side = min(SSIM_WINDOW, *a.shape[:2])
    window = side if side % 2 else side - 1
    if window < 3:
        return math.nan
    # scikit-image has no type stubs.
    similarity: Any = structural_similarity(a, b, win_size=window, channel_axis=-1, data_range=1.0)
    return float(similarity)


def _psnr(a: FloatArray, b: FloatArray) -> float:
    mse = float(((a - b) ** 2).mean())
    return -10.0 * math.log10(mse) if mse > 0.0 else math.inf


def _mean_bias(a: FloatArray, b: FloatArray) -> tuple[float, float, float]:
    mean = b.mean(axis=(0, 1))
    red, green, blue = ratio(a.mean(axis=(0, 1)) - mean, mean)
    return float(red), float(green), float(blue)


def ratio(x: FloatArray, y: FloatArray) -> FloatArray:
    """x / y, where nothing of nothing is no error (0) and something of nothing is infinite."""
    # Divides by one where y is zero, so that no warning has to be silenced.
    quotient = x / np.where(y == 0.0, 1.0, y)
    of_nothing = np.where(x == 0.0, 0.0, np.copysign(np.inf, x))
    return np.asarray(np.where(y == 0.0, of_nothing, quotient))
