"""Mitsuba's `.serialized` meshes, of versions 3 and 4: several meshes in a file, each compressed.

Layout (src/shapes/serialized.cpp): two shorts, the format's number and the version; a zlib stream;
at the end of the file the offsets of all meshes (u64, in version 3 u32) and their number (u32).
The stream: flags (u32); in version 4 a name, which ends with a null byte; the numbers of vertices
and triangles (u64); positions, and normals, uv and colours as the flags say, in float or double;
indices (u32).
"""

import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.shapes.meshes.files.data import RawMesh

_FORMAT = 0x041C
_NORMALS, _UV, _COLOURS, _DOUBLE = 0x0001, 0x0002, 0x0008, 0x2000

MOST_BYTES = 1 << 33
"""The largest mesh that is unpacked: a damaged file may claim any size."""


def read(content: bytes, index: int) -> RawMesh:
    """Mesh number `index` of a file.  Raises ValueError (what is wrong, what was expected)."""
    version = _header(content, 0)
    start = 0
    if index != 0:
        start = _offset(content, version, index)
        version = _header(content, start)
    unpacker = zlib.decompressobj()
    try:
        data = unpacker.decompress(content[start + 4 :], MOST_BYTES)
    except zlib.error as error:
        raise ValueError(f"mesh {index} cannot be unpacked: {error}") from None
    stream = _Stream(data, index)
    (flags,) = stream.numbers("<u4", 1).tolist()
    if version == 4:
        stream.skip_name()
    vertices, faces = (int(n) for n in stream.numbers("<u8", 2).tolist())
    real = "<f8" if flags & _DOUBLE else "<f4"
    positions = stream.numbers(real, 3 * vertices).reshape(-1, 3)
    normals = stream.numbers(real, 3 * vertices).reshape(-1, 3) if flags & _NORMALS else None
    uv = stream.numbers(real, 2 * vertices).reshape(-1, 2) if flags & _UV else None
    if flags & _COLOURS:
        stream.numbers(real, 3 * vertices)  # which Mitsuba ignores, too
    indices = stream.numbers("<u4", 3 * faces).reshape(-1, 3)
    return RawMesh(positions, indices.astype(np.int64), normals, uv)


def _header(content: bytes, start: int) -> int:
    """The version of the mesh at this offset."""
    if len(content) < start + 4:
        raise ValueError("the file ends before its header; expected a .serialized mesh")
    number, version = struct.unpack_from("<HH", content, start)
    if number != _FORMAT:
        raise ValueError(f"begins with {number:#06x}; expected {_FORMAT:#06x}, a .serialized mesh")
    if version not in (3, 4):
        raise ValueError(f"has version {version}; expected 3 or 4")
    return int(version)


def _offset(content: bytes, version: int, index: int) -> int:
    if len(content) < 8:
        raise ValueError("the file ends before its table of meshes")
    (count,) = struct.unpack_from("<I", content, len(content) - 4)
    if not 0 <= index < count:
        raise ValueError(f"has {count} meshes; expected a 'shape_index' from 0 to {count - 1}")
    size, kind = (8, "<Q") if version == 4 else (4, "<I")
    place = len(content) - 4 - size * (count - index)
    if place < 4:
        raise ValueError("the file ends before its table of meshes")
    (start,) = struct.unpack_from(kind, content, place)
    return int(start)


class _Stream:
    def __init__(self, data: bytes, index: int) -> None:
        self.data, self.index, self.place = data, index, 0

    def numbers(self, kind: str, count: int) -> npt.NDArray[Any]:
        size = np.dtype(kind).itemsize * count
        if size > len(self.data) - self.place:
            raise ValueError(f"mesh {self.index} ends early: {len(self.data)} bytes unpacked")
        found = np.frombuffer(self.data, kind, count, self.place)
        self.place += size
        return found

    def skip_name(self) -> None:
        end = self.data.find(b"\0", self.place)
        if end < 0:
            raise ValueError(f"mesh {self.index} has a name without an end")
        self.place = end + 1
