"""Quadric: a surface of second degree, clipped to a box; the table of all such surfaces.

Cylinders, cones and ellipsoids are rows of it too.  A row's own coordinates are those of
`quadratic_form.fit`.
"""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Literal, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from reference_rt.description import Vector
from reference_rt.kernel import kernel
from reference_rt.ray import Crossing, Hit, Ray, SurfacePoint, at, miss
from reference_rt.shapes import placement
from reference_rt.shapes.box import face_entered, face_left, face_normal, inside, on_face
from reference_rt.shapes.placement import (
    columns,
    local_point,
    local_ray,
    local_vector,
    world_covector,
    world_surface,
)
from reference_rt.shapes.quadratic import gradient, noise, roots, short, slabs, value
from reference_rt.shapes.quadratic_form import (
    Coefficients,
    Form,
    Point,
    definite_sign,
    fit,
    seen_from,
)
from reference_rt.shapes.shape import (
    Bounds,
    FloatArray,
    IntArray,
    Place,
    Shape,
    Spans,
    no_spans,
    one_span,
)
from reference_rt.transform import Affine
from reference_rt.vec3 import Vec3, dot, length, max_abs, normalize, row


class Quadric(Shape):
    """The surface f = 0 inside a box, f(x, y, z) = A x² + B y² + C z² + D xy + E yz + F xz + G x +
    H y + I z + J; its normal is the gradient of f, so that its front is where f > 0.

    Planes (A to F zero) and pairs of planes are quadrics like any other; but along one plane of a
    pair f vanishes, so that where a ray there meets the other is hard to tell.  An f that does not
    change its sign (a constant; a sum of squares, which vanishes at a point or on a line at most; a
    square, which a plane touches) bounds nothing: an error, but capped, where it means the whole
    box if f <= 0 everywhere, and else nothing.
    """

    type: Literal["quadric"] = "quadric"
    coefficients: Coefficients
    """[A, B, C, D, E, F, G, H, I, J]."""
    lower: Vector
    """The corner of the clip box with the smallest coordinates, in the shape's own."""
    upper: Vector
    """The opposite corner."""
    capped: bool = False
    """Whether this is the solid f <= 0 in the box, closed by the box's faces; else it is the
    surface alone."""

    @model_validator(mode="after")
    def _has_a_box(self) -> Self:
        if not all(a < b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ValueError("expected each coordinate of 'lower' to be below that of 'upper'")
        return self

    def tabulate(self, place: Place) -> "Quadrics":
        form = tuple(Fraction(x) for x in self.coefficients)
        sign = definite_sign(form)
        if sign != 0:
            if not self.capped:
                raise ValueError(
                    "f does not change its sign, so that there is no surface; expected "
                    "coefficients for which f takes both"
                )
            form = (*[Fraction(0)] * 9, Fraction(sign))
        clipped = (True, True, True)
        m = self.map_in(place)
        return tabulate(place, m, form, self.lower, self.upper, clipped, self.capped)


class Quadrics(NamedTuple):
    """n quadrics: center (n, 3), rows of the inverse map (n, 9), columns of the map (n, 9), f's
    coefficients (n, 10), the box's corners lower and upper (n, 3), for each axis 1 where the box
    clips and 0 where f itself ends within it (n, 3), capped (n,): 1 for solids; owner, the shape's
    index in the scene; material, light: rows of those tables; face (n,)."""

    center: FloatArray
    to_local: FloatArray
    edges: FloatArray
    coefficients: FloatArray
    lower: FloatArray
    upper: FloatArray
    clipped: IntArray
    capped: IntArray
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


_LARGEST = 1e140
"""Of the entries of a map and of its inverse: squares of ten times these are finite."""


def tabulate(
    place: Place,
    m: Affine,
    form: Form,
    lower: Point,
    upper: Point,
    clipped: Sequence[bool],
    capped: bool,
) -> Quadrics:
    """One row; `m` maps the coordinates of the form and the box to the place's.

    The box must contain the whole surface along the axes that it does not clip.
    """
    try:
        fitted = fit(form, lower, upper)
    except OverflowError:
        raise ValueError("its size overflows; expected finite numbers") from None
    # Exactly: an origin far away and a map that brings it back do not cancel.
    offset = [
        float(
            sum((Fraction(a) * Fraction(o) for a, o in zip(r[:3], fitted.origin, strict=True)), r3)
        )
        for r, r3 in zip(m, map(Fraction, m[:, 3]), strict=True)
    ]
    table = Quadrics(
        **columns(np.column_stack([m[:, :3] * fitted.unit, offset]), place),
        coefficients=np.array([fitted.form]),
        lower=np.array([fitted.lower]),
        upper=np.array([fitted.upper]),
        clipped=np.array([clipped], np.int64),
        capped=np.array([capped], np.int64),
    )
    if max(np.abs(table.edges).max(), np.abs(table.to_local).max()) > _LARGEST:
        raise ValueError(
            f"its size overflows; expected a scale from {1 / _LARGEST:.0e} to {_LARGEST:.0e}"
        )
    return table


def ellipsoid(place: Place, m: Affine, middle: Vector, radius: float) -> Quadrics:
    """The sphere around `middle`, where m takes it."""
    unit_sphere = tuple(Fraction(k) for k in (1, 1, 1, 0, 0, 0, 0, 0, 0))
    form = seen_from((*unit_sphere, -(Fraction(radius) ** 2)), [-Fraction(x) for x in middle])
    lower = [Fraction(x) - Fraction(radius) for x in middle]
    upper = [Fraction(x) + Fraction(radius) for x in middle]
    return tabulate(place, m, form, lower, upper, (False, False, False), True)


def bounds(quadrics: Quadrics) -> Bounds:
    """Boxes along the axes (n, 3), (n, 3) around the clip boxes, rounded outwards."""
    return placement.bounds(quadrics.center, quadrics.edges, quadrics.lower, quadrics.upper)


def is_solid(quadrics: Quadrics) -> bool:
    return bool(np.all(quadrics.capped != 0))


@kernel
def _nearby(quadrics: Quadrics, i: int, ray: Ray) -> tuple[Ray, float, float]:
    """(the ray in local coordinates, shift, unit): the world's t is (t + shift) unit.

    A ray from afar begins next to the local origin: the coefficients of f along it then round as
    numbers of the shape's size.  One that begins within the box must not be moved: see `roots`.
    Directions whose powers would overflow or vanish are made 1 long.
    """
    local = local_ray(quadrics, i, ray)
    size = max_abs(local.d)
    unit = 1.0
    if size > 0.0 and not 2.0**-200 < size < 2.0**200:
        unit = 1.0 / size
    d = local.d * unit
    if max_abs(local.o) <= 2.0:
        return Ray(local.o, d, local.t_max), 0.0, unit
    shift = short(-dot(local.o, d) / dot(d, d), 0.0625, d)
    return Ray(local.o + d * shift, d, local.t_max), shift, unit


class Line(NamedTuple):
    """A line's roots, where it enters and leaves the clip box, and the codes of the caps there."""

    t0: float
    t1: float
    between: bool
    t_in: float
    t_out: float
    cap_in: float
    cap_out: float


@kernel
def _line(quadrics: Quadrics, i: int, ray: Ray) -> Line:
    near, shift, unit = _nearby(quadrics, i, ray)
    r = roots(quadrics.coefficients[i], near)
    s = slabs(quadrics.lower[i], quadrics.upper[i], quadrics.clipped[i], near)
    t_in, t_out = inside(s)
    return Line(
        (r.t0 + shift) * unit,
        (r.t1 + shift) * unit,
        r.between,
        (t_in + shift) * unit,
        (t_out + shift) * unit,
        1.0 + face_entered(s, t_in),
        1.0 + face_left(s, t_out),
    )


@kernel
def spans(quadrics: Quadrics, i: int, ray: Ray) -> Spans:
    """Where the line runs in the solid: f <= 0 within the box.  An end's u is 0 on f's surface, and
    1 + the box's face (axis, + 3 on the positive side) on a cap."""
    t0, t1, between, t_in, t_out, cap_in, cap_out = _line(quadrics, i, ray)
    if not t_in <= t_out:
        return no_spans()
    if not between and t0 >= t1:
        t0, t1, between = -math.inf, math.inf, True  # f touches 0 from below
    if between:
        if t0 <= t1 and t0 <= t_out and t_in <= t1:
            u0, u1 = 0.0 if t0 >= t_in else cap_in, 0.0 if t1 <= t_out else cap_out
            return one_span(max(t_in, t0), u0, min(t1, t_out), u1)
        return no_spans()
    if t_in <= t0 and t1 <= t_out:
        return Spans(t_in, cap_in, t0, 0.0, t1, 0.0, t_out, cap_out)
    if t_in <= t0:
        return one_span(t_in, cap_in, min(t0, t_out), 0.0 if t0 <= t_out else cap_out)
    if t1 <= t_out:
        return one_span(max(t_in, t1), 0.0 if t1 >= t_in else cap_in, t_out, cap_out)
    return no_spans()


@kernel
def intersect(quadrics: Quadrics, i: int, ray: Ray) -> Crossing:
    """Where the ray meets quadric i, and as u which surface of it: see `spans`.

    A surface that is not capped includes its rim.  A line that lies in it does not meet it.
    """
    if quadrics.capped[i] != 0:
        s = spans(quadrics, i, ray)
        if s.t0 > 0.0:
            return Crossing(s.t0, s.u0, 0.0)
        if s.t1 > 0.0:
            return Crossing(s.t1, s.u1, 0.0)
        if s.t2 > 0.0:
            return Crossing(s.t2, s.u2, 0.0)
        return Crossing(s.t3 if s.t3 > 0.0 else math.inf, s.u3, 0.0)
    line = _line(quadrics, i, ray)
    if line.t0 > 0.0 and line.t_in <= line.t0 and line.t0 <= line.t_out:
        return Crossing(line.t0, 0.0, 0.0)
    if line.t1 > 0.0 and line.t_in <= line.t1 and line.t1 <= line.t_out:
        return Crossing(line.t1, 0.0, 0.0)
    return miss()


# ---- where it was met ---------------------------------------------------------------------------


@kernel
def _on_surface(quadrics: Quadrics, i: int, q: Vec3) -> Vec3:
    """q moved onto f = 0 along the world's normal, by Newton's steps while they lead closer.

    Each squares the distance, in radii of curvature: four are for a point that is off by a
    hundredth, of a ray from 1e13 sizes away.
    """
    k = quadrics.coefficients[i]
    for _ in range(4):
        f = value(k, q)
        normal = world_covector(quadrics, i, gradient(k, q))
        steepness = dot(normal, normal)
        if f == 0.0 or steepness == 0.0:
            break
        moved = q - local_vector(quadrics, i, normal) * (f / steepness)
        if not abs(value(k, moved)) < abs(f):
            break
        q = moved
    return q


@kernel
def _normal(quadrics: Quadrics, i: int, q: Vec3) -> Vec3:
    """The unit gradient; where that vanishes, as at an apex, the z axis off the box's middle."""
    g = gradient(quadrics.coefficients[i], q)
    size = max_abs(g)
    if size == 0.0:
        middle = 0.5 * (quadrics.lower[i, 2] + quadrics.upper[i, 2])
        return Vec3(0.0, 0.0, 1.0 if q.z >= middle else -1.0)
    return normalize(g * (1.0 / size))


@kernel
def surface(quadrics: Quadrics, ray: Ray, hit: Hit) -> SurfacePoint:
    i, code = hit.row, int(hit.u)
    material, light = quadrics.material[i], quadrics.light[i]
    q = local_point(quadrics, i, at(ray, hit.t))
    if code > 0:
        axis, sign = (code - 1) % 3, 1.0 if code > 3 else -1.0
        plane = quadrics.upper[i, axis] if code > 3 else quadrics.lower[i, axis]
        n = face_normal(axis, sign)
        q = on_face(q, axis, plane)
        return world_surface(quadrics, i, q, n, 0.0, material, light)
    q = _on_surface(quadrics, i, q)
    n, error = _normal(quadrics, i, q), _error(quadrics, i, q)
    return world_surface(quadrics, i, q, n, error, material, light)


@kernel
def _error(quadrics: Quadrics, i: int, q: Vec3) -> float:
    """How far q must move along the normal for f's computed sign there to be right: what f is at q,
    its noise here, and that of the next ray's origin, with one to spare for rounding.

    Next to a point where the gradient vanishes, f grows as the square of the distance from it, and
    this is the distance within which the noise hides it.
    """
    k = quadrics.coefficients[i]
    uncertain = abs(value(k, q)) + 3.0 * noise(k, q)
    if uncertain == 0.0:
        return 0.0
    bend = abs(k[0]) + abs(k[1]) + abs(k[2]) + abs(k[3]) + abs(k[4]) + abs(k[5])
    return uncertain / max(length(gradient(k, q)), math.sqrt(uncertain * bend))


@kernel
def uv(quadrics: Quadrics, ray: Ray, hit: Hit) -> tuple[float, float]:
    """In coordinates where the box is the cube [-1, 1]³: (phi / 2 pi around z from +x, z from 0 to
    1); of an ellipsoid as a sphere's; of a cap as a box's face: the two other coordinates in the
    order x, y, z, from 0 to 1."""
    i, code = hit.row, int(hit.u)
    lower, upper = row(quadrics.lower, i), row(quadrics.upper, i)
    q = local_point(quadrics, i, at(ray, hit.t))
    x = ((q.x - lower.x) - (upper.x - q.x)) / (upper.x - lower.x)
    y = ((q.y - lower.y) - (upper.y - q.y)) / (upper.y - lower.y)
    z = ((q.z - lower.z) - (upper.z - q.z)) / (upper.z - lower.z)
    if code > 0:
        axis = (code - 1) % 3
        a, b = y if axis == 0 else x, y if axis == 2 else z
        return 0.5 * (a + 1.0), 0.5 * (b + 1.0)
    phi = math.atan2(y, x)
    if phi < 0.0:
        phi += 2.0 * math.pi
    if quadrics.clipped[i, 2] == 0:
        return phi / (2.0 * math.pi), math.atan2(math.sqrt(x * x + y * y), z) / math.pi
    return phi / (2.0 * math.pi), 0.5 * (z + 1.0)


@kernel
def face_of(quadrics: Quadrics, hit: Hit) -> int:
    """0 for f's surface, else 1 + the face of the clip box: axis, + 3 on the positive side."""
    return int(hit.u)
