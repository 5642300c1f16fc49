"""Causes that are planted in a picture: what is done to it, and how the diagnosis should name it.

A cause is what happens to positions, to colours, or to both, positions first.
"""

import re
from collections.abc import Callable

import numpy as np
from scipy import ndimage

from comparisons.results.case import FloatArray

Change = Callable[[FloatArray], FloatArray]


def seen(
    y: Callable[..., FloatArray], x: Callable[..., FloatArray], order: int = 1, channel: int = -1
) -> Change:
    """A picture whose pixels show other points;  y, x: these, in units of the distance between the
    middle and the border, of where the pixel is, and of a pixel's size."""

    def change(p: FloatArray) -> FloatArray:
        height, width = p.shape[:2]
        rows, columns = np.mgrid[:height, :width].astype(float)
        v, u = (rows + 0.5) / height * 2.0 - 1.0, (columns + 0.5) / width * 2.0 - 1.0
        at = [
            (y(v, u, 2.0 / height) + 1.0) * height / 2.0 - 0.5,
            (x(v, u, 2.0 / width) + 1.0) * width / 2.0 - 0.5,
        ]
        found = p.copy()
        for k in range(3) if channel < 0 else [channel]:
            found[..., k] = ndimage.map_coordinates(p[..., k], at, order=order, mode="nearest")
        return found

    return change


def _scaled(across: float, up: float, order: int = 3) -> Change:
    return seen(lambda v, u, _: v / up, lambda v, u, _: u / across, order)


def _moved(right: float, down: float, order: int = 1, channel: int = -1) -> Change:
    return seen(
        lambda v, u, pixel: v - down * pixel, lambda v, u, pixel: u - right * pixel, order, channel
    )


def _barrel(amount: float) -> Change:
    def change(p: FloatArray) -> FloatArray:
        height, width = p.shape[:2]
        far = (height - 1) ** 2 + (width - 1) ** 2

        def bent(v: FloatArray, u: FloatArray) -> FloatArray:
            return 1.0 + amount * ((v * height) ** 2 + (u * width) ** 2) / far

        return seen(lambda v, u, _: v * bent(v, u), lambda v, u, _: u * bent(v, u), 3)(p)

    return change


def _halved(p: FloatArray) -> FloatArray:
    small = p.reshape(p.shape[0] // 2, 2, p.shape[1] // 2, 2, 3).mean(axis=(1, 3))
    return small.repeat(2, axis=0).repeat(2, axis=1)


def _blurred(p: FloatArray) -> FloatArray:
    return ndimage.gaussian_filter(p, (1.0, 1.0, 0.0), mode="nearest")


GEOMETRY: dict[str, Change] = {
    "mirrored left to right": lambda p: p[:, ::-1],
    "upside down": lambda p: p[::-1],
    "rotated by 180 degrees": lambda p: p[::-1, ::-1],
    "half-pixel shift in x and y": _moved(-0.5, -0.5),
    "half-pixel shift in x": _moved(0.5, 0.0),
    "shift by 0.25 pixels": _moved(0.25, 0.0),
    "shift by one pixel in y": _moved(0.0, 1.0),
    "shift by 2 pixels": _moved(-1.2, 1.6, 3),
    "shift by +1, +0 pixels that wraps around": lambda p: np.roll(p, 1, axis=1),
    "shift by -3, +11 pixels that wraps around": lambda p: np.roll(p, (11, -3), axis=(0, 1)),
    "shift of red by 0.3 pixels": _moved(-0.3, 0.0, 1, 0),
    "shift of blue by 0.7 pixels": _moved(0.5, 0.5, 3, 2),
    "zoom of 1.01": _scaled(1.01, 1.01),
    "zoom of 0.95": _scaled(0.95, 0.95),
    "zoom of 1.333": _scaled(4 / 3, 4 / 3),
    "zoom of 0.75": _scaled(0.75, 0.75),
    "zoom in x alone, of 1.03": _scaled(1.03, 1.0),
    "zoom in y alone, of 0.97": _scaled(1.0, 0.97),
    "barrel distortion of 0.02": _barrel(0.02),
    "pincushion distortion of 0.02": _barrel(-0.02),
    "half the size, enlarged": _halved,
    "blurred by 1 pixels": _blurred,
}


def srgb(p: FloatArray) -> FloatArray:
    """IEC 61966-2-1."""
    p = np.maximum(p, 0.0)
    return np.where(p <= 0.0031308, 12.92 * p, 1.055 * p ** (1.0 / 2.4) - 0.055)


def power(exponent: float) -> Change:
    return lambda p: np.maximum(p, 0.0) ** exponent


def matrix(rows: object) -> Change:
    return lambda p: p @ np.asarray(rows).T


TO_XYZ = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
TO_2020 = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]


def vignette(p: FloatArray) -> FloatArray:
    """The fourth power of the cosine, by which corners of a square have 69 % of the light."""
    y, x = ((np.arange(n) + 0.5 - n / 2.0) / (max(p.shape[:2]) / 2.0) for n in p.shape[:2])
    return p * ((1.0 + 0.1 * (y[:, None] ** 2 + x**2)) ** -2)[..., None]


def _with_maximum(p: FloatArray) -> FloatArray:
    return np.minimum(p, 0.4 * p.max())


COLOURS: dict[str, Change] = {
    "constant gain of 1.017": lambda p: 1.017 * p,
    "constant gain of 1.414": lambda p: 2.0**0.5 * p,
    "constant gain of 0.3183": lambda p: p / np.pi,
    "gain of green of 0.97": lambda p: p * [1.0, 0.97, 1.0],
    "another gain of each channel": lambda p: p * [1.05, 1.0, 0.93],
    "constant offset of +0.05": lambda p: p + 0.05,
    "sRGB-encoded values taken for linear ones": srgb,
    "gamma of 0.4545": power(1.0 / 2.2),
    "gamma of 2.2": power(2.2),
    "gamma of 0.95": power(0.95),
    "Reinhard's tone curve": lambda p: p / (1.0 + p),
    "tone curve: the power of 1.1": lambda p: 0.8 * np.maximum(p, 0.0) ** 1.1,
    "highlights clamped to 0": _with_maximum,
    "swapped channels: red and blue": lambda p: p[..., ::-1],
    "swapped channels: all channels": lambda p: p[..., [1, 2, 0]],
    "Rec. 2020 where linear sRGB is expected": matrix(TO_2020),
    "CIE XYZ where linear sRGB is expected": matrix(TO_XYZ),
    "grey: the mean of the channels in each": matrix(np.full((3, 3), 1.0 / 3.0)),
    "saturation of 0.9": matrix(0.9 * np.eye(3) + 0.1 * np.array(TO_XYZ[1])),
    "vignette": vignette,
}


def _column(p: FloatArray) -> FloatArray:
    p = p.copy()
    p[:, -1] = 0.0
    return p


def _row(p: FloatArray) -> FloatArray:
    p = p.copy()
    p[0] = 0.0
    return p


def _tile(p: FloatArray) -> FloatArray:
    p = p.copy()
    p[24:32, 24:32] = 1.5 * p.mean()
    return p


PLACES: dict[str, Change] = {
    "one bad column": _column,
    "one bad row": _row,
    "one bad tile": _tile,
}

BOTH = [
    ("half-pixel shift in x and y", "constant gain of 1.414"),
    ("half-pixel shift in x", "gamma of 0.4545"),
    ("half-pixel shift in x and y", "swapped channels: red and blue"),
    ("half-pixel shift in x", "sRGB-encoded values taken for linear ones"),
    ("half-pixel shift in x and y", "Rec. 2020 where linear sRGB is expected"),
    ("half-pixel shift in x and y", "Reinhard's tone curve"),
    ("shift by one pixel in y", "constant gain of 0.3183"),
    ("shift by +1, +0 pixels that wraps around", "constant gain of 1.414"),
    ("mirrored left to right", "sRGB-encoded values taken for linear ones"),
    ("mirrored left to right", "constant gain of 1.414"),
    ("mirrored left to right", "gamma of 0.4545"),
    ("upside down", "Reinhard's tone curve"),
    ("upside down", "swapped channels: red and blue"),
    ("rotated by 180 degrees", "sRGB-encoded values taken for linear ones"),
    ("zoom of 1.01", "constant gain of 1.414"),
    ("zoom of 0.95", "sRGB-encoded values taken for linear ones"),
    ("zoom of 1.333", "gamma of 0.4545"),
    ("zoom in x alone, of 1.03", "constant gain of 0.3183"),
    ("barrel distortion of 0.02", "constant gain of 1.414"),
    ("blurred by 1 pixels", "constant gain of 1.414"),
    ("half the size, enlarged", "sRGB-encoded values taken for linear ones"),
]
"""What happens to positions, and then to colours."""

JOINED = ", then "

PLANTED: dict[str, Change] = {
    **GEOMETRY,
    **COLOURS,
    **PLACES,
    **{
        f"{geometry}{JOINED}{colour}": (
            lambda p, at=GEOMETRY[geometry], to=COLOURS[colour]: to(at(p))
        )
        for geometry, colour in BOTH
    },
}

NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?")


def is_named(found: str, planted: str) -> bool:
    """The same words, and the same numbers up to a twentieth, and a hundredth of a pixel."""
    if planted.endswith("clamped to 0"):  # the amount depends on the picture
        found, planted = (NUMBER.sub("", text) for text in (found, planted))
    if planted == "vignette":
        return found.startswith("vignette")
    if NUMBER.sub("", found) != NUMBER.sub("", planted):
        return False
    numbers = [[float(n) for n in NUMBER.findall(text)] for text in (found, planted)]
    return np.allclose(*numbers, rtol=0.05, atol=0.01)
