"""What the exact crossings of shapes are made of: of planes, and of slabs between planes.

`Crossings` is the result for every shape; their functions stand in `comparisons/shapes`.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact.dyadic import (
    NEVER,
    BoolArray,
    Dyadic,
    Fixed,
    apply,
    dot,
    quotient,
    tied,
)

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


class PlaneCrossing(NamedTuple):
    """Where lines cross a plane.

    t;  meets: whether they cross it;  enters: from the front;  x, y: plane coordinates times den >
    0, as quotients would not be exact;  in_plane: whether a line lies in the plane.
    """

    t: Fixed
    meets: BoolArray
    enters: BoolArray
    x: Dyadic
    y: Dyadic
    den: Dyadic
    in_plane: BoolArray


def plane_crossing(row: Row, o: Dyadic, d: Dyadic) -> PlaneCrossing:
    """The crossings with the plane of a row's center and normal; x and y by its covectors."""
    n, from_center = column(row, "normal"), o - column(row, "center")
    num, den = -dot(from_center, n), dot(d, n)
    enters = den.sign() < 0
    t, meets, in_plane = quotient(num, den), den.sign() != 0, (den.sign() == 0) & (num.sign() == 0)
    num, den = (-num).where(enters, num), (-den).where(enters, den)
    coordinates = [
        dot(from_center, column(row, name)) * den + dot(d, column(row, name)) * num
        for name in ("x_of", "y_of")
    ]
    return PlaneCrossing(t, meets, enters, coordinates[0], coordinates[1], den, in_plane)


def single(m: PlaneCrossing, inside: BoolArray, edge: BoolArray) -> Crossings:
    return ordered([where(m.meets & inside, m.t)], [m.enters], [0], (m.meets & edge) | m.in_plane)


class Slabs:
    """The intervals of lines between three pairs of axis-aligned planes.

    t_in, code_in: entry and its face;  t_out, code_out: exit;  misses: the interval is empty;
    touching: the line passes through an edge, or lies in a face.
    """

    def __init__(self, q: Dyadic, e: Dyadic, lower: Dyadic, upper: Dyadic, clipped: Any) -> None:
        n = len(q.n)
        self.t_in, self.t_out = (np.full(n, x, dtype=object) for x in (-NEVER, NEVER))
        self.code_in, self.code_out = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self.misses, self.touching = np.zeros(n, bool), np.zeros(n, bool)
        for k in range(3):
            clips = np.broadcast_to(np.asarray(clipped)[..., k], n).astype(bool)
            self._clip(k, clips, q[..., k], e[..., k], lower[..., k], upper[..., k])
        self.touching |= ~self.misses & tied(self.t_in, self.t_out)
        self.misses |= self.t_in > self.t_out

    def _clip(
        self, k: int, clips: BoolArray, q: Dyadic, e: Dyadic, low: Dyadic, high: Dyadic
    ) -> None:
        still = e.sign() == 0
        below, above = (low - q).sign(), (high - q).sign()
        self.misses |= clips & still & ((below > 0) | (above < 0))
        self.touching |= clips & still & ((below == 0) | (above == 0))
        moves = clips & ~still
        up = e.sign() > 0
        at_low, at_high = quotient(low - q, e), quotient(high - q, e)
        enter, leave = np.where(up, at_low, at_high), np.where(up, at_high, at_low)
        later = moves & (enter > self.t_in)
        self.t_in = np.where(later, enter, self.t_in)
        self.code_in = np.where(later, np.where(up, k, k + 3), self.code_in)
        earlier = moves & (leave < self.t_out)
        self.t_out = np.where(earlier, leave, self.t_out)
        self.code_out = np.where(earlier, np.where(up, k + 3, k), self.code_out)
