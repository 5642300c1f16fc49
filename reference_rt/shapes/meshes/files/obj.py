"""Wavefront .obj (Advanced Visualizer manual, appendix B1): polygons of v, vt and vn.

Vertex colours, `v x y z r g b`, are no part of the format but widely written, from 0 to 1 and as
displayed (by Blender, MeshLab and three.js): they are read as sRGB-encoded.  All groups and objects
are one mesh.  Materials, lines, points, curves and everything else are ignored, and named.
"""

import math
from array import array
from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes.meshes.files.data import RawMesh, linear
from reference_rt.shapes.meshes.files.obj_scanner import NONE, Scanned, scan
from reference_rt.shapes.meshes.files.polygons import doubt, triangulated

Triple = tuple[int, int, int]

_WIDTHS = {b"v": 3, b"vt": 2, b"vn": 3}

_NAMES_ONLY = (b"", b"g", b"o")
"""Lines that do not change the surface: blank ones, names of groups and objects."""


LARGE = 1 << 18
"""Bytes of the smallest file that the compiled scanner reads: to load or compile it takes longer
than to read a smaller one line by line."""


class _Corners(dict[bytes, int]):
    """The index of a corner's vertex, by the corner's text: "v", "v/vt", "v//vn", "v/vt/vn".

    `rows`: the values of the v, vt and vn lines so far; `triples`: for each vertex, in the order of
    their indices, the indices into these, from 0 and -1 for none.
    """

    def __init__(self) -> None:
        self.rows = {kind: array("d") for kind in _WIDTHS}
        self.triples: dict[Triple, int] = {}

    def __missing__(self, text: bytes) -> int:
        v, *others = text.split(b"/")
        if len(others) > 2:
            raise ValueError(f"{_shown(text)} is no corner; expected v, v/vt, v//vn or v/vt/vn")
        vt, vn = (*others, b"", b"")[:2]
        triple = (
            self._index(v, b"v"),
            self._index(vt, b"vt") if vt else -1,
            self._index(vn, b"vn") if vn else -1,
        )
        number = self.triples.setdefault(triple, len(self.triples))
        if b"-" not in text:  # a negative index counts back from its own line
            self[text] = number
        return number

    def _index(self, text: bytes, kind: bytes) -> int:
        count = len(self.rows[kind]) // _WIDTHS[kind]
        try:
            index = int(text)
        except ValueError:
            raise ValueError(f"{_shown(text)} is not an index; expected an integer") from None
        if index == 0 or abs(index) > count:
            raise ValueError(f"index {index} of {count} '{kind.decode()}' lines is out of range")
        return index - 1 if index > 0 else count + index


def read(content: bytes) -> RawMesh:
    """Vertices are numbered in the order of their first use; unused ones are left out.

    An index may only refer to lines before it.  Triangles without normals or uv at a corner have
    those of meshes without: their own normal, barycentrics.  Colours that not all vertices have are
    ignored.
    """
    found = scan(content) if len(content) >= LARGE else None
    return read_lines(content) if found is None else _of_scanned(found)


def _of_scanned(found: Scanned) -> RawMesh:
    others: dict[str, None] = {}
    for line in found.rest:
        words = line.partition(b"#")[0].split()
        _note(words[0] if words else b"", words, others)
    return _mesh(
        found.positions,
        found.uv,
        found.normals,
        found.colours,
        found.triples,
        found.corners,
        found.counts,
        others,
    )


def read_lines(content: bytes) -> RawMesh:
    """The same, line by line: any file.  Raises ValueError with the line."""
    vertex_of = _Corners()
    rows = vertex_of.rows
    colours, corners, counts = array("d"), array("q"), array("q")
    others: dict[str, None] = {}  # a set in the order of the file
    for line, text in _logical_lines(content):
        words = (text.partition(b"#")[0] if b"#" in text else text).split()
        kind = words[0] if words else b""
        try:
            if kind == b"f":
                corners.extend([vertex_of[w] for w in words[1:]])
                counts.append(len(words) - 1)
                if len(words) < 4:
                    raise ValueError("a face has fewer than three corners")
            elif kind == b"v":
                rows[b"v"].extend(_three(words))
                if len(words) > 5:
                    colours.extend(_colour(words))
                elif len(words) == 5 and words[4] != b"1" and float(words[4]) != 1.0:
                    others["w of v"] = None
            elif kind == b"vn":
                rows[b"vn"].extend(_three(words))
            elif kind == b"vt":
                rows[b"vt"].extend(_uv(words))
                if len(words) == 4 and float(words[3]) != 0.0:
                    others["w of vt"] = None
            else:
                _note(kind, words, others)
        except ValueError as error:
            raise ValueError(f"line {line}: {error}") from None

    triples = np.fromiter(chain.from_iterable(vertex_of.triples), np.int64)
    positions, uv, normals = (_table(rows[kind], width) for kind, width in _WIDTHS.items())
    rgb = _table(colours, 3)
    coloured = len(rgb) == len(positions)
    if len(rgb) and not coloured:
        others["colours of some v"] = None
    return _mesh(
        positions,
        uv,
        normals,
        rgb if coloured else None,
        triples.reshape(-1, 3),
        np.frombuffer(corners, np.int64),
        np.frombuffer(counts, np.int64),
        others,
    )


def _mesh(
    positions: FloatArray,
    uv: FloatArray,
    normals: FloatArray,
    colours: FloatArray | None,
    triples: IntArray,
    corners: IntArray,
    counts: IntArray,
    others: dict[str, None],
) -> RawMesh:
    """The mesh of a file's tables;  others: what is ignored besides incomplete tables."""
    faces, concave = triangulated(positions[triples[:, 0]], corners, counts)
    v, vt, vn = triples.T
    doubtful = doubt(concave)
    has: dict[str, IntArray] = {"vn": vn[faces] != NONE, "vt": vt[faces] != NONE}
    if has["vn"].any():
        others.pop("s (smoothing groups)", None)  # the normals contain them
    lack = {name: ~of.all(axis=1) for name, of in has.items() if of.any()}
    doubtful += tuple(f"{name} of some corners" for name, of in lack.items() if of.any())
    own = np.logical_or.reduce([np.zeros(len(faces), np.bool_), *lack.values()])
    if own.any():
        # These triangles have vertices of their own.
        more = faces[own].ravel()
        faces = faces.copy()
        faces[own] = len(v) + np.arange(len(more)).reshape(-1, 3)
        v, vt, vn = (np.concatenate([x, x[more]]) for x in (v, vt, vn))
    points = positions[v]
    of_vertices = {}
    for name, table in (("vn", normals), ("vt", uv)):
        if name in lack:
            index = vn if name == "vn" else vt
            of_vertices[name] = table[index]
            of_vertices[name][index == NONE] = 1.0  # of no triangle any more
            at = faces[lack[name]]
            of_vertices[name][at] = _own_normals(points[at]) if name == "vn" else _BARYCENTRICS
    return RawMesh(
        points,
        faces,
        of_vertices.get("vn"),
        of_vertices.get("vt"),
        None if colours is None else linear(colours[v]),
        tuple(others),
        doubtful,
    )


_BARYCENTRICS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
"""uv at the corners of a triangle without them."""


def _own_normals(p: FloatArray) -> FloatArray:
    """Normals (m, 1, 3) of triangles (m, 3, 3), of any length; any for those without area, which
    nothing hits."""
    edges = p[:, 1:] - p[:, :1]
    edges /= np.maximum(np.abs(edges).max(axis=(1, 2), keepdims=True), np.finfo(float).tiny)
    n = np.cross(edges[:, 0], edges[:, 1])
    n[~n.any(axis=1)] = (0.0, 0.0, 1.0)
    return n[:, None]


def _note(kind: bytes, words: list[bytes], others: dict[str, None]) -> None:
    """Note what a line has that is ignored."""
    if kind == b"s":
        if words[1:] not in ([b"off"], [b"0"]):
            others["s (smoothing groups)"] = None
    elif kind not in _NAMES_ONLY:
        others[_keyword(kind)] = None


def _keyword(kind: bytes) -> str:
    what = {b"mtllib": "materials", b"usemtl": "materials", b"l": "lines", b"p": "points"}
    name = kind.decode("ascii", "replace")
    return f"{name} ({what[kind]})" if kind in what else name


def _logical_lines(content: bytes) -> Iterable[tuple[int, bytes]]:
    """The lines and their numbers; a line that ends with a backslash continues on the next."""
    lines = enumerate(content.splitlines(), start=1)
    return _continued(lines) if b"\\" in content else lines


def _continued(lines: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
    begun, first = list[bytes](), 0
    for number, line in lines:
        text = line.partition(b"#")[0].rstrip()  # a comment does not continue
        first = first or number
        goes_on = text.endswith(b"\\")
        begun.append(text[:-1] if goes_on else text)
        if not goes_on:
            yield first, b" ".join(begun)
            begun, first = [], 0
    if begun:
        yield first, b" ".join(begun)


def _three(words: list[bytes]) -> list[float]:
    numbers = [float(w) for w in words[1:4]]
    if not (len(numbers) == 3 and all(map(math.isfinite, numbers))):
        raise ValueError(f"'{words[0].decode()}' needs three finite numbers")
    return numbers


def _uv(words: list[bytes]) -> list[float]:
    numbers = [float(w) for w in words[1:3]]
    if not (numbers and all(map(math.isfinite, numbers))):
        raise ValueError("'vt' needs one to three finite numbers")
    return numbers if len(numbers) == 2 else [numbers[0], 0.0]


def _colour(words: list[bytes]) -> list[float]:
    numbers = [float(w) for w in words[4:]]
    if not (len(numbers) == 3 and all(0.0 <= x <= 1.0 for x in numbers)):
        raise ValueError("'v' has a colour that is not three numbers from 0 to 1")
    return numbers


def _shown(word: bytes) -> str:
    return repr(word[:20].decode("ascii", "replace"))


def _table(numbers: "array[float]", width: int) -> FloatArray:
    return np.frombuffer(numbers, np.float64).reshape(-1, width)
