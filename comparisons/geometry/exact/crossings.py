"""Exact crossings of each shape: rectangles, disks, planes, polygons, triangles; spheres, boxes,
quadrics, tori.  `Crossings` is the result of every shape's function.
"""

import itertools
from collections.abc import Mapping
from typing import Any, NamedTuple

import flint
import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact.dyadic import (
    CERTAIN,
    FRACTION,
    NEVER,
    BoolArray,
    Dyadic,
    Fixed,
    Integers,
    apply,
    cross,
    dot,
    quotient,
    roots,
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


def spheres(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    f, r = o - column(row, "center"), column(row, "radius")
    sign, near, far = roots(dot(d, d), dot(f, d), dot(f, f) - r * r)
    t = [where(sign >= 0, near), where(sign >= 0, far)]
    return ordered(t, [np.array(True), np.array(False)], [0, 0], sign == 0)


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


def boxes(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """Codes: the axis, + 3 on the positive side."""
    q, e = in_local(row, o, d)
    one = Dyadic.of(np.ones((1, 3)))
    s = Slabs(q, e, -one, one, np.ones(3))
    t = [where(~s.misses, s.t_in), where(~s.misses, s.t_out)]
    return ordered(t, [np.array(True), np.array(False)], [s.code_in, s.code_out], s.touching)


def quadrics(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """Codes: 0 for f's surface, else 1 + the face of the clip box.

    An uncapped quadric is entered from the side f > 0.
    """
    q, e = in_local(row, o, d)
    k = column(row, "coefficients")
    a, b, c = _along(k, q, e)
    sign, near, far = roots(a, b, c)
    s = Slabs(q, e, column(row, "lower"), column(row, "upper"), row["clipped"])
    capped = np.broadcast_to(np.asarray(row["capped"]) != 0, len(q.n))
    between = a.sign() >= 0  # f <= 0 between the roots, else outside of them
    real, never = sign >= 0, np.full(len(q.n), NEVER, dtype=object)
    touching = s.touching | (~s.misses & (sign == 0))
    for t in (near, far):
        touching |= real & ~s.misses & (tied(t, s.t_in) | tied(t, s.t_out))
    # Where f <= 0, as two intervals; without roots the whole line or nothing.
    constant_in = ~real & (c.sign() <= 0)
    start = [
        np.where(real & between, near, np.where((real & ~between) | constant_in, -never, never)),
        np.where(real & ~between, far, never),
    ]
    end = [
        np.where(real & between, far, np.where(real & ~between, near, never)),
        np.where(real & ~between, never, never),
    ]
    times, enters, codes = [], [], []
    for low, high in zip(start, end, strict=True):
        inside_low, inside_high = np.maximum(low, s.t_in), np.minimum(high, s.t_out)
        some = ~s.misses & (inside_low < inside_high)
        for t, on_f, cap, way in (
            (inside_low, low >= s.t_in, s.code_in, True),
            (inside_high, high <= s.t_out, s.code_out, False),
        ):
            shown = some & (on_f | capped) & (abs(t) < NEVER)
            times.append(where(shown, t))
            enters.append(np.array(way))
            codes.append(np.where(on_f, 0, 1 + cap))
    return ordered(times, enters, codes, touching)


def _along(k: Dyadic, q: Dyadic, e: Dyadic) -> tuple[Dyadic, Dyadic, Dyadic]:
    """f(q + t e) = a t² + 2 b t + c; f's coefficients in the order x² y² z² xy yz xz x y z 1."""
    pairs = list(itertools.chain(((i, i) for i in range(3)), ((0, 1), (1, 2), (0, 2))))

    def quadratic(u: Dyadic, v: Dyadic) -> Dyadic:
        terms = [k[..., n] * u[..., i] * v[..., j] for n, (i, j) in enumerate(pairs)]
        return _total(terms)

    def linear(u: Dyadic) -> Dyadic:
        return _total([k[..., 6 + i] * u[..., i] for i in range(3)])

    half = Dyadic.of(0.5)
    b = half * (quadratic(q, e) + quadratic(e, q) + linear(e))
    return quadratic(e, e), b, quadratic(q, q) + linear(q) + k[..., 9]


def _total(terms: list[Dyadic]) -> Dyadic:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def torus_quartic(row: Row, o: Dyadic, d: Dyadic) -> Integers:
    """The coefficients (n, 5), up to a factor and with the constant term first, of
    (|p|² + R² - r²)² - 4 R² (x² + y²) along the rays."""
    q, e = in_local(row, o, d)
    major, minor = column(row, "major"), column(row, "minor")
    alpha, beta = dot(e, e), Dyadic.of(2.0) * dot(q, e)
    gamma = dot(q, q) + major * major - minor * minor
    four = Dyadic.of(4.0) * major * major
    flat_q, flat_e = q[..., :2], e[..., :2]
    ring = [
        dot(flat_q, flat_q) * four,
        Dyadic.of(2.0) * dot(flat_q, flat_e) * four,
        dot(flat_e, flat_e) * four,
    ]
    coefficients = [
        gamma * gamma - ring[0],
        Dyadic.of(2.0) * beta * gamma - ring[1],
        beta * beta + Dyadic.of(2.0) * alpha * gamma - ring[2],
        Dyadic.of(2.0) * alpha * beta,
        alpha * alpha,
    ]
    exponent = min(c.e for c in coefficients)
    return np.stack([np.broadcast_to(c.to(exponent).n, len(q.n)) for c in coefficients], axis=1)


def tori(row: Row, o: Dyadic, d: Dyadic) -> Crossings:
    """Roots of the quartic, isolated and certified by FLINT (fmpz_poly_complex_roots)."""
    q, e = in_local(row, o, d)
    integers = torus_quartic(row, o, d)
    # Rays that miss the bounding sphere miss the torus.
    size = column(row, "major") + column(row, "minor")
    ball, _, _ = roots(dot(e, e), dot(q, e), dot(q, q) - size * size)
    t = np.full((len(q.n), 4), NEVER, dtype=object)
    touching = np.zeros(len(q.n), bool)
    for i in np.flatnonzero(ball > 0).tolist():
        found = _real_roots(integers[i].tolist())
        simple = [t for t, times in found if times % 2 == 1]
        touching[i] = any(times > 1 for _, times in found)
        t[i, : len(simple)] = sorted(simple)
    ways = [np.array(k % 2 == 0) for k in range(4)]
    return ordered([t[:, k] for k in range(4)], ways, [0] * 4, touching)


def _real_roots(coefficients: list[int]) -> list[tuple[int, int]]:
    """(t as fixed-point number, multiplicity) of the real roots;  coefficients: the constant term
    first."""
    precision = flint.ctx.prec
    flint.ctx.prec = CERTAIN + 32
    try:
        found = flint.fmpz_poly(coefficients).complex_roots()
        real = [(z.real, times) for z, times in found if z.imag == 0]
        one = flint.arb(2) ** FRACTION
        return [(int((x * one).mid().floor().unique_fmpz()), times) for x, times in real]
    finally:
        flint.ctx.prec = precision
