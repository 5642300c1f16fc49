"""Regular .obj files, as programs write them, read by a compiled scanner.

Regular are files without errors, continued lines and comments behind data, in which all positions
have three numbers, or all three and a colour.  Of any other file `scan` returns None; `obj` reads
it line by line, which also finds the errors and their lines."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import entry_kernel, kernel, signature_of
from reference_rt.jit.parallel_compile import Call

__all__ = [
    "NONE",
    "POWERS",
    "Bytes",
    "Decimal",
    "Scanned",
    "decimal",
    "ends_word",
    "is_blank",
    "is_digit",
    "scan",
    "scan_call",
    "skip_blanks",
]


# ---- decimal numbers in the bytes of a text file, for compiled readers ---------------------------


Bytes = npt.NDArray[np.uint8]

NONE = -1

EXACT = 22
"""Largest power of ten that is a float64; a decimal of at most 2^53 over or times such a power is
rounded once, and so correctly (Clinger 1990, "How to read floating point numbers accurately")."""

POWERS: FloatArray = np.array([float(f"1e{k}") for k in range(EXACT + 1)])


class Decimal(NamedTuple):
    """at: the byte behind it, NONE if it is none;  exact: whether value is it, rounded once."""

    value: float
    at: int
    exact: bool


@kernel
def is_blank(byte: int) -> bool:
    return byte == 32 or byte == 9


@kernel
def ends_word(byte: int) -> bool:
    """Whether it ends a word; a comment, which begins with #, does so too."""
    return is_blank(byte) or byte == 10 or byte == 13 or byte == 35


@kernel
def is_digit(byte: int) -> bool:
    return 48 <= byte <= 57


@kernel
def skip_blanks(data: Bytes, at: int) -> int:
    while is_blank(data[at]):
        at += 1
    return at


@kernel
def decimal(data: Bytes, at: int, powers: FloatArray) -> Decimal:
    """A decimal number that ends at a blank or at the end of a line."""
    negative = data[at] == 45
    if negative or data[at] == 43:
        at += 1
    mantissa, digits, exponent, seen = 0, 0, 0, False
    fraction = False
    while is_digit(data[at]) or (data[at] == 46 and not fraction):
        if data[at] == 46:
            fraction = True
        else:
            seen = True
            if digits > 0 or data[at] != 48:
                digits += 1
            if digits <= 18:
                mantissa = 10 * mantissa + int(data[at]) - 48
                if fraction:
                    exponent -= 1
        at += 1
    if not seen:
        return Decimal(0.0, NONE, False)
    if data[at] == 101 or data[at] == 69:
        at += 1
        below = data[at] == 45
        if below or data[at] == 43:
            at += 1
        if not is_digit(data[at]):
            return Decimal(0.0, NONE, False)
        power = 0
        while is_digit(data[at]):
            power = min(10 * power + int(data[at]) - 48, 100_000)
            at += 1
        exponent += -power if below else power
    if not ends_word(data[at]):
        return Decimal(0.0, NONE, False)
    if digits == 0:
        exponent = 0
    exact = digits <= 18 and mantissa <= 1 << 53 and -EXACT <= exponent <= EXACT
    value = float(mantissa)
    if exact and exponent < 0:
        value /= powers[-exponent]
    elif exact:
        value *= powers[exponent]
    return Decimal(-value if negative else value, at, exact)


V, VT, VN, FACE, OTHER = range(5)
"""Kinds of lines."""

LONGEST = 1024
"""Most pairs of texture coordinates and normal that one position is used with: each use is searched
for among them."""


class Scanned(NamedTuple):
    """positions, colours (n, 3), uv (k, 2), normals (l, 3): as the file has them, k and l possibly
    0, colours possibly None;  triples (m, 3): the indices of each vertex into positions, uv and
    normals, in the order of their first use, NONE for none;  corners: the vertex of each corner of
    a face;  counts: corners of each face;  rest: the other lines, in order."""

    positions: FloatArray
    colours: FloatArray | None
    uv: FloatArray
    normals: FloatArray
    triples: IntArray
    corners: IntArray
    counts: IntArray
    rest: list[bytes]


class _Out(NamedTuple):
    """What the scanner writes.  positions, uv, normals: the numbers of v, vt and vn lines;  hard
    (n, 4): numbers that take more than one rounding: kind, place in its table, first and last byte;
    triples, corners, counts: as in `Scanned`;  first (n,): a vertex of each position;  following
    (m,): the next one of the same position;  rest (k, 2): first and last byte of other lines."""

    positions: FloatArray
    uv: FloatArray
    normals: FloatArray
    hard: IntArray
    triples: IntArray
    first: IntArray
    following: IntArray
    corners: IntArray
    counts: IntArray
    rest: IntArray


class _Ends(NamedTuple):
    """How much of each array of `_Out` is used, in this order; or that the file is not regular."""

    regular: bool
    width: int
    positions: int
    uv: int
    normals: int
    hard: int
    triples: int
    corners: int
    counts: int
    rest: int


def scan(content: bytes) -> Scanned | None:
    """A regular file; None for any other."""
    if b"\\" in content:
        return None
    data, out = _arrays(content)
    ends = _scan(data, POWERS, out)
    if not ends.regular:
        return None
    tables = [out.positions[: ends.positions], out.uv[: ends.uv], out.normals[: ends.normals]]
    for kind, place, begin, end in out.hard[: ends.hard].tolist():
        tables[kind][place] = float(content[begin:end])
    if not all(np.isfinite(table).all() for table in tables):
        return None
    positions = tables[V].reshape(-1, max(3, ends.width))
    colours = positions[:, 3:] if ends.width == 6 else None
    if colours is not None and not ((colours >= 0.0) & (colours <= 1.0)).all():
        return None
    return Scanned(
        positions[:, :3],
        colours,
        tables[VT].reshape(-1, 2),
        tables[VN].reshape(-1, 3),
        out.triples[: ends.triples],
        out.corners[: ends.corners],
        out.counts[: ends.counts],
        [content[begin:end] for begin, end in out.rest[: ends.rest].tolist()],
    )


def scan_call() -> Call:
    """The compiled scanner, to be compiled ahead of time."""
    data, out = _arrays(b"")
    return _scan, signature_of(data, POWERS, out)


def _arrays(content: bytes) -> tuple[Bytes, _Out]:
    """A file as bytes that end with a line feed, and the arrays for what is in it."""
    data = np.frombuffer(content if content.endswith(b"\n") else content + b"\n", np.uint8)
    # Upper bounds: memory that is not written to takes no space.
    lines = content.count(b"\n") + 1
    words = content.count(b" ") + content.count(b"\t") + lines
    out = _Out(
        positions=np.empty(words),
        uv=np.empty(words),
        normals=np.empty(words),
        hard=np.empty((words, 4), np.int64),
        triples=np.empty((words, 3), np.int64),
        first=np.empty(words, np.int64),
        following=np.empty(words, np.int64),
        corners=np.empty(words, np.int64),
        counts=np.empty(lines, np.int64),
        rest=np.empty((lines, 2), np.int64),
    )
    return data, out


@kernel
def _end_of_line(data: Bytes, at: int) -> int:
    """The line feed that ends a line, or the carriage return before it; NONE if there is more."""
    at = skip_blanks(data, at)
    if data[at] == 13 and data[at + 1] == 10:
        at += 1
    return at if data[at] == 10 else NONE


@kernel
def _numbers(
    data: Bytes,
    at: int,
    powers: FloatArray,
    kind: int,
    table: FloatArray,
    place: int,
    out: _Out,
    count: int,
) -> tuple[int, int, int]:
    """Read the numbers of a line into a table.  Returns how many, the end of the line or NONE, and
    how many rows `out.hard` has now."""
    n = 0
    while True:
        at = skip_blanks(data, at)
        end = _end_of_line(data, at)
        if end != NONE or n == 6:
            return n, end, count
        found = decimal(data, at, powers)
        if found.at == NONE:
            return n, NONE, count
        table[place + n] = found.value
        if not found.exact:
            out.hard[count, 0], out.hard[count, 1] = kind, place + n
            out.hard[count, 2], out.hard[count, 3] = at, found.at
            count += 1
        at = found.at
        n += 1


@kernel
def _index(data: Bytes, at: int, known: int) -> tuple[int, int]:
    """An index from 0 of one of `known` lines, and the byte behind it; NONE for none."""
    negative = data[at] == 45
    if negative:
        at += 1
    if not is_digit(data[at]):
        return NONE, NONE
    value = 0
    while is_digit(data[at]):
        value = min(10 * value + int(data[at]) - 48, 1 << 40)
        at += 1
    if value == 0 or value > known:
        return NONE, NONE
    return (known - value if negative else value - 1), at


@kernel
def _corner(
    data: Bytes, at: int, v_lines: int, vt_lines: int, vn_lines: int
) -> tuple[int, int, int, int]:
    """A corner's indices, NONE for none, and the byte behind it, NONE if it is no corner."""
    v, at = _index(data, at, v_lines)
    vt = vn = NONE
    if at != NONE and data[at] == 47:
        at += 1
        if data[at] != 47:
            vt, at = _index(data, at, vt_lines)
        if at != NONE and data[at] == 47:
            vn, at = _index(data, at + 1, vn_lines)
    if at != NONE and not ends_word(data[at]):
        at = NONE
    return v, vt, vn, at


@kernel
def _vertex(out: _Out, count: int, v: int, vt: int, vn: int) -> int:
    """The vertex of a corner, `count` if it is a new one; NONE if its position has too many."""
    k, length = out.first[v], 0
    while k != NONE:
        if out.triples[k, VT] == vt and out.triples[k, VN] == vn:
            return int(k)
        k, length = out.following[k], length + 1
        if length > LONGEST:
            return NONE
    out.triples[count, V], out.triples[count, VT], out.triples[count, VN] = v, vt, vn
    out.following[count] = out.first[v]
    out.first[v] = count
    return count


@kernel
def _kind(data: Bytes, at: int) -> int:
    """The kind of the line whose first word begins here."""
    if data[at] == 102 and ends_word(data[at + 1]):
        return FACE
    if data[at] == 118:
        if ends_word(data[at + 1]):
            return V
        if data[at + 1] == 116 and ends_word(data[at + 2]):
            return VT
        if data[at + 1] == 110 and ends_word(data[at + 2]):
            return VN
    return OTHER


@entry_kernel
def _scan(data: Bytes, powers: FloatArray, out: _Out) -> _Ends:
    """Read a file that ends with a line feed."""
    regular, width = True, 0
    positions, uv, normals, hard = 0, 0, 0, 0
    triples, corners, counts, rest = 0, 0, 0, 0
    v_lines = 0
    at = 0
    while at < len(data) and regular:
        at = skip_blanks(data, at)
        kind = _kind(data, at)
        end = at
        if kind == V:
            n, end, hard = _numbers(data, at + 1, powers, V, out.positions, positions, out, hard)
            regular = n == 3 or n == 6
            regular = regular and (width == 0 or width == n)
            width = n
            positions += n
            out.first[v_lines] = NONE
            v_lines += 1
        elif kind == VT:
            n, end, hard = _numbers(data, at + 2, powers, VT, out.uv, uv, out, hard)
            regular = n == 2 or (n == 3 and out.uv[uv + 2] == 0.0)
            uv += 2
        elif kind == VN:
            n, end, hard = _numbers(data, at + 2, powers, VN, out.normals, normals, out, hard)
            regular = n == 3
            normals += 3
        elif kind == FACE:
            end = _end_of_line(data, at + 1)
            at += 1
            n = 0
            while end == NONE and regular:
                v, vt, vn, at = _corner(data, skip_blanks(data, at), v_lines, uv // 2, normals // 3)
                vertex = NONE if at == NONE else _vertex(out, triples, v, vt, vn)
                regular = vertex != NONE
                if regular:
                    if vertex == triples:
                        triples += 1
                    out.corners[corners] = vertex
                    corners += 1
                    n += 1
                    end = _end_of_line(data, at)
            out.counts[counts] = n
            counts += 1
            regular = regular and n >= 3
        else:
            while data[end] != 10 and regular:
                # A carriage return ends a line by itself; Python takes 11 and 12 for blanks.
                regular = not (data[end] == 13 and data[end + 1] != 10)
                regular = regular and data[end] != 11 and data[end] != 12
                end += 1
            if end > at:
                out.rest[rest, 0], out.rest[rest, 1] = at, end
                rest += 1
        regular = regular and end != NONE
        at = end + 1
    return _Ends(regular, width, positions, uv, normals, hard, triples, corners, counts, rest)
