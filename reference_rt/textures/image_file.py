"""Reading image files as linear sRGB."""

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.core.image_files.image_file import Curve, ImageFile, StoredStrip
from reference_rt.util.errors import SceneWarning
from reference_rt.util.memory import check_memory

Encoding = Literal["auto", "srgb", "raw", "radiance"]
"""How the values of a file become linear ones: see `Bitmap.encoding`."""

Channel = Literal["all", "red", "green", "blue", "alpha"]
"""Which values of a file are used: see `Bitmap.channel`."""

COLOURS = ("red", "green", "blue")

READER = 8
"""The most bytes per pixel that reading an image takes beside its values."""


def read_image(
    path: Path, encoding: Encoding, scale: float = 1.0, layer: str = "", beside: int = 0
) -> FloatArray:
    """(height, width, 3) linear sRGB times `scale`, row 0 on top, finite and at least 0.  beside:
    bytes per pixel that are made of these and stored, too.  Raises ValueError (what is wrong, what
    was expected)."""
    with reading(path, encoding, layer) as image:
        pixels = image.height * image.width
        check_memory((24 + max(READER, beside)) * pixels, f"{image.width} x {image.height} pixels")
        colours = np.empty((image.height, image.width, 3))
        for rows, values, _ in image.strips(curve_of(image, encoding)):
            check_values(values, rows.start)
            with np.errstate(over="ignore"):
                np.multiply(values, scale, out=colours[rows])
            if not np.isfinite(colours[rows]).all():
                raise ValueError("a colour times the scale overflows; expected a smaller scale")
        _say(image)
    return colours


def _say(image: ImageFile) -> None:
    """Issue a warning of what was left out."""
    if image.note:
        warnings.warn(SceneWarning(f"{image.path} {image.note}"), stacklevel=3)


@contextmanager
def reading(path: Path, encoding: Encoding, layer: str = "") -> Iterator[ImageFile]:
    """The image in a file, while it is read.  Raises ValueError (the file, what is wrong, what was
    expected) for all that goes wrong meanwhile."""
    from reference_rt.core.image_files import HdrFile, open_image  # importing Pillow is slow

    try:
        image = open_image(path, layer, radiance=encoding == "radiance")
        if encoding == "radiance" and not isinstance(image, HdrFile):
            raise ValueError("is no Radiance image; expected one with `encoding: radiance`")
        yield image
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}; expected an image") from None
    except MemoryError:
        raise ValueError(f"{path}: does not fit into memory; expected a smaller image") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def curve_of(image: ImageFile, encoding: Encoding) -> Curve | None:
    """The function that decodes the image's values; None where they are linear."""
    is_srgb = image.is_integer if encoding == "auto" else encoding == "srgb"
    return linear if is_srgb else None


def check_values(values: npt.NDArray[Any], first: int) -> None:
    """Raises ValueError for values (rows, width, channels), from row `first` on, that are negative
    or not finite."""
    good = np.isfinite(values).all(axis=-1)
    if not good.all():
        y, x = np.argwhere(~good)[0]
        raise ValueError(
            f"the pixel at column {x}, row {first + y} is not finite; expected finite ones"
        )
    if (values < 0.0).any():
        y, x, _ = np.argwhere(values < 0.0)[0]
        raise ValueError(
            f"the pixel at column {x}, row {first + y} is negative; expected values of at least 0"
        )


def linear(encoded: FloatArray) -> FloatArray:
    """Decodes sRGB's transfer function to linear values (IEC 61966-2-1)."""
    low = encoded / 12.92
    high = np.power((np.maximum(encoded, 0.04045) + 0.055) / 1.055, 2.4)
    return np.where(encoded <= 0.04045, low, high)


# Texels of an image in as few bytes as its file has: integer codes, half floats or floats.


Bytes = npt.NDArray[np.uint8]

WIDEST = 8
"""Bytes of a float64.  The texels of an image take a multiple of them, so that those of the next
one are aligned."""


class Texels(NamedTuple):
    """data (n,): the bytes of `values`, and padding;  values (height, width, channels): codes
    (uint8, uint16; half floats by their bits) or floats (float32, float64), of 3 channels, of a
    grey image 1;  decoded: by code its linear value times the scale, empty for floats;  scale: a
    factor of floats;  greatest: the largest linear value times the scale."""

    data: Bytes
    values: npt.NDArray[Any]
    decoded: FloatArray
    scale: float
    greatest: float

    @property
    def linear(self) -> FloatArray:
        """(height, width, 3): linear sRGB times the scale."""
        if len(self.decoded):
            found = self.decoded[self.values]
        else:
            found = self.values * np.float64(self.scale)
        return found if found.shape[2] == 3 else np.repeat(found, 3, axis=2)


def room_of(size: int) -> Bytes:
    """An uninitialised array for `size` bytes of texels, and padding."""
    return np.empty(padded(size) // WIDEST).view(np.uint8)


def padded(size: int) -> int:
    """The least multiple of WIDEST that is not below `size`."""
    return -(-size // WIDEST) * WIDEST


def most_bytes(path: Path, encoding: Encoding, layer: str = "") -> int:
    """The most bytes that the texels of a file can take, according to its header.  Raises
    ValueError (what is wrong, what was expected)."""
    with reading(path, encoding, layer) as image:
        pixels = image.height * image.width
        is_decoded = not image.is_integer and curve_of(image, encoding) is not None
        kind = np.dtype("float64" if is_decoded else image.kind)
        size = pixels * (1 if image.is_grey else 3) * kind.itemsize
        check_memory(size + READER * pixels, f"{image.width} x {image.height} pixels")
    return padded(size)


def read_texels(
    path: Path,
    encoding: Encoding,
    scale: float,
    out: Bytes | None = None,
    layer: str = "",
    channel: Channel = "all",
) -> Texels:
    """out (n,), aligned: if it is large enough, the texels are written to its beginning.  Raises
    ValueError (what is wrong, what was expected)."""
    from reference_rt.core.image_files.image_file import as_float64, decoding

    most_bytes(path, encoding, layer)
    with reading(path, encoding, layer) as image, np.errstate(over="ignore", invalid="ignore"):
        curve = None if channel == "alpha" else curve_of(image, encoding)
        strips = (_only(channel, strip) for strip in image.stored(channel == "alpha"))
        first = next(strips)
        kind = first.values.dtype.name
        decoded = np.zeros(0)
        if kind in ("uint8", "uint16", "float16"):
            decoded = decoding(kind, curve) * scale
            kind = "uint8" if kind == "uint8" else "uint16"
        elif curve:
            kind = "float64"
        shape = image.height, image.width, first.values.shape[2]
        size = math.prod(shape) * np.dtype(kind).itemsize
        data = room_of(size) if out is None or len(out) < padded(size) else out[: padded(size)]
        data[size:] = 0  # for digests of all bytes, such as those of checkpoints
        texels = data[:size].view(kind).reshape(shape)
        greatest = 0.0
        for rows, values, _ in chain((first,), strips):
            if not image.is_integer:
                check_values(values, rows.start)
            if len(decoded):
                texels[rows] = np.ascontiguousarray(values).view(kind)
                most = decoded[values.max().view(kind)]
            else:
                texels[rows] = curve(as_float64(values)) if curve else values
                most = scale * np.float64(texels[rows].max())
            greatest = max(greatest, float(most))
        if not np.isfinite(greatest):
            raise ValueError("a colour times the scale overflows; expected a smaller scale")
        _say(image)
    return Texels(data, texels, decoded, 1.0 if len(decoded) else scale, greatest)


def _only(channel: Channel, strip: StoredStrip) -> StoredStrip:
    """The strip with one channel as its values."""
    if channel == "alpha":
        kind = strip.values.dtype
        opaque = np.iinfo(kind).max if kind.kind == "u" else 1.0
        shape = strip.values.shape[:2]
        opacity = np.full(shape, opaque, kind) if strip.opacity is None else strip.opacity
        return strip._replace(values=opacity[..., None])
    if channel == "all" or strip.values.shape[2] == 1:
        return strip
    return strip._replace(values=strip.values[..., COLOURS.index(channel), None])


def joined(parts: Sequence[Bytes]) -> Bytes:
    """The bytes of several images, one after another: without a copy where they are so already in
    the array that they are parts of, since otherwise every image would be in memory twice."""
    whole = parts[0].base
    lengths = [len(part) for part in parts]
    if whole is not None and whole.ctypes.data == parts[0].ctypes.data:
        starts = whole.ctypes.data + np.cumsum([0, *lengths[:-1]])
        if starts.tolist() == [part.ctypes.data for part in parts]:
            return whole.view(np.uint8)[: sum(lengths)]
    data = room_of(sum(lengths))
    np.concatenate(parts, out=data)
    return data
