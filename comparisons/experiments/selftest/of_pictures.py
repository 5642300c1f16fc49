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


def _sampled(pictures: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Pictures at the pixel positions x, y, with bilinear interpolation and repeated edges."""
    out = np.empty_like(pictures)
    for k, picture in enumerate(pictures):
        for c in range(3):
            out[k, ..., c] = ndimage.map_coordinates(
                picture[..., c], [y, x], order=1, mode="nearest"
            )
    return out


def radial(name: str, strength: float, zoom: float = 1.0) -> PictureFault:
    """A lens that moves pixels along the radius: barrel distortion, or a zoom."""

    def change(pictures: FloatArray) -> FloatArray:
        height, width = pictures.shape[1:3]
        y, x = np.mgrid[0:height, 0:width]
        dx, dy = x - (width - 1) / 2, y - (height - 1) / 2
        factor = zoom * (1.0 + strength * (dx * dx + dy * dy) / (0.25 * width * width))
        return _sampled(pictures, dx * factor + (width - 1) / 2, dy * factor + (height - 1) / 2)

    return PictureFault(name, SCENE, change)


def _fringes(pictures: FloatArray) -> FloatArray:
    """Chromatic aberration: red 0.4 % larger, blue 0.4 % smaller."""
    larger, smaller = (radial("", 0.0, zoom).change(pictures) for zoom in (1 / 1.004, 1.004))
    return np.stack([larger[..., 0], pictures[..., 1], smaller[..., 2]], axis=-1)


def colours(name: str, *rows: tuple[float, float, float]) -> PictureFault:
    """Colours by a matrix."""
    matrix = np.array(rows)
    return PictureFault(name, SCENE, lambda pictures: pictures @ matrix.T)


GREY = (0.2126, 0.7152, 0.0722)
"""The luminance of linear sRGB (BT.709)."""


def _less_saturated(pictures: FloatArray) -> FloatArray:
    return np.asarray(0.9 * pictures + 0.1 * (pictures @ np.array(GREY))[..., None])


def _filmic(pictures: FloatArray) -> FloatArray:
    """Hable's curve (2010), white at 11.2."""

    def curve(x: FloatArray) -> FloatArray:
        return (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3

    return np.asarray(curve(2.0 * np.maximum(pictures, 0.0)) / curve(np.array(11.2)))


def _history(pictures: FloatArray) -> FloatArray:
    """Temporal accumulation: each picture is 0.9 of the one before and 0.1 new."""
    pictures = pictures.copy()
    for k in range(1, len(pictures)):
        pictures[k] = 0.9 * pictures[k - 1] + 0.1 * pictures[k]
    return pictures


def _prefixes(pictures: FloatArray) -> FloatArray:
    """The states of one accumulation."""
    count = np.arange(1, len(pictures) + 1)[:, None, None, None]
    return np.asarray(np.cumsum(pictures, axis=0) / count)


def _copies(pictures: FloatArray) -> FloatArray:
    """The second picture is 0.95 of the first."""
    pictures = pictures.copy()
    pictures[1] = 0.95 * pictures[0] + 0.05 * pictures[1]
    return pictures


def _column(pictures: FloatArray) -> FloatArray:
    pictures = pictures.copy()
    pictures[:, :, pictures.shape[2] // 3] *= 0.98
    return pictures


def mean_kept_vignette(fraction: float) -> PictureFault:
    """Corners darker by a fraction and the middle brighter, so that the mean stays."""

    def change(pictures: FloatArray) -> FloatArray:
        height, width = pictures.shape[1:3]
        y, x = np.mgrid[0:height, 0:width]
        r2 = (2.0 * (x + 0.5) / width - 1.0) ** 2 + (2.0 * (y + 0.5) / height - 1.0) ** 2
        changed = pictures * (1.0 - 0.5 * fraction * r2[..., None])
        return np.asarray(changed * (pictures.mean() / changed.mean()))

    return PictureFault(f"corners {100.0 * fraction:g} % dark, mean kept", SCENE, change)


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
    PictureFault("green, blue and red for red, green and blue", SCENE, lambda p: p[..., [1, 2, 0]]),
    PictureFault("grey", SCENE, lambda p: np.repeat((p @ np.array(GREY))[..., None], 3, axis=-1)),
    PictureFault("tinted", SCENE, lambda pictures: pictures * (1.02, 1.0, 0.98)),
    PictureFault("saturation 0.9", SCENE, _less_saturated),
    colours(
        "primaries of Rec. 2020", (0.6274, 0.3293, 0.0433), (0.0691, 0.9195, 0.0114),
        (0.0164, 0.0880, 0.8956),
    ),
    colours(
        "primaries of Display P3", (0.8225, 0.1774, 0.0), (0.0332, 0.9669, 0.0),
        (0.0171, 0.0724, 0.9108),
    ),
    colours(
        "XYZ for RGB", (0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505)
    ),
    colours(
        "ACEScg for sRGB", (0.6131, 0.3395, 0.0474), (0.0702, 0.9164, 0.0134),
        (0.0206, 0.1096, 0.8698),
    ),
    radial("barrel distortion of 0.003", 0.003),
    radial("barrel distortion of 0.01", 0.01),
    radial("zoom of 1 %", 0.0, 1.01),
    PictureFault("chromatic aberration of 0.4 %", SCENE, _fringes),
    PictureFault("Reinhard's tone curve", SCENE, lambda pictures: pictures / (1.0 + pictures)),
    PictureFault("a filmic tone curve", SCENE, _filmic),
    PictureFault("sRGB decoded by 2.2", SCENE, lambda p: srgb(np.maximum(p, 0.0)) ** 2.2),
    PictureFault("sRGB decoded by 2", SCENE, lambda p: srgb(np.maximum(p, 0.0)) ** 2.0),
    PictureFault("a ghost of 0.5 %", SCENE, lambda p: p + 0.005 * p[:, ::-1, ::-1]),
    PictureFault("a history of nine tenths", SCENE, _history),
    PictureFault("states of one accumulation", SCENE, _prefixes),
    PictureFault("one picture nearly another's copy", SCENE, _copies),
    PictureFault("one column 2 % dark", SCENE, _column),
    mean_kept_vignette(0.02),
    mean_kept_vignette(0.008),
)  # fmt: skip
