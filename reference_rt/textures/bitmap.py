"""Bitmap texture: an image over the unit square of (u, v), its top row along v = 1."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Positive
from reference_rt.core.vec3 import Vec3, luminance, row
from reference_rt.jit.kernel import kernel
from reference_rt.textures.image_file import MOST_BYTES_PER_PIXEL, pixels_of, read_image
from reference_rt.textures.texture import Texture
from reference_rt.util.memory import check_memory

_FILTERS = ("bilinear", "nearest")
_WRAPS = ("repeat", "clamp", "mirror")
_NEAREST = 1
_CLAMP, _MIRROR = 1, 2


class Bitmap(Texture):
    """An image: (u, v) = (0, 0) is its lower left corner, (1, 1) its upper right one."""

    type: Literal["bitmap"] = "bitmap"
    file: str
    """The image, relative to the scene file: .exr, .hdr, .pfm, .npy, .png, .jpg and other formats
    that Pillow reads."""
    filter: Literal["bilinear", "nearest"] = "bilinear"
    """The colour between texel centres: interpolated, or that of the nearest texel."""
    wrap: Literal["repeat", "clamp", "mirror"] = "repeat"
    """The colour outside of [0, 1]: the image repeated, its rim, or the image mirrored."""
    encoding: Literal["auto", "srgb", "raw"] = "auto"
    """`srgb`: values are decoded to linear ones.  `raw`: values are used as they are.  `auto`:
    `srgb` for files of integers, `raw` for files of floats."""
    scale: Positive = 1.0
    """A factor of the linear values: radiance and heights may need values above 1."""

    def tabulate(self, folder: Path, out: FloatArray | None = None) -> "Bitmaps":
        """One row of the table.  out (n, 3): if it is large enough, texels are written to its
        beginning.  Raises ValueError (what is wrong, what was expected)."""
        texels = read_image(folder / self.file, self.encoding, self.scale, out)
        height, width = texels.shape[:2]
        return Bitmaps(
            texels=texels.reshape(-1, 3),
            first=np.array([0]),
            width=np.array([width]),
            height=np.array([height]),
            filter=np.array([_FILTERS.index(self.filter)]),
            wrap=np.array([_WRAPS.index(self.wrap)]),
        )


class Bitmaps(NamedTuple):
    """A table of n images.  texels: (m, 3) of all images, linear sRGB, rows from the top;  for each
    image (n,): its first texel, width, height, filter (0 bilinear, 1 nearest), wrap (0 repeat,
    1 clamp, 2 mirror)."""

    texels: FloatArray
    first: IntArray
    width: IntArray
    height: IntArray
    filter: IntArray
    wrap: IntArray


def room_for(textures: Iterable[Texture], folder: Path) -> FloatArray:
    """An uninitialised array (m, 3) for the texels of all bitmaps among these.  Raises ValueError
    where they would not fit into the machine's memory."""
    files = [texture.file for texture in textures if isinstance(texture, Bitmap)]
    pixels = sum(pixels_of(folder / file) for file in files)
    check_memory(MOST_BYTES_PER_PIXEL * pixels, f"{len(files)} bitmaps of {pixels} pixels in all")
    return np.empty((pixels, 3))


def join(parts: list[Bitmaps]) -> Bitmaps:
    """One table from several; `first` is offset.

    Texels are not copied where they already lie one after another in one whole array, as from
    `room_for`: otherwise every image would be in memory twice.
    """
    counts = [len(part.texels) for part in parts]
    starts = np.cumsum([0, *counts[:-1]])
    moved = [
        part._replace(first=part.first + start) for part, start in zip(parts, starts, strict=True)
    ]
    columns = [np.concatenate(column) for column in zip(*(part[1:] for part in moved), strict=True)]
    whole = parts[0].texels.base
    if whole is None or whole.shape != (sum(counts), 3):
        whole = np.empty((sum(counts), 3))
    for part, start in zip(parts, starts, strict=True):
        place = whole[start : start + len(part.texels)]
        if part.texels.ctypes.data != place.ctypes.data:
            place[:] = part.texels
    return Bitmaps(whole, *columns)


def greatest(bitmaps: Bitmaps) -> float:
    """The largest value of any channel."""
    return float(bitmaps.texels.max())


@kernel
def _wrapped(i: int, n: int, wrap: int) -> int:
    """The texel, 0 to n - 1, at position i of a row of n texels that is continued by `wrap`."""
    if wrap == _CLAMP:
        return min(max(i, 0), n - 1)
    if wrap == _MIRROR:
        i = i % (2 * n)
        return min(i, 2 * n - 1 - i)
    return i % n


@kernel
def texel(bitmaps: Bitmaps, i: int, x: int, y: int) -> Vec3:
    """The texel at column x, row y (from the top) of image i; beyond its edges by its `wrap`."""
    width, height, wrap = bitmaps.width[i], bitmaps.height[i], bitmaps.wrap[i]
    k = _wrapped(y, height, wrap) * width + _wrapped(x, width, wrap)
    return row(bitmaps.texels, bitmaps.first[i] + k)


class Patch(NamedTuple):
    """The four texels whose centres surround a point, and its position between them: x from left to
    right, y from top to bottom, in [0, 1)."""

    upper_left: Vec3
    upper_right: Vec3
    lower_left: Vec3
    lower_right: Vec3
    x: float
    y: float


@kernel
def _patch(bitmaps: Bitmaps, i: int, u: float, v: float) -> Patch:
    """The patch at (u, v).  The centre of texel (x, y) is at u = (x + 1/2) / width,
    v = 1 - (y + 1/2) / height."""
    x, y = u * bitmaps.width[i] - 0.5, (1.0 - v) * bitmaps.height[i] - 0.5
    column, line = math.floor(x), math.floor(y)
    return Patch(
        texel(bitmaps, i, column, line),
        texel(bitmaps, i, column + 1, line),
        texel(bitmaps, i, column, line + 1),
        texel(bitmaps, i, column + 1, line + 1),
        x - column,
        y - line,
    )


@kernel
def lookup(bitmaps: Bitmaps, i: int, u: float, v: float) -> Vec3:
    """The colour at texture coordinates (u, v)."""
    if bitmaps.filter[i] == _NEAREST:
        return texel(
            bitmaps, i, math.floor(u * bitmaps.width[i]), math.floor((1.0 - v) * bitmaps.height[i])
        )
    patch = _patch(bitmaps, i, u, v)
    upper = patch.upper_left * (1.0 - patch.x) + patch.upper_right * patch.x
    lower = patch.lower_left * (1.0 - patch.x) + patch.lower_right * patch.x
    return upper * (1.0 - patch.y) + lower * patch.y


@kernel
def gradient(bitmaps: Bitmaps, i: int, u: float, v: float) -> tuple[float, float]:
    """The partial derivatives of the luminance with respect to u and v at texture coordinates
    (u, v), of the bilinear patch there; (0, 0) for the filter `nearest`."""
    if bitmaps.filter[i] == _NEAREST:
        return 0.0, 0.0
    patch = _patch(bitmaps, i, u, v)
    left, right = luminance(patch.upper_left), luminance(patch.upper_right)
    low_left, low_right = luminance(patch.lower_left), luminance(patch.lower_right)
    along_x = (right - left) * (1.0 - patch.y) + (low_right - low_left) * patch.y
    along_y = (low_left - left) * (1.0 - patch.x) + (low_right - right) * patch.x
    return along_x * bitmaps.width[i], -along_y * bitmaps.height[i]
