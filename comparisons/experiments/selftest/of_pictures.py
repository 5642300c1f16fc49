"""Faults of pictures: errors after rendering, or in the camera or the film."""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from comparisons.experiments.selftest.fault import PictureFault
from comparisons.results.case import FloatArray
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear

SCENE = "colour_bleeding"
"""A scene without a background; only the pixels of its lamp have no noise."""

Change = Callable[[FloatArray], FloatArray | None]
"""Of a copy of pictures (replicates, height, width, 3): what it returns, or the copy itself."""

FAULTS: list[PictureFault] = []


def fault(name: str, change: Change) -> PictureFault:
    """The fault of a change."""

    def changed(pictures: FloatArray) -> FloatArray:
        pictures = pictures.copy()
        found = change(pictures)
        return pictures if found is None else np.asarray(found)

    return PictureFault(name, SCENE, changed)


def planted(name: str) -> Callable[[Change], Change]:
    """Register a function as a fault."""

    def register(change: Change) -> Change:
        FAULTS.append(fault(name, change))
        return change

    return register


# Faults of any size, of which the power curves have some.


def gain(factor: float, channel: int | None = None) -> PictureFault:
    """All channels, or one, multiplied by a factor."""
    factors = np.ones(3)
    factors[slice(None) if channel is None else channel] = factor
    which = "" if channel is None else f" of {'RGB'[channel]}"
    return fault(f"gain{which} {100.0 * (factor - 1.0):+.3g} %", lambda p: p * factors)


def black_level(radiance: float) -> PictureFault:
    """A constant radiance added to every pixel."""
    return fault(f"black level {radiance:+g} W/sr/m²", lambda p: p + radiance)


def shifted(x: float, y: float) -> PictureFault:
    """Shifted by pixels, with bilinear interpolation and repeated edges."""
    move = (0, y, x, 0)
    return fault(
        f"shift by {x:g}, {y:g} px", lambda p: ndimage.shift(p, move, order=1, mode="nearest")
    )


def blurred(sigma: float) -> PictureFault:
    """A reconstruction filter that is too wide."""
    widths = (0, sigma, sigma, 0)
    return fault(
        f"blur of {sigma:g} px", lambda p: ndimage.gaussian_filter(p, widths, mode="nearest")
    )


def dark_tile(fraction: float) -> PictureFault:
    """A tile of 16 x 16 pixels that is too dark."""

    def change(pictures: FloatArray) -> None:
        height, width = pictures.shape[1:3]
        pictures[:, height // 2 : height // 2 + 16, width // 2 : width // 2 + 16] *= 1.0 - fraction

    return fault(f"one tile {100.0 * fraction:g} % dark", change)


def _off_middle(pictures: FloatArray) -> FloatArray:
    """(height, width): squares of distances from the middle, 2 in the corners."""
    height, width = pictures.shape[1:3]
    y, x = np.mgrid[0:height, 0:width]
    return np.asarray((2.0 * (x + 0.5) / width - 1.0) ** 2 + (2.0 * (y + 0.5) / height - 1.0) ** 2)


def mean_kept_vignette(fraction: float) -> PictureFault:
    """Corners darker by a fraction and the middle brighter, so that the mean stays."""

    def change(pictures: FloatArray) -> FloatArray:
        changed = pictures * (1.0 - 0.5 * fraction * _off_middle(pictures)[..., None])
        return np.asarray(changed * (pictures.mean() / changed.mean()))

    return fault(f"corners {100.0 * fraction:g} % dark, mean kept", change)


def radial(name: str, strength: float, zoom: float = 1.0) -> PictureFault:
    """A lens that moves pixels along the radius: barrel distortion, or a zoom."""

    def change(pictures: FloatArray) -> FloatArray:
        height, width = pictures.shape[1:3]
        y, x = np.mgrid[0:height, 0:width]
        dx, dy = x - (width - 1) / 2, y - (height - 1) / 2
        factor = zoom * (1.0 + strength * (dx * dx + dy * dy) / (0.25 * width * width))
        return _sampled(pictures, dx * factor + (width - 1) / 2, dy * factor + (height - 1) / 2)

    return fault(name, change)


def _sampled(pictures: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Pictures at the pixel positions x, y, with bilinear interpolation and repeated edges."""
    out = np.empty_like(pictures)
    for k, picture in enumerate(pictures):
        for c in range(3):
            out[k, ..., c] = ndimage.map_coordinates(
                picture[..., c], [y, x], order=1, mode="nearest"
            )
    return out


def colours(name: str, *rows: tuple[float, float, float]) -> PictureFault:
    """Colours by a matrix."""
    matrix = np.array(rows)
    return fault(name, lambda p: p @ matrix.T)


GREY = (0.2126, 0.7152, 0.0722)
"""The luminance of linear sRGB (BT.709)."""

FAULTS += (
    *(gain(1.005), gain(1.01), gain(1.02), gain(1.01, 0), gain(1.01, 2)),
    *(shifted(0.5, 0.0), shifted(0.0, 0.5), shifted(1.0, 0.0)),
    *(dark_tile(0.1), black_level(0.002), blurred(0.5)),
    *(mean_kept_vignette(0.02), mean_kept_vignette(0.008)),
    radial("barrel distortion of 0.003", 0.003),
    radial("barrel distortion of 0.01", 0.01),
    radial("zoom of 1 %", 0.0, 1.01),
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
    fault("gamma 1/1.05", lambda p: np.maximum(p, 0.0) ** (1 / 1.05)),
    fault("sRGB values taken for linear ones", srgb),
    fault("sRGB decoded by 2.2", lambda p: srgb(np.maximum(p, 0.0)) ** 2.2),
    fault("sRGB decoded by 2", lambda p: srgb(np.maximum(p, 0.0)) ** 2.0),
    fault("8-bit sRGB", lambda p: linear(np.round(255.0 * np.clip(srgb(p), 0, 1)) / 255.0)),
    fault("highlights clamped to 1", lambda p: np.minimum(p, 1.0)),
    fault("Reinhard's tone curve", lambda p: p / (1.0 + p)),
    fault("red and blue swapped", lambda p: p[..., ::-1]),
    fault("green, blue and red for red, green and blue", lambda p: p[..., [1, 2, 0]]),
    fault("grey", lambda p: np.repeat((p @ np.array(GREY))[..., None], 3, axis=-1)),
    fault("tinted", lambda p: p * (1.02, 1.0, 0.98)),
    fault("saturation 0.9", lambda p: 0.9 * p + 0.1 * (p @ np.array(GREY))[..., None]),
    fault("black", np.zeros_like),
    fault("mirrored left to right", lambda p: p[:, :, ::-1]),
    fault("upside down", lambda p: p[:, ::-1]),
    fault("every second row twice", lambda p: np.repeat(p[:, ::2], 2, axis=1)),
    fault("a ghost of 0.5 %", lambda p: p + 0.005 * p[:, ::-1, ::-1]),
    fault("corners 3 % dark", lambda p: p * (1.0 - 0.015 * _off_middle(p)[..., None])),
    fault("all replicates the same", lambda p: np.repeat(p[:1], len(p), axis=0)),
)  # fmt: skip


@planted("a filmic tone curve")
def hable(pictures: FloatArray) -> FloatArray:
    """Hable's curve (2010), white at 11.2."""

    def curve(x: FloatArray) -> FloatArray:
        return (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 0.02 / 0.3

    return np.asarray(curve(2.0 * np.maximum(pictures, 0.0)) / curve(np.array(11.2)))


@planted("chromatic aberration of 0.4 %")
def fringes(pictures: FloatArray) -> FloatArray:
    """Red 0.4 % larger, blue 0.4 % smaller."""
    larger, smaller = (radial("", 0.0, zoom).change(pictures) for zoom in (1 / 1.004, 1.004))
    return np.stack([larger[..., 0], pictures[..., 1], smaller[..., 2]], axis=-1)


@planted("one tile of fireflies")
def fireflies(pictures: FloatArray) -> None:
    """Of 8 x 8 pixels, of which one in sixteen is 50 times too bright."""
    height, width = pictures.shape[1:3]
    pictures[:, height // 2 : height // 2 + 8 : 4, width // 4 : width // 4 + 8 : 4] *= 50.0


@planted("two tiles exchanged")
def tiles_exchanged(pictures: FloatArray) -> None:
    """Two neighbouring tiles of 16 x 16 pixels in each other's place."""
    y, x = pictures.shape[1] // 4, pictures.shape[2] // 4
    first, second = (pictures[:, y : y + 16, k : k + 16].copy() for k in (x, x + 16))
    pictures[:, y : y + 16, x : x + 16], pictures[:, y : y + 16, x + 16 : x + 32] = second, first


@planted("one tile divided by 15 for 16")
def tile_weight(pictures: FloatArray) -> None:
    """By one sample too few."""
    y, x = pictures.shape[1] // 3, pictures.shape[2] // 2
    pictures[:, y : y + 16, x : x + 16] *= 16.0 / 15.0


@planted("one NaN")
def nan(pictures: FloatArray) -> None:
    pictures[0, -3, 5, 1] = np.nan


@planted("one infinity")
def infinity(pictures: FloatArray) -> None:
    pictures[-1, 7, 9, 0] = np.inf


@planted("one black row")
def row(pictures: FloatArray) -> None:
    pictures[:, pictures.shape[1] // 3] = 0.0


@planted("one column 2 % dark")
def column(pictures: FloatArray) -> None:
    pictures[:, :, pictures.shape[2] // 3] *= 0.98


@planted("one dead pixel")
def dead_pixel(pictures: FloatArray) -> None:
    pictures[:, pictures.shape[1] // 3, pictures.shape[2] // 3] = 0.0


@planted("replicates share noise")
def shared_noise(pictures: FloatArray) -> FloatArray:
    """Overlapping seeds: every replicate is the mean of itself and the first."""
    return 0.5 * pictures + 0.5 * pictures[:1]


@planted("a history of nine tenths")
def history(pictures: FloatArray) -> None:
    """Temporal accumulation: each picture is 0.9 of the one before and 0.1 new."""
    for k in range(1, len(pictures)):
        pictures[k] = 0.9 * pictures[k - 1] + 0.1 * pictures[k]


@planted("states of one accumulation")
def prefixes(pictures: FloatArray) -> FloatArray:
    count = np.arange(1, len(pictures) + 1)[:, None, None, None]
    return np.asarray(np.cumsum(pictures, axis=0) / count)


@planted("one picture nearly another's copy")
def copies(pictures: FloatArray) -> None:
    """The second picture is 0.95 of the first."""
    pictures[1] = 0.95 * pictures[0] + 0.05 * pictures[1]
