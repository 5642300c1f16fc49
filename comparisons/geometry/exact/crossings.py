"""`Crossings`, the result of every shape's function, and helpers that these share."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact.dyadic import NEVER, BoolArray, Dyadic, Fixed, apply

IntArray = npt.NDArray[np.int64]

Row = Mapping[str, Any]
"""Columns of a table: arrays of one row, or of as many as there are rays."""


class Crossings(NamedTuple):
    """Where n lines cross a surface, over all t, in order.

    t (n, k): NEVER beyond a line's last crossing;  enters (n, k): whether from the front, or from
    outside;  code (n, k): the number of the face;  touching (n,): whether a line passes exactly
    through an edge, touches the surface without crossing it, or lies in it: its hits are then a
    matter of convention.
    """

    t: Fixed
    enters: BoolArray
    code: IntArray
    touching: BoolArray


def ordered(
    t: list[Fixed], enters: list[BoolArray], code: list[Any], touching: BoolArray
) -> Crossings:
    """Crossings from columns in any order."""
    times = np.stack([np.asarray(x, dtype=object) for x in t], axis=1)
    n = len(times)
    sides = np.stack([np.broadcast_to(x, n) for x in enters], axis=1)
    codes = np.stack([np.broadcast_to(np.asarray(x, np.int64), n) for x in code], axis=1)
    order = np.argsort(times, axis=1, kind="stable")
    times, sides, codes = (np.take_along_axis(x, order, axis=1) for x in (times, sides, codes))
    return Crossings(times, sides, codes, np.asarray(touching, bool))


def where(hit: BoolArray, t: Fixed) -> Fixed:
    """t where it is a hit, else NEVER."""
    return np.asarray(np.where(hit, t, NEVER), dtype=object)


def column(row: Row, name: str) -> Dyadic:
    """A column of a table, exactly."""
    return Dyadic.of(row[name])


def in_local(row: Row, o: Dyadic, d: Dyadic) -> tuple[Dyadic, Dyadic]:
    """The rays in a placed shape's local coordinates: M (o - center) and M d."""
    m = column(row, "to_local")
    return apply(m, o - column(row, "center")), apply(m, d)
