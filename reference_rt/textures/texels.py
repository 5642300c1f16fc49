"""Texels of an image in as few bytes as its file has: integer codes, half floats or floats."""

import math
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.textures.image_file import READER, Encoding, check_values, curve_of, reading
from reference_rt.util.memory import check_memory

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


def most_bytes(path: Path, encoding: Encoding) -> int:
    """The most bytes that the texels of a file can take, according to its header.  Raises
    ValueError (what is wrong, what was expected)."""
    with reading(path, encoding) as image:
        pixels = image.height * image.width
        is_decoded = not image.is_integer and curve_of(image, encoding) is not None
        kind = np.dtype("float64" if is_decoded else image.kind)
        size = pixels * (1 if image.is_grey else 3) * kind.itemsize
        check_memory(size + READER * pixels, f"{image.width} x {image.height} pixels")
    return padded(size)


def read_texels(path: Path, encoding: Encoding, scale: float, out: Bytes | None = None) -> Texels:
    """out (n,), aligned: if it is large enough, the texels are written to its beginning.  Raises
    ValueError (what is wrong, what was expected)."""
    from reference_rt.core.image_files.image_file import as_float64, decoding

    most_bytes(path, encoding)
    with reading(path, encoding) as image, np.errstate(over="ignore", invalid="ignore"):
        curve = curve_of(image, encoding)
        strips = image.stored()
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
    return Texels(data, texels, decoded, 1.0 if len(decoded) else scale, greatest)


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
