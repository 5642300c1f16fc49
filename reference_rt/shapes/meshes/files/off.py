"""Object files, .off (Geomview): polygons in ascii.  Of COFF, NOFF and STOFF files only the
positions are read; colours, normals and texture coordinates are ignored, and named."""

import re
from array import array
from collections.abc import Iterator
from itertools import islice

import numpy as np

from reference_rt.shapes.meshes.files.data import RawMesh
from reference_rt.shapes.meshes.files.polygons import doubt, triangulated


def read(content: bytes) -> RawMesh:
    lines = _lines(content)
    number, words = next(lines, (1, [b""]))
    # Not 4OFF and nOFF, whose coordinates are not x y z.
    if not re.fullmatch(rb"(ST)?C?N?OFF", words[0]):
        raise ValueError("expected 'OFF' as its first word")
    kind = _kind(words[0])
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
