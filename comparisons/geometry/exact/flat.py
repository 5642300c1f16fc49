"""Exact crossings of flat shapes: rectangles, disks, planes, polygons, triangles."""

from typing import NamedTuple

import numpy as np

from comparisons.geometry.exact.crossings import Crossings, Row, column, ordered, where
from comparisons.geometry.exact.dyadic import BoolArray, Dyadic, Fixed, cross, dot, quotient


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


def _single(m: PlaneCrossing, inside: BoolArray, edge: BoolArray) -> Crossings:
    return ordered([where(m.meets & inside, m.t)], [m.enters], [0], (m.meets & edge) | m.in_plane)


def rectangles(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    m = plane_crossing(row, o, d)
    sides = [(m.den - m.x), (m.den + m.x), (m.den - m.y), (m.den + m.y)]
    least = np.min([side.sign() for side in sides], axis=0)
    return _single(m, least >= 0, least == 0)


def disks(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    m = plane_crossing(row, o, d)
    sign = (m.den * m.den - m.x * m.x - m.y * m.y).sign()
    return _single(m, sign >= 0, sign == 0)


def planes(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """An infinite plane; as a solid, the half-space below it."""
    m = plane_crossing(row, o, d)
    everywhere = np.ones(len(m.meets), bool)
    return _single(m, everywhere, ~everywhere)


def polygons(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """One polygon: inside where its winding number has a bit of `mask` (the fill rule)."""
    m = plane_crossing(row, o, d)
    winding = np.zeros(len(m.meets), np.int64)
    edge = np.zeros(len(m.meets), bool)
    first, size = int(row["first"][0]), int(row["size"][0])
    for ends in np.asarray(row["outline"])[first : first + size]:
        a_x, a_y, b_x, b_y = (Dyadic.of(value) * m.den for value in ends)
        a_x, a_y, b_x, b_y = a_x - m.x, a_y - m.y, b_x - m.x, b_y - m.y
        side = (a_x * b_y - a_y * b_x).sign()
        up, down = (a_y.sign() <= 0) & (b_y.sign() > 0), (b_y.sign() <= 0) & (a_y.sign() > 0)
        winding += np.where(up & (side > 0), 1, 0) - np.where(down & (side < 0), 1, 0)
        between = (a_x * b_x + a_y * b_y).sign() <= 0
        edge |= (side == 0) & between
    return _single(m, (winding & int(row["mask"][0])) != 0, edge)


def triangles(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """Triangles; edges and corners count as inside, and as touching."""
    v = column(row, "vertices")
    corners = [v[..., 3 * k : 3 * k + 3] - o for k in range(3)]
    n = cross(corners[1] - corners[0], corners[2] - corners[0])
    num, den = dot(corners[0], n), dot(d, n)
    signs = np.array([dot(d, cross(corners[k], corners[(k + 1) % 3])).sign() for k in range(3)])
    meets = den.sign() != 0
    inside = (signs >= 0).all(axis=0) | (signs <= 0).all(axis=0)
    edge = inside & (signs == 0).any(axis=0)
    in_plane = ~meets & (num.sign() == 0)
    code = np.broadcast_to(row.get("face", 0), inside.shape)
    t = where(meets & inside, quotient(num, den))
    return ordered([t], [den.sign() < 0], [code], (meets & edge) | in_plane)
