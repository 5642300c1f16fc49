"""Polygon files, .ply (Turk 1994): ascii, binary of both byte orders, any mixture of polygons.

It reads the element `vertex` with x y z, nx ny nz, uv (u v, s t or texture_u texture_v) and a
colour, and the element `face`, or `tristrips`, with its list vertex_indices or vertex_index;
everything else is ignored, and named.  Texture coordinates of a face's corners, its list texcoord,
come before those of vertices; u1 v1, u2 v2, ... are those of further sets.  A colour is red green
blue, or r g b; or diffuse_red and so on; or as Mitsuba writes it, color_0 color_1 color_2, and in
the other forms that it reads, color_r and vertex_color_x among them; the first of these that the
file has.  Colours of integers are sRGB-encoded, 255 or 65535 being 1: as displayed, which is what
scanners and modellers write.  Colours of floats are linear: as computed."""

import re
import struct
from array import array
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes.meshes.files.data import RawMesh, linear
from reference_rt.shapes.meshes.files.polygons import doubt, ramps, triangulated

# ---- the numbers after the header of a .ply file, as arrays --------------------------------------
#
# An ascii body is converted to a binary one of float64, so that the same functions read both.
# Memory is allocated only after a check that the file is long enough.


Array = npt.NDArray[Any]


class Property(NamedTuple):
    """A number, or a list of numbers after their count.

    `declared` is the numpy code of the numbers' type in the header; `item` is their type in the
    body, `length` that of the count, None where there is no list.
    """

    name: str
    declared: str
    item: np.dtype[Any]
    length: np.dtype[Any] | None


class Element(NamedTuple):
    """Rows with all properties, one row after the other."""

    name: str
    rows: int
    properties: list[Property]

    def least_size(self) -> int:
        """Bytes of a row whose lists are empty."""
        return sum((p.item if p.length is None else p.length).itemsize for p in self.properties)


def numbers(text: bytes) -> FloatArray:
    """All numbers of an ascii body."""
    try:
        return np.array(text.split(), np.float64)
    except ValueError:
        for number, line in enumerate(text.splitlines(), start=1):
            for word in line.split():
                _expect_number(word, number)
        raise


def _expect_number(word: bytes, line: int) -> None:
    try:
        float(word)
    except ValueError:
        shown = repr(word[:20].decode("ascii", "replace"))
        raise ValueError(f"line {line} after its header: {shown} is not a number") from None


def columns(body: memoryview, start: int, element: Element) -> tuple[dict[str, Array], int]:
    """The properties (rows,) of an element without lists, and the position of its end."""
    if any(p.length is not None for p in element.properties):
        raise ValueError(f"its element '{element.name}' has a list; expected numbers alone")
    size = element.least_size()
    end, found = _end(body, start, element, size), {}
    for p in element.properties:
        found[p.name] = _strided(body, start, (element.rows,), p.item, size)
        start += p.item.itemsize
    return found, end


def lists(
    body: memoryview, start: int, element: Element, wanted: Property | None
) -> tuple[Array, IntArray, int]:
    """The numbers of all lists of one property, one list after the other; the length of each list;
    the position of the element's end."""
    end = _end(body, start, element, element.least_size())
    if element.rows == 0 or all(p.length is None for p in element.properties):
        return np.zeros(0), np.zeros(0, np.int64), end
    found = _lists_of_equal_rows(body, start, element, wanted)
    return _lists_by_row(body, start, element, wanted) if found is None else found


def _end(body: memoryview, start: int, element: Element, row: int) -> int:
    end = start + element.rows * row
    if end > len(body):
        raise ValueError(f"it ends within the {element.rows} rows of '{element.name}'")
    return end


def _strided(
    body: memoryview, start: int, shape: tuple[int, ...], item: np.dtype[Any], row: int
) -> Array:
    """The number at the same offset of every row, (rows,), or n from there on, (rows, n)."""
    if shape[0] == 0:  # its place may be the end of the file
        return np.zeros(shape, item)
    return np.ndarray(shape, item, body, start, (row, item.itemsize)[: len(shape)])


def _lists_of_equal_rows(
    body: memoryview, start: int, element: Element, wanted: Property | None
) -> tuple[Array, IntArray, int] | None:
    """`lists` if every row has the same counts as the first one, else None."""
    size = _lists_by_row(body, start, element._replace(rows=1), None)[2] - start
    end = start + element.rows * size
    if end > len(body):
        return None
    found, counts, position = np.zeros(0), np.zeros(0, np.int64), start
    for p in element.properties:
        n = 1
        if p.length is not None:
            all_n = _strided(body, position, (element.rows,), p.length, size)
            n = int(all_n[0])
            if not np.all(all_n == n):
                return None
            position += p.length.itemsize
        if p is wanted:
            found = _strided(body, position, (element.rows, n), p.item, size).reshape(-1)
            counts = np.full(element.rows, n)
        position += n * p.item.itemsize
    return found, counts, end


def _lists_by_row(
    body: memoryview, position: int, element: Element, wanted: Property | None
) -> tuple[Array, IntArray, int]:
    """`lists` for rows of different lengths, one after the other."""
    first, counts = array("q"), array("q")
    for row in range(element.rows):
        for p in element.properties:
            n = 1
            if p.length is not None:
                position += p.length.itemsize
                n = _count(body, position - p.length.itemsize, p.length)
            begin, position = position, position + n * p.item.itemsize
            if position > len(body):
                raise ValueError(f"it ends within row {row} of '{element.name}'")
            if p is wanted:
                first.append(begin)
                counts.append(n)
    sizes = np.frombuffer(counts, np.int64)
    if wanted is None:
        return np.zeros(0), sizes, position
    size = wanted.item.itemsize
    where = np.repeat(np.frombuffer(first, np.int64), sizes) + size * ramps(sizes)
    found = np.frombuffer(body, np.uint8)[where[:, None] + np.arange(size)]
    return found.view(wanted.item).reshape(-1), sizes, position


def _count(body: memoryview, position: int, length: np.dtype[Any]) -> int:
    """The count of a list; 0 if the file ends before it."""
    if position + length.itemsize > len(body):
        return 0
    order = ">" if length.str[0] == ">" else "<"
    (n,) = struct.unpack_from(order + length.char, body, position)
    if not (n >= 0 and n % 1 == 0):
        raise ValueError(f"it has a list of {n} numbers; expected a count")
    return int(n)


# Both sets of names are in use.
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_UV = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))
_WORDS, _LETTERS = ("red", "green", "blue"), ("r", "g", "b")
_RGB = (
    _WORDS,
    _LETTERS,
    *(
        tuple(prefix + last for last in lasts)
        for prefix in ("diffuse_", "color_", "colour_", "vertex_color_", "vertex_colour_")
        for lasts in (_WORDS, _LETTERS, ("0", "1", "2"), ("1", "2", "3"), ("x", "y", "z"))
    ),
)
_NORMAL = ("nx", "ny", "nz")
_INDICES = ("vertex_indices", "vertex_index")
_TEXCOORD = "texcoord"  # of the corners of a face, as MeshLab writes them


class Header(NamedTuple):
    """`order`: a numpy byte order, "=" for ascii; `size` in bytes."""

    elements: list[Element]
    order: str
    size: int


def read(content: bytes) -> RawMesh:
    """Reads numbers of ascii files as float64, whatever float type the header names."""
    header = _header(content)
    ascii_ = header.order == "="
    body = memoryview(content)[header.size :]
    if ascii_:
        body = memoryview(numbers(bytes(body)).tobytes())
    mesh, position = RawMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64)), 0
    ignored: list[str] = []
    polygons = strips = of_corners = None
    for element in header.elements:
        if element.name == "vertex":
            table, position = columns(body, position, element)
            points = _together(table, _first(table, (("x", "y", "z"),)))
            if points is None:
                raise ValueError("its element 'vertex' lacks x, y or z; expected these")
            normal, uv, rgb = (_first(table, sets) for sets in ((_NORMAL,), _UV, _RGB))
            more = _further_uv(table)
            ignored += [
                f"vertex {name}"
                for name in table
                if name not in ("x", "y", "z", *normal, *uv, *more, *rgb)
            ]
            mesh = RawMesh(
                points,
                mesh.faces,
                _together(table, normal),
                _together(table, uv),
                _colours(table, rgb, element),
                more_uv=_together(table, more),
            )
        elif element.name == "face" and element.rows > 0:
            start = position
            corners, counts, position = lists(body, position, element, _indices(element))
            _expect_integers(corners)
            polygons = corners.astype(np.int64), counts
            used = [_indices(element).name]
            for p in element.properties:
                if p.name == _TEXCOORD and p.length is not None:
                    numbers_, sizes, _ = lists(body, start, element, p)
                    if np.array_equal(sizes, 2 * counts):
                        of_corners = numbers_.astype(np.float64).reshape(-1, 2)
                        used.append(_TEXCOORD)
            ignored += [f"face {p.name}" for p in element.properties if p.name not in used]
        elif element.name == "tristrips" and element.rows > 0:
            corners, counts, position = lists(body, position, element, _indices(element))
            _expect_integers(corners)
            strips = _of_strips(corners.astype(np.int64), counts)
        else:
            _, _, position = lists(body, position, element, None)
            if element.rows > 0:
                ignored.append(f"element {element.name}")
    if position != len(body):
        left = (len(body) - position) // (8 if ascii_ else 1)
        what = "numbers" if ascii_ else "bytes"
        raise ValueError(f"{left} {what} are left after all that its header promises")
    if strips is not None:
        mesh = mesh._replace(faces=strips)
    if polygons is not None:
        if strips is not None:
            raise ValueError("it has faces and tristrips; expected one of them")
        if of_corners is not None:
            mesh, polygons = _parted(mesh, polygons, of_corners)
        faces, concave = triangulated(mesh.vertices, *polygons)
        mesh = mesh._replace(faces=faces, doubtful=doubt(concave))
    return mesh._replace(ignored=tuple(ignored))


def _expect_integers(corners: Array) -> None:
    if corners.dtype.kind == "f" and not np.all(
        np.isfinite(corners) & (corners == np.trunc(corners))
    ):
        raise ValueError("it has an index that is no integer")


def _parted(
    mesh: RawMesh, polygons: tuple[IntArray, IntArray], uv: FloatArray
) -> tuple[RawMesh, tuple[IntArray, IntArray]]:
    """The mesh, and its polygons, with texture coordinates of their corners (n, 2): a vertex whose
    coordinates differ between faces becomes several."""
    corners, counts = polygons
    if np.any((corners < 0) | (corners >= len(mesh.vertices))):
        return mesh, polygons  # which is an error
    keys = np.column_stack([corners, uv.view(np.int64)])
    _, first, vertex = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    which = corners[first]
    parted = mesh._replace(
        vertices=mesh.vertices[which],
        normals=None if mesh.normals is None else mesh.normals[which],
        uv=uv[first],
        colours=None if mesh.colours is None else mesh.colours[which],
        more_uv=None if mesh.more_uv is None else mesh.more_uv[which],
    )
    return parted, (vertex.reshape(-1), counts)


def _further_uv(table: dict[str, Array]) -> tuple[str, ...]:
    """The names of the texture coordinates of sets 1, 2, ..."""
    found: tuple[str, ...] = ()
    while {*(pair := (f"u{len(found) // 2 + 1}", f"v{len(found) // 2 + 1}"))} <= table.keys():
        found += pair
    return found


def _of_strips(corners: IntArray, counts: IntArray) -> IntArray:
    """The triangles (m, 3) of strips, which -1 and the end of a list end: each corner makes one
    with the two before it, every second one in reverse."""
    row = np.repeat(np.arange(len(counts)), counts)
    cuts = np.flatnonzero((corners[:-1] < 0) | (corners[1:] < 0) | (np.diff(row) != 0)) + 1
    begins = np.zeros(len(corners), np.int64)
    begins[cuts] = cuts
    begins = np.maximum.accumulate(begins)
    last = np.flatnonzero(np.arange(len(corners)) - begins >= 2)
    is_odd = (last - begins[last]) % 2 == 1
    first, second = last - 2 + is_odd, last - 1 - is_odd
    return np.stack([corners[first], corners[second], corners[last]], axis=1)


def _first(table: dict[str, Array], sets: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """The first of several sets of names that is complete in the table; () for none."""
    return next((names for names in sets if all(n in table for n in names)), ())


def _together(table: dict[str, Array], names: tuple[str, ...]) -> FloatArray | None:
    if not names:
        return None
    return np.stack([table[n].astype(np.float64) for n in names], axis=1)


def _colours(
    table: dict[str, Array], names: tuple[str, ...], element: Element
) -> FloatArray | None:
    colours = _together(table, names)
    if colours is None:
        return None
    types = {p.declared for p in element.properties if p.name in names}
    if types <= {"f4", "f8"}:
        return colours
    if types not in ({"u1"}, {"u2"}):
        raise ValueError("its colours have an odd type; expected uchar, ushort, float or double")
    white = 255.0 if types == {"u1"} else 65535.0
    if not np.all((colours >= 0.0) & (colours <= white)):
        raise ValueError(f"it has a colour that is not from 0 to {white:.0f}")
    return linear(colours / white)


def _indices(element: Element) -> Property:
    for p in element.properties:
        if p.name in _INDICES and p.length is not None:
            if p.declared[0] == "f":
                raise ValueError(f"its '{p.name}' are floats; expected integers")
            return p
    raise ValueError(f"its element '{element.name}' has no list 'vertex_indices'; expected one")


def _header(content: bytes) -> Header:
    first = (content[:100].splitlines(keepends=True) or [b""])[0]
    newline = first[3:].lstrip(b" \t")
    if not first.startswith(b"ply") or newline not in (b"\n", b"\r\n", b"\r"):
        raise ValueError("Not a ply file! Expected 'ply' as its first line")
    # Some programs end this line otherwise than those before it.
    ends = rb"\r" if newline == b"\r" else rb"\r?\n"
    last = re.search(rb"[\r\n][ \t]*end_header[ \t]*" + ends, content)
    if last is None:
        raise ValueError("its header has no line 'end_header'")
    end = last.start()
    order, elements = "", list[Element]()
    for number, line in enumerate(content[:end].splitlines(), start=1):
        try:
            match line.decode("latin-1").split():
                case ["format", name, "1.0"] if name in _ORDERS and not elements:
                    order = _ORDERS[name]
                case ["element", name, count] if order and count.isdecimal():
                    elements.append(Element(name, int(count), []))
                case ["property", *words] if elements:
                    elements[-1].properties.append(_property(words, order))
                case ["ply" | "comment" | "obj_info", *_] | []:
                    pass
                case words:
                    expected = "'format', then elements with their count, each with its properties"
                    raise ValueError(f"{' '.join(words)[:40]!r}; expected {expected}")
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from None
    if not order:
        raise ValueError("its header has no line 'format'")
    for names in ([e.name for e in elements], *([p.name for p in e.properties] for e in elements)):
        if len(names) != len(set(names)):
            raise ValueError("its header has a name twice; expected different ones")
    return Header(elements, order, last.end())


def _property(words: list[str], order: str) -> Property:
    def stored(name: str) -> np.dtype[Any]:
        # The numbers of an ascii body become float64, whatever their declared type.
        return np.dtype(np.float64 if order == "=" else order + _TYPES[name])

    match words:
        case [kind, name] if kind in _TYPES:
            return Property(name, _TYPES[kind], stored(kind), None)
        case ["list", count, kind, name] if kind in _TYPES and _TYPES.get(count, "f")[0] != "f":
            return Property(name, _TYPES[kind], stored(kind), stored(count))
    expected = "'TYPE NAME' or 'list INTEGER_TYPE TYPE NAME'"
    raise ValueError(f"property {' '.join(words)[:40]!r}; expected {expected}")
