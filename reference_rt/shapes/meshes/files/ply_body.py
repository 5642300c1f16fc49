"""The numbers after the header of a .ply file, as arrays.

An ascii body is converted to a binary one of float64, so that the same functions read both.  Memory
is allocated only after a check that the file is long enough.
"""

import struct
from array import array
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes.meshes.files.polygons import ramps

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
