"""Bitmap texture: an image over the unit square of (u, v), its top row along v = 1."""

import math
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Examples, Positive
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.jit.kernel import kernel
from reference_rt.textures.image_file import (
    Bytes,
    Channel,
    Encoding,
    Texels,
    joined,
    most_bytes,
    read_texels,
    room_of,
)
from reference_rt.textures.texture import Texture
from reference_rt.util.memory import check_memory

_FILTERS = ("bilinear", "nearest")
_WRAPS = ("repeat", "clamp", "mirror")
_NEAREST = 1
_CLAMP, _MIRROR = 1, 2

Wrap = Literal["repeat", "clamp", "mirror"]

Wraps = Annotated[
    Wrap | tuple[Wrap, Wrap],
    BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value),
]
"""One for both axes, or those along u and v."""


class Bitmap(Texture):
    """An image: (u, v) = (0, 0) is its lower left corner, (1, 1) its upper right one."""

    EXAMPLES: ClassVar[Examples] = (
        {"file": "image.npy"},
        {"file": "image.npy", "encoding": "raw", "filter": "nearest", "wrap": "mirror"},
        {"file": "image.npy", "channel": "green", "scale": 0.5},
        {"file": "image.npy", "cutoff": 0.4, "wrap": ("clamp", "repeat")},
    )
    type: Literal["bitmap"] = "bitmap"
    file: str
    """The image, relative to the scene file: .exr, .hdr, .pfm, .npy, .png, .jpg, .tif, .webp, .bmp,
    .tga, .ppm or .gif."""
    filter: Literal["bilinear", "nearest"] = "bilinear"
    """The colour between texel centres: interpolated, or that of the nearest texel."""
    wrap: Wraps = "repeat"
    """The colour outside of [0, 1]: the image repeated, its rim, or the image mirrored; or two of
    these, `[along u, along v]`."""
    encoding: Encoding = "auto"
    """`srgb`: values are decoded to linear ones.  `raw`: values are used as they are.  `auto`:
    `srgb` for files of integers, `raw` for files of floats.  `radiance`: .hdr as Radiance itself
    decodes it, half a step of a mantissa brighter, EXPOSURE and COLORCORR undone; other renderers
    ignore these."""
    layer: str = ""
    """Of an .exr file with several pictures: the one whose channels begin so, such as `diffuse` for
    diffuse.R.  Default: R, G, B, or the file's only picture."""
    channel: Channel = "all"
    """The channel that is used, as grey: `red`, `green`, `blue`, or `alpha`, which is never decoded
    and is 1 in images without one.  Default: all colours."""
    scale: Positive = 1.0
    """A factor of the linear values: radiance and heights may need values above 1."""
    cutoff: Positive | None = None
    """Values of at least this, between texels and after `scale`, become 1, all others 0: the sharp
    edge of a mask.  Default: none."""

    @property
    def wraps(self) -> tuple[Wrap, Wrap]:
        """`wrap` along u and along v."""
        return self.wrap if isinstance(self.wrap, tuple) else (self.wrap, self.wrap)

    def tabulate(self, folder: Path, out: Bytes | None = None) -> "Bitmaps":
        """One row of the table.  out (n,): as in `read_texels`.  Raises ValueError (what is wrong,
        what was expected)."""
        texels = self.read(folder, out)
        along_u, along_v = map(_WRAPS.index, self.wraps)
        wrap = along_u + len(_WRAPS) * along_v
        return table_of(texels, _FILTERS.index(self.filter), wrap, self.cutoff)

    def read(self, folder: Path, out: Bytes | None = None) -> Texels:
        """The image.  Raises ValueError (what is wrong, what was expected)."""
        path = folder / self.file
        return read_texels(path, self.encoding, self.scale, out, self.layer, self.channel)


class Memory(NamedTuple):
    """The same bytes as codes of 8 and 16 bits and as floats: (n,), (n / 2,), (n / 4,), (n / 8,).
    A kernel then has the same type whatever the images hold."""

    codes8: Bytes
    codes16: npt.NDArray[np.uint16]
    floats32: npt.NDArray[np.float32]
    floats64: FloatArray


class Bitmaps(NamedTuple):
    """A table of n images.

    memory: the texels of all images, rows from the top;  decoded: linear values of codes, of all
    images;  for each image (n,): the bytes of a value (of 1 and 2 they are codes), its channels (3,
    of a grey image 1), the index of its first value in the memory of its type, and of code 0 in
    `decoded`, a factor of floats, the largest linear value, width, height, filter (0 bilinear, 1
    nearest), wrap (0 repeat, 1 clamp, 2 mirror: along u, and three times that along v), cutoff (0
    for none).
    """

    memory: Memory
    decoded: FloatArray
    itemsize: IntArray
    channels: IntArray
    first: IntArray
    first_code: IntArray
    scale: FloatArray
    greatest: FloatArray
    width: IntArray
    height: IntArray
    filter: IntArray
    wrap: IntArray
    cutoff: FloatArray


def table_of(texels: Texels, filter_code: int, wrap: int, cutoff: float | None = None) -> Bitmaps:
    """The table of one image."""
    height, width, channels = texels.values.shape
    return Bitmaps(
        _memory(texels.data),
        decoded=texels.decoded,
        itemsize=np.array([texels.values.itemsize]),
        channels=np.array([channels]),
        first=np.array([0]),
        first_code=np.array([0]),
        scale=np.array([texels.scale]),
        greatest=np.array([texels.greatest if cutoff is None else 1.0]),
        width=np.array([width]),
        height=np.array([height]),
        filter=np.array([filter_code]),
        wrap=np.array([wrap]),
        cutoff=np.array([cutoff or 0.0]),
    )


def _memory(data: Bytes) -> Memory:
    return Memory(data, data.view(np.uint16), data.view(np.float32), data.view(np.float64))


def room_for(textures: Iterable[Texture], folder: Path) -> Bytes:
    """An uninitialised array for the texels of all bitmaps among these.  Raises ValueError where
    they would not fit into the machine's memory."""
    bitmaps = [texture for texture in textures if isinstance(texture, Bitmap)]
    size = 0
    for one in bitmaps:
        with suppress(ValueError):  # reading it tells
            size += most_bytes(folder / one.file, one.encoding, one.layer)
    check_memory(size, f"{len(bitmaps)} bitmaps of {size} bytes in all")
    return room_of(size)


def join(parts: list[Bitmaps]) -> Bitmaps:
    """One table from several of one image.  Images with the same linear values of codes share
    them."""
    sizes = [len(part.memory.codes8) for part in parts]
    starts = np.cumsum([0, *sizes[:-1]])
    columns = [np.concatenate(column) for column in zip(*(part[2:] for part in parts), strict=True)]
    tables = {part.decoded.tobytes(): part.decoded for part in parts}
    decoded = np.concatenate(list(tables.values()))
    ends = np.cumsum([len(table) for table in tables.values()])
    first_codes = dict(zip(tables, ends, strict=True))
    whole = Bitmaps(_memory(joined([part.memory.codes8 for part in parts])), decoded, *columns)
    return whole._replace(
        first=starts // whole.itemsize,
        first_code=np.array([first_codes[p.decoded.tobytes()] - len(p.decoded) for p in parts]),
    )


def greatest(bitmaps: Bitmaps) -> float:
    """The largest value of any channel."""
    return float(bitmaps.greatest.max())


@kernel
def _wrapped(i: int, n: int, wrap: int) -> int:
    """The texel, 0 to n - 1, at position i of a row of n texels that is continued by `wrap`."""
    if 0 <= i < n:
        return i
    if wrap == _CLAMP:
        return min(max(i, 0), n - 1)
    if wrap == _MIRROR:
        i = i % (2 * n)
        return min(i, 2 * n - 1 - i)
    return i % n


@kernel
def _value(bitmaps: Bitmaps, i: int, k: int) -> float:
    """The linear value at index k of image i."""
    memory, itemsize, k = bitmaps.memory, bitmaps.itemsize[i], bitmaps.first[i] + k
    if itemsize <= 2:
        code = int(memory.codes8[k]) if itemsize == 1 else int(memory.codes16[k])
        return float(bitmaps.decoded[bitmaps.first_code[i] + code])
    stored = float(memory.floats32[k]) if itemsize == 4 else float(memory.floats64[k])
    return float(bitmaps.scale[i] * stored)


@kernel
def texel(bitmaps: Bitmaps, i: int, x: int, y: int) -> Vec3:
    """The texel at column x, row y (from the top) of image i; beyond its edges by its `wrap`."""
    wrap = bitmaps.wrap[i]
    x = _wrapped(x, bitmaps.width[i], wrap % 3)
    return _stored(bitmaps, i, x, _wrapped(y, bitmaps.height[i], wrap // 3))


@kernel
def _stored(bitmaps: Bitmaps, i: int, x: int, y: int) -> Vec3:
    """The texel at column x, row y of image i, which has both."""
    k = y * bitmaps.width[i] + x
    if bitmaps.channels[i] == 1:
        grey = _value(bitmaps, i, k)
        return Vec3(grey, grey, grey)
    k = 3 * k
    return Vec3(_value(bitmaps, i, k), _value(bitmaps, i, k + 1), _value(bitmaps, i, k + 2))


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
    width, height, wrap = bitmaps.width[i], bitmaps.height[i], bitmaps.wrap[i]
    left, right = _wrapped(column, width, wrap % 3), _wrapped(column + 1, width, wrap % 3)
    upper, lower = _wrapped(line, height, wrap // 3), _wrapped(line + 1, height, wrap // 3)
    return Patch(
        _stored(bitmaps, i, left, upper),
        _stored(bitmaps, i, right, upper),
        _stored(bitmaps, i, left, lower),
        _stored(bitmaps, i, right, lower),
        x - column,
        y - line,
    )


@kernel
def lookup(bitmaps: Bitmaps, i: int, u: float, v: float) -> Vec3:
    """The colour at texture coordinates (u, v)."""
    found = _filtered(bitmaps, i, u, v)
    cutoff = bitmaps.cutoff[i]
    if cutoff > 0.0:
        return Vec3(
            1.0 if found.x >= cutoff else 0.0,
            1.0 if found.y >= cutoff else 0.0,
            1.0 if found.z >= cutoff else 0.0,
        )
    return found


@kernel
def _filtered(bitmaps: Bitmaps, i: int, u: float, v: float) -> Vec3:
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
    (u, v), of the bilinear patch there; (0, 0) for the filter `nearest` and with a cutoff."""
    if bitmaps.filter[i] == _NEAREST or bitmaps.cutoff[i] > 0.0:
        return 0.0, 0.0
    patch = _patch(bitmaps, i, u, v)
    left, right = luminance(patch.upper_left), luminance(patch.upper_right)
    low_left, low_right = luminance(patch.lower_left), luminance(patch.lower_right)
    along_x = (right - left) * (1.0 - patch.y) + (low_right - low_left) * patch.y
    along_y = (low_left - left) * (1.0 - patch.x) + (low_right - right) * patch.x
    return along_x * bitmaps.width[i], -along_y * bitmaps.height[i]
