"""Regular .obj files, as programs write them, parsed as arrays: five times as fast as line by line.

Regular is a file whose lines of a kind all have the same form: positions of three numbers, texture
coordinates of two, normals of three, corners of one form with positive indices, no continued lines,
no colours.  Whatever is not, `obj` reads line by line, which also finds the errors and their lines.
"""

import warnings
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray

IS_SPACE = np.isin(np.arange(256), (9, 10, 13, 32))
"""By byte: tab, line feed, carriage return, space."""

Bytes = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.bool_]


class Regular(NamedTuple):
    """positions (n, 3), uv (k, 2) and normals (l, 3) as the file has them, k and l possibly 0;
    corners (m, 3): indices from 0 into these, -1 for none;  counts: corners of each face;  rest:
    the other lines, in order."""

    positions: FloatArray
    uv: FloatArray
    normals: FloatArray
    corners: IntArray
    counts: IntArray
    rest: list[bytes]


class _Lines(NamedTuple):
    """The bytes of a file; first, last: where each line begins and ends; kind: its first word as
    one of "v", "t" (vt), "n" (vn), "f", or "?"; words: how many it has."""

    data: Bytes
    first: IntArray
    last: IntArray
    kind: npt.NDArray[np.uint8]
    words: IntArray


def parse(content: bytes) -> Regular | None:
    """A regular file; None for any other."""
    if any(byte in content for byte in (b"\\", b"\x0b", b"\x0c")):
        return None
    lines = _lines(content)
    if lines is None:
        return None
    found = {}
    for kind, width, skipped in ((b"v", 3, 1), (b"t", 2, 2), (b"n", 3, 2)):
        table = _numbers(lines, kind, width, skipped)
        if table is None:
            return None
        found[kind] = table
    faces = _faces(lines, found)
    if faces is None:
        return None
    rest = [
        content[lines.first[k] : lines.last[k]]
        for k in np.flatnonzero(lines.kind == ord("?")).tolist()
    ]
    if any(line.split()[:1] in ([b"v"], [b"vt"], [b"vn"], [b"f"]) for line in rest):
        return None
    return Regular(
        found[b"v"],
        found[b"t"],
        found[b"n"],
        *faces,
        rest,
    )


def _lines(content: bytes) -> _Lines | None:
    """The lines; None where a carriage return ends one by itself."""
    data = np.frombuffer(content if content.endswith(b"\n") else content + b"\n", np.uint8)
    ends = np.flatnonzero(data == 10)
    returns = data == 13
    if returns.any() and not (data[np.flatnonzero(returns) + 1] == 10).all():
        return None
    first = np.concatenate([[0], ends[:-1] + 1])
    spaces = IS_SPACE[data]
    starts = ~spaces
    starts[1:] &= spaces[:-1]
    words = np.add.reduceat(starts, first, dtype=np.int32)
    one, two, three = (data[np.minimum(first + k, ends)] for k in range(3))
    ends_two, ends_three = np.isin(two, (9, 32)), np.isin(three, (9, 32))
    kind = np.full(len(first), ord("?"), np.uint8)
    kind[(one == ord("v")) & ends_two] = ord("v")
    kind[(one == ord("f")) & ends_two] = ord("f")
    for second in b"tn":
        kind[(one == ord("v")) & (two == second) & ends_three] = second
    # A line that begins with spaces may be anything.
    if (np.isin(one, (9, 32)) & (first < ends)).any():
        return None
    return _Lines(data, first, ends, kind, words)


def _text(lines: _Lines, kind: int, skipped: int) -> Bytes:
    """The bytes of all lines of a kind, their first ones as spaces."""
    lengths = np.diff(lines.first, append=len(lines.data))
    text: Bytes = lines.data[np.repeat(lines.kind == kind, lengths)]
    mine = lengths[lines.kind == kind]
    first = np.cumsum(mine) - mine
    for k in range(skipped):
        text[first + k] = ord(" ")
    return text


def _values(text: Bytes, dtype: Any, count: int) -> npt.NDArray[Any] | None:
    """The numbers of a text of so many."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            found: npt.NDArray[Any] = np.fromstring(text.tobytes(), dtype, sep=" ")
        except (DeprecationWarning, ValueError, OverflowError):  # a word that is no number
            return None
    return found if len(found) == count else None


def _numbers(lines: _Lines, kind: bytes, width: int, skipped: int) -> FloatArray | None:
    """(n, width): the numbers of all lines of a kind."""
    words = lines.words[lines.kind == kind[0]]
    if len(words) == 0:
        return np.zeros((0, width))
    if not (words == width + 1).all():
        return None
    values = _values(_text(lines, kind[0], skipped), np.float64, width * len(words))
    if values is None or not np.isfinite(values).all():
        return None
    return np.asarray(values.reshape(-1, width), np.float64)


def _faces(lines: _Lines, tables: dict[bytes, FloatArray]) -> tuple[IntArray, IntArray] | None:
    """The corners of all faces, and how many each has."""
    chosen = np.flatnonzero(lines.kind == ord("f"))
    counts = lines.words[chosen].astype(np.int64) - 1
    if len(chosen) == 0 or counts.min() < 3:
        return None
    text = _text(lines, ord("f"), 1)
    slashes = text == ord("/")
    digits = (text >= ord("0")) & (text <= ord("9"))
    spaces = IS_SPACE[text]
    if not (digits | slashes | spaces).all():
        return None
    starts = ~spaces
    starts[1:] &= spaces[:-1]
    total = int(counts.sum())
    per_word = np.add.reduceat(slashes, np.flatnonzero(starts), dtype=np.int32)
    form = int(per_word[0])
    if form > 2 or not (per_word == form).all():
        return None
    doubled = int(np.count_nonzero(slashes[1:] & slashes[:-1]))
    kinds = {0: b"v", 1: b"vt", 2: b"vtn"}[form]
    if doubled:
        if form != 2 or doubled != total:
            return None
        kinds = b"vn"
    # Every part of a word has digits.
    alone = slashes & ~np.concatenate([[False], digits[:-1] | slashes[:-1]])
    ends = slashes & ~np.concatenate([digits[1:] | slashes[1:], [False]])
    if alone.any() or ends.any():
        return None
    plain = np.where(slashes, np.uint8(32), text)
    values = _values(plain, np.int64, total * len(kinds))
    if values is None:
        return None
    indices = values.reshape(-1, len(kinds))
    corners = np.full((total, 3), -1)
    face = np.repeat(np.arange(len(chosen)), counts)
    for column, kind in enumerate(kinds):
        known = np.cumsum(lines.kind == kind)[chosen][face]  # lines of this kind before the face
        if (indices[:, column] < 1).any() or (indices[:, column] > known).any():
            return None
        corners[:, b"vtn".index(kind)] = indices[:, column] - 1
    return corners, counts


def numbered(corners: IntArray) -> tuple[IntArray, IntArray]:
    """Corners (m, 3) as vertices: which corners are the first of each, in order; and the vertex of
    each corner (m,)."""
    sizes = corners.max(axis=0) + 2
    if float(np.prod(sizes.astype(np.float64))) < 2.0**62:
        keys = corners[:, 0]
        for column in (1, 2):
            keys = keys * sizes[column] + corners[:, column] + 1
        _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    else:
        _, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse.ravel()]
