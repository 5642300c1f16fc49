"""Formats of positions alone: .stl, .off, and what trimesh reads, if the packages that it needs are
installed.

Stereolithography files, .stl (3D Systems 1989), are separate triangles, binary or ascii.
Normals are not read, since they are those of the winding; nor are the attributes of binary files,
which have no agreed meaning: they are named as ignored.  The solids of an ascii file become one
mesh, and equal vertices one vertex.  Object files, .off (Geomview), are polygons in ascii.  Of
COFF, NOFF and STOFF files only the positions are read; colours, normals and texture coordinates are
ignored, and named.

Of trimesh's formats the positions and triangles are read, in the scene that the file describes,
without normals, uv and colours (the last two are named as ignored).
"""

import codecs
import io
import re
import struct
import warnings
import zipfile
from array import array
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IdArray
from reference_rt.shapes.meshes.files.data import RawMesh, joined
from reference_rt.shapes.meshes.files.polygons import doubt, triangulated
from reference_rt.util.memory import check_unpacked

Corners = npt.NDArray[np.floating[Any]]

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


def read_stl(content: bytes) -> RawMesh:
    # Binary files may also begin with "solid": their length decides.
    count = struct.unpack_from("<I", content, 80)[0] if len(content) >= 84 else -1
    ignored: tuple[str, ...] = ()
    size = 84 + count * _TRIANGLE.itemsize
    if len(content) == size:
        triangles = np.frombuffer(content, _TRIANGLE, offset=84)
        corners = triangles["vertices"]
        if triangles["attribute"].any():
            ignored = ("attributes of triangles",)
    elif _SOLID.match(text := content.removeprefix(codecs.BOM_UTF8)):
        corners = _ascii(text)
    elif count < 0:
        raise ValueError("it is too short; expected 'solid' or a header of 84 bytes")
    else:
        raise ValueError(
            f"it has {len(content)} bytes; expected {size} for the {count} triangles that its "
            "header promises, or 'solid' as its first word"
        )
    if not np.isfinite(corners).all():  # an error, which names the number in the file
        vertices = corners.reshape(-1, 3)
        return RawMesh(vertices, np.arange(len(vertices)).reshape(-1, 3), ignored=ignored)
    return RawMesh(*_merged(corners), ignored=ignored)


def _merged(corners: Corners) -> tuple[Corners, IdArray]:
    """Vertices and triangles (m, 3) of corners (m, 3, 3).  Vertices of the same bits are one, which
    is a sixth of the memory; in the order of their first use."""
    hashes = np.zeros(corners.size // 3, np.uint64)
    for k in range(3):
        hashes ^= _bits(corners, k)
        hashes *= _ODD
        hashes ^= hashes >> np.uint64(29)
    order = np.argsort(hashes)
    hashes = hashes[order]
    is_new = np.ones(len(hashes), np.bool_)
    is_new[1:] = hashes[1:] != hashes[:-1]
    del hashes
    for k in range(3):  # equal hashes of different vertices, should there be any
        bits = _bits(corners, k)[order]
        is_new[1:] |= bits[1:] != bits[:-1]
    starts = np.flatnonzero(is_new)
    first = np.minimum.reduceat(order, starts) if len(order) else order
    by_use = np.argsort(first)
    number = np.empty(len(first), np.int32)
    number[by_use] = np.arange(len(first), dtype=np.int32)
    vertex = np.empty(len(order), np.int32)
    vertex[order] = np.repeat(number, np.diff(starts, append=len(order)))
    first = first[by_use]
    return corners[first // 3, first % 3], vertex.reshape(-1, 3)


_ODD = np.uint64(0x9E3779B97F4A7C15)
"""2^64 over the golden ratio: products by it spread over all bits (Knuth 1998, 6.4)."""


def _bits(corners: Corners, axis: int) -> npt.NDArray[Any]:
    """The bits of one coordinate of all corners, (3 m,)."""
    return corners[..., axis].reshape(-1).view(f"u{corners.itemsize}")


def _ascii(content: bytes) -> FloatArray:
    """The corners (m, 3, 3) of all triangles."""
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
    return np.frombuffer(numbers, np.float64).reshape(-1, 3, 3)


def _after(expected: re.Pattern[bytes], text: bytes, position: int, what: str) -> int:
    found = expected.match(text, position)
    if found is None:
        raise ValueError(f"expected {what}")
    return found.end()


def read_off(content: bytes) -> RawMesh:
    lines = _lines(content)
    number, words = next(lines, (1, [b""]))
    # Not 4OFF and nOFF, whose coordinates are not x y z.  Some write the first number without a
    # blank before it.
    first = re.fullmatch(rb"((?:ST)?C?N?OFF)(\d*)", words[0])
    if first is None:
        raise ValueError("expected 'OFF' as its first word")
    kind = _kind(first[1])
    words = [word for word in (*first.groups(), *words[1:]) if word]
    if not words[1:]:
        number, words = next(lines, (number, words))
        words = [b"OFF", *words]
    try:
        n_vertices, n_faces = (int(w) for w in words[1:3])
    except ValueError:
        raise ValueError(f"line {number}: expected the numbers of vertices and faces") from None
    # A line takes two bytes at least.
    if not (n_vertices >= 0 and n_faces >= 0 and 2 * (n_vertices + n_faces) <= len(content)):
        raise ValueError(f"line {number}: {n_vertices} vertices and {n_faces} faces do not fit in")

    points, corners, counts = array("d"), array("q"), array("q")
    ignored: dict[str, None] = {}  # a set in the order of the file
    for number, words in islice(lines, n_vertices):
        try:
            x, y, z = map(float, words[:3])
        except ValueError:
            raise ValueError(f"line {number}: expected a vertex, x y z") from None
        points.extend((x, y, z))
        if len(words) > 3:
            ignored[f"{kind} of vertices"] = None
    for number, words in islice(lines, n_faces):
        try:
            count = int(words[0])
            corners.extend([int(w) for w in words[1 : count + 1]])
            counts.append(count)
        except (ValueError, OverflowError):
            raise ValueError(f"line {number}: expected a face, n i1 ... in") from None
        if not 3 <= count < len(words):
            raise ValueError(
                f"line {number}: {len(words) - 1} of {count} corners; expected three or more, all"
            )
        if len(words) > count + 1:
            ignored["colours of faces"] = None
    if len(counts) < n_faces:
        raise ValueError(f"it ends within its {n_vertices} vertices and {n_faces} faces")
    if (left := next(lines, None)) is not None:
        raise ValueError(f"line {left[0]}: something is left after the last face")
    vertices = np.frombuffer(points, np.float64).reshape(-1, 3)
    faces, concave = triangulated(
        vertices, np.frombuffer(corners, np.int64), np.frombuffer(counts, np.int64)
    )
    return RawMesh(vertices, faces, ignored=tuple(ignored), doubtful=doubt(concave))


def _kind(word: bytes) -> str:
    """The properties of vertices besides positions, according to the first word of the file."""
    letters = {b"ST": "texture coordinates", b"C": "colours", b"N": "normals"}
    found = [what for letter, what in letters.items() if letter in word.removesuffix(b"OFF")]
    return " and ".join(found) or "further numbers"


def _lines(content: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """The number and the words of each line that is not blank."""
    for number, line in enumerate(content.splitlines(), start=1):
        if words := line.partition(b"#")[0].split():
            yield number, words


# Formats with readers of our own, or without surfaces.
_LEFT_OUT = {"obj", "ply", "stl", "stl_ascii", "off", "gltf", "glb", "3mf", "xyz"}

PARSED = 40
"""The most bytes of memory that trimesh takes per byte of an unpacked archive of XML: 33 (measured
with one million of the shortest triangles, 2026-11-25)."""


def suffixes() -> list[str]:
    from trimesh.exchange import load  # costs 0.3 s to import, and few scenes need it

    return sorted(f".{kind}" for kind in load.mesh_formats() - _LEFT_OUT)


def reader(suffix: str) -> Callable[[bytes, Path], RawMesh] | None:
    """The reader of files with this suffix; None if there is none."""
    if suffix not in suffixes():
        return None
    return lambda content, folder: joined(_parts(content, suffix[1:]))


def _parts(content: bytes, kind: str) -> Iterator[tuple[RawMesh, transform.Affine]]:
    import trimesh

    file = io.BytesIO(content)
    if zipfile.is_zipfile(file):
        size = sum(entry.file_size for entry in zipfile.ZipFile(file).infolist())
        check_unpacked(len(content), size, "it", PARSED)
    file.seek(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # With this resolver no other file is opened, whatever the content names.
        scene = trimesh.load(file, file_type=kind, resolver={}, force="scene", process=False)
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if hasattr(geometry, "faces"):
            vertices = np.asarray(geometry.vertices, np.float64)
            faces = np.asarray(geometry.faces, np.int64)
            visual = getattr(geometry.visual, "kind", None)
            ignored = () if visual is None else (f"{visual} colours or textures",)
            raw = RawMesh(vertices, faces, ignored=ignored)
            yield raw, np.asarray(matrix, np.float64)[:3]
