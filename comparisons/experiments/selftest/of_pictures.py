"""Faults of pictures: errors after rendering, or in the camera or the film."""

import numpy as np
from scipy import ndimage

from comparisons.experiments.selftest.fault import PictureFault
from comparisons.results.case import FloatArray
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear

SCENE = "colour_bleeding"
"""A scene without a background; only the pixels of its lamp have no noise."""


def gain(factor: float, channel: int | None = None) -> PictureFault:
    """All channels, or one, multiplied by a factor."""

    def change(pictures: FloatArray) -> FloatArray:
        factors = np.full(3, factor) if channel is None else np.ones(3)
        if channel is not None:
            factors[channel] = factor
        return pictures * factors

    which = "" if channel is None else f" of {'RGB'[channel]}"
    return PictureFault(f"gain{which} {100.0 * (factor - 1.0):+.3g} %", SCENE, change)


def shifted(x: float, y: float) -> PictureFault:
    """Shifted by pixels, with bilinear interpolation and repeated edges."""

    def change(pictures: FloatArray) -> FloatArray:
        return np.asarray(ndimage.shift(pictures, (0, y, x, 0), order=1, mode="nearest"))

    return PictureFault(f"shift by {x:g}, {y:g} px", SCENE, change)


def blurred(sigma: float) -> PictureFault:
    """A reconstruction filter that is too wide."""

    def change(pictures: FloatArray) -> FloatArray:
        return np.asarray(ndimage.gaussian_filter(pictures, (0, sigma, sigma, 0), mode="nearest"))

    return PictureFault(f"blur of {sigma:g} px", SCENE, change)


def _tile(pictures: FloatArray) -> FloatArray:
    """A tile of 8 x 8 pixels of which one in sixteen is 50 times too bright: fireflies."""
    pictures = pictures.copy()
    height, width = pictures.shape[1:3]
    pictures[:, height // 2 : height // 2 + 8 : 4, width // 4 : width // 4 + 8 : 4] *= 50.0
    return pictures


def _nan(pictures: FloatArray) -> FloatArray:
    pictures = pictures.copy()
    pictures[0, -3, 5, 1] = np.nan
    return pictures


def _infinity(pictures: FloatArray) -> FloatArray:
    pictures = pictures.copy()
    pictures[-1, 7, 9, 0] = np.inf
    return pictures


def _row(pictures: FloatArray) -> FloatArray:
    pictures = pictures.copy()
    pictures[:, pictures.shape[1] // 3] = 0.0
    return pictures


def _dead_pixel(pictures: FloatArray) -> FloatArray:
    pictures = pictures.copy()
    pictures[:, pictures.shape[1] // 3, pictures.shape[2] // 3] = 0.0
    return pictures


def _shared_noise(pictures: FloatArray) -> FloatArray:
    """Overlapping seeds: every replicate is the mean of itself and the first."""
    return 0.5 * pictures + 0.5 * pictures[:1]


def dark_tile(fraction: float) -> PictureFault:
    """A tile of 16 x 16 pixels that is too dark."""

    def change(pictures: FloatArray) -> FloatArray:
        pictures = pictures.copy()
        height, width = pictures.shape[1:3]
        pictures[:, height // 2 : height // 2 + 16, width // 2 : width // 2 + 16] *= 1.0 - fraction
        return pictures

    return PictureFault(f"one tile {100.0 * fraction:g} % dark", SCENE, change)


def black_level(radiance: float) -> PictureFault:
    """A constant radiance added to every pixel."""
    name = f"black level {radiance:+g} W/sr/m²"
    return PictureFault(name, SCENE, lambda pictures: pictures + radiance)


def _vignette(pictures: FloatArray) -> FloatArray:
    """Corners 3 % dark."""
    height, width = pictures.shape[1:3]
    y, x = np.mgrid[0:height, 0:width]
    r2 = (2.0 * (x + 0.5) / width - 1.0) ** 2 + (2.0 * (y + 0.5) / height - 1.0) ** 2
    return np.asarray(pictures * (1.0 - 0.015 * r2[..., None]))


def _tiles_exchanged(pictures: FloatArray) -> FloatArray:
    """Two neighbouring tiles of 16 x 16 pixels in each other's place."""
    pictures = pictures.copy()
    y, x = pictures.shape[1] // 4, pictures.shape[2] // 4
    first, second = (pictures[:, y : y + 16, k : k + 16].copy() for k in (x, x + 16))
    pictures[:, y : y + 16, x : x + 16], pictures[:, y : y + 16, x + 16 : x + 32] = second, first
    return pictures


def _tile_weight(pictures: FloatArray) -> FloatArray:
    """A tile that is divided by one sample too few, of 16."""
    pictures = pictures.copy()
    y, x = pictures.shape[1] // 3, pictures.shape[2] // 2
    pictures[:, y : y + 16, x : x + 16] *= 16.0 / 15.0
    return pictures


FAULTS = (
    gain(1.005),
    gain(1.01),
    gain(1.02),
    gain(1.01, 0),
    gain(1.01, 2),
    PictureFault("gamma 1/1.05", SCENE, lambda pictures: np.maximum(pictures, 0.0) ** (1 / 1.05)),
    PictureFault("sRGB values taken for linear ones", SCENE, srgb),
    shifted(0.5, 0.0),
    shifted(0.0, 0.5),
    shifted(1.0, 0.0),
    PictureFault("mirrored left to right", SCENE, lambda pictures: pictures[:, :, ::-1]),
    PictureFault("upside down", SCENE, lambda pictures: pictures[:, ::-1]),
    PictureFault("red and blue swapped", SCENE, lambda pictures: pictures[..., ::-1]),
    PictureFault("one tile of fireflies", SCENE, _tile),
    dark_tile(0.1),
    PictureFault("corners 3 % dark", SCENE, _vignette),
    PictureFault("two tiles exchanged", SCENE, _tiles_exchanged),
    PictureFault("one tile divided by 15 for 16", SCENE, _tile_weight),
    PictureFault("every second row twice", SCENE, lambda p: np.repeat(p[:, ::2], 2, axis=1)),
    PictureFault("one NaN", SCENE, _nan),
    PictureFault("one infinity", SCENE, _infinity),
    PictureFault("one black row", SCENE, _row),
    PictureFault("one dead pixel", SCENE, _dead_pixel),
    PictureFault("highlights clamped to 1", SCENE, lambda pictures: np.minimum(pictures, 1.0)),
    PictureFault(
        "8-bit sRGB", SCENE, lambda p: linear(np.round(255.0 * np.clip(srgb(p), 0, 1)) / 255.0)
    ),
    black_level(0.002),
    blurred(0.5),
    PictureFault("replicates share noise", SCENE, _shared_noise),
    PictureFault("all replicates the same", SCENE, lambda p: np.repeat(p[:1], len(p), axis=0)),
    PictureFault("black", SCENE, np.zeros_like),
)
