"""Stereolithography files, .stl (3D Systems 1989): separate triangles, binary or ascii.

Normals are not read, since they are those of the winding; nor are the attributes of binary files,
which have no agreed meaning: they are named as ignored.  The solids of an ascii file become one
mesh.
"""

import re
import struct
from array import array

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.shapes.meshes.files.data import RawMesh

_TRIANGLE = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])

_VERTEX = rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)\s+"
_FACET = re.compile(
    rb"\s*facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop\s+"
    + 3 * _VERTEX
    + rb"endloop\s+endfacet\b",
    re.IGNORECASE,
)
_SOLID = re.compile(rb"\s*solid\b[^\r\n]*", re.IGNORECASE)
_END = re.compile(rb"\s*endsolid\b[^\r\n]*", re.IGNORECASE)


def read(content: bytes) -> RawMesh:
    # Binary files may also begin with "solid": their length decides.
    count = struct.unpack_from("<I", content, 80)[0] if len(content) >= 84 else -1
    ignored: tuple[str, ...] = ()
    size = 84 + count * _TRIANGLE.itemsize
    if len(content) == size:
        triangles = np.frombuffer(content, _TRIANGLE, offset=84)
        vertices = triangles["vertices"].reshape(-1, 3)
        if triangles["attribute"].any():
            ignored = ("attributes of triangles",)
    elif _SOLID.match(content):
        vertices = _ascii(content)
    elif count < 0:
        raise ValueError("it is too short; expected 'solid' or a header of 84 bytes")
    else:
        raise ValueError(
            f"it has {len(content)} bytes; expected {size} for the {count} triangles that its "
            "header promises, or 'solid' as its first word"
        )
    return RawMesh(vertices, np.arange(len(vertices)).reshape(-1, 3), ignored=ignored)


def _ascii(content: bytes) -> FloatArray:
    text = content.rstrip()
    numbers, position = array("d"), 0
    try:
        while position < len(text):
            position = _after(_SOLID, text, position, "'solid'")
            while facet := _FACET.match(text, position):
                numbers.extend(map(float, facet.groups()))
                position = facet.end()
            position = _after(
                _END, text, position, "a whole facet of three vertices, or 'endsolid'"
            )
    except ValueError as error:
        line = text.count(b"\n", 0, position) + 1
        raise ValueError(f"after line {line}: {error}") from None
    return np.frombuffer(numbers, np.float64).reshape(-1, 3)


def _after(expected: re.Pattern[bytes], text: bytes, position: int, what: str) -> int:
    found = expected.match(text, position)
    if found is None:
        raise ValueError(f"expected {what}")
    return found.end()
