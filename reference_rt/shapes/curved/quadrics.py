"""The table of all quadrics, and its kernels."""

import math
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import Bounds, FloatArray, IntArray
from reference_rt.core.ray import Crossing, Hit, Ray, SurfacePoint, at
from reference_rt.core.vec3 import (
    Vec3,
    component,
    cross,
    dot,
    length,
    max_abs,
    normalize,
    row,
    triple,
)
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import larger, negated, only_where, select, smaller
from reference_rt.sampling.warp import around, turns
from reference_rt.shapes import placement
from reference_rt.shapes.box import face_entered, face_left, face_normal, inside, on_face
from reference_rt.shapes.curved.quadratic import (
    Coefficients,
    Roots,
    gradient,
    noise,
    roots,
    short,
    slabs,
    value,
)
from reference_rt.shapes.placement import (
    local_point,
    local_vector,
    world_covector,
    world_surface,
    world_vector,
)
from reference_rt.shapes.ray_simd import make_nearer
from reference_rt.shapes.rounding import along_from
from reference_rt.shapes.shape import Spans, Tangents, any_tangents, no_spans, one_span

# ---- a line against a quadric and its clip box, in local coordinates -----------------------------


class Row(NamedTuple):
    """One row: center and to_local as in `placement.py`;  k: f's coefficients;  the box's
    corners;  clipped, for each axis, and capped: 1 or 0."""

    center: Vec3
    x_of: Vec3
    y_of: Vec3
    z_of: Vec3
    k: Coefficients
    lower: Vec3
    upper: Vec3
    clipped: Vec3
    capped: float


@kernel
def arguments(quadrics: Any, i: int) -> Row:
    """What `distance` takes after the ray."""
    k = quadrics.coefficients[i]
    clipped = quadrics.clipped[i]
    return Row(
        row(quadrics.center, i),
        triple(quadrics.to_local, i, 0),
        triple(quadrics.to_local, i, 1),
        triple(quadrics.to_local, i, 2),
        (k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7], k[8], k[9]),
        row(quadrics.lower, i),
        row(quadrics.upper, i),
        Vec3(1.0 * clipped[0], 1.0 * clipped[1], 1.0 * clipped[2]),
        1.0 * quadrics.capped[i],
    )


class Rebased(NamedTuple):
    """A ray in local coordinates.  The world's t is begin + t unit."""

    ray: Ray
    begin: float
    unit: float


@kernel
def _in_local(quadric: Row, v: Vec3) -> Vec3:
    return Vec3(dot(quadric.x_of, v), dot(quadric.y_of, v), dot(quadric.z_of, v))


@only_where
def _reciprocal(x: float) -> float:
    return 1.0 / x


@only_where
def _moved(quadric: Row, ray: Ray, o: Vec3, d: Vec3, unit: float) -> Any:
    """The local origin next to the shape, and the world's t there."""
    begin = short(-dot(o, d) / dot(d, d), 0.0625, d) * unit
    x, y, z = _in_local(quadric, along_from(ray.o, ray.d, quadric.center, begin))
    return x, y, z, begin


@kernel
def _rebased_ray(quadric: Row, ray: Ray) -> Rebased:
    """The origin of a ray from far away is moved next to the local origin, in the world and without
    the rounding of large numbers (`along_from`): f along the ray then rounds as numbers of the
    shape's size do.  A ray that begins within the box, or next to it, must not be moved: see
    `roots`.  Directions whose powers would overflow or underflow are scaled to length 1.
    """
    o, d = _in_local(quadric, ray.o - quadric.center), _in_local(quadric, ray.d)
    size = max_abs(d)
    extreme = (size > 0.0) & negated((size > 2.0**-200) & (size < 2.0**200))
    unit = _reciprocal(extreme, 1.0, size)
    d = d * unit
    is_far = negated(max_abs(o) <= 1.25)
    x, y, z, begin = _moved(is_far, (o.x, o.y, o.z, 0.0), quadric, ray, o, d, unit)
    return Rebased(Ray(Vec3(x, y, z), d, ray.t_max), begin, unit)


class Line(NamedTuple):
    """A line's roots, where it enters and leaves the clip box, and the codes of the caps there.

    All t are those of `_rebased_ray`.  Far away the spacing of the world's t is larger than the
    distance between a rim and a root: their order is decided before they are rounded to the world's
    t.
    """

    t0: float
    t1: float
    between: bool
    t_in: float
    t_out: float
    cap_in: float
    cap_out: float
    begin: float
    unit: float


_OUTSIDE = 3.25
"""The square of a distance from the local origin beyond which there is nothing: the box's corners
are at 3, and both sides round by 1e-15.  Most lines miss by it: `caustic_glass`, with a ring among
four shapes, takes 0.86 of the time (measured)."""


@kernel
def _is_outside(near: Ray) -> bool:
    along, far2 = dot(near.o, near.d), dot(near.d, near.d)
    return dot(near.o, near.o) * far2 - along * along > _OUTSIDE * far2


@kernel
def line_of(quadrics: Any, i: int, ray: Ray) -> Line:
    quadric = arguments(quadrics, i)
    near, begin, unit = _rebased_ray(quadric, ray)
    if _is_outside(near):
        return Line(math.nan, math.nan, False, math.inf, -math.inf, 0.0, 0.0, begin, unit)
    r = roots(quadric.k, near)
    s = slabs(quadric.lower, quadric.upper, quadric.clipped, near)
    t_in, t_out = inside(s)
    cap_in, cap_out = 1.0 + face_entered(s, t_in), 1.0 + face_left(s, t_out)
    return Line(r.t0, r.t1, r.between, t_in, t_out, cap_in, cap_out, begin, unit)


@kernel
def in_world(line: Line, t: float) -> float:
    """The world's t of a t of the line."""
    return line.begin + t * line.unit


@kernel
def solid_along(line: Line) -> Spans:
    """The parts inside the solid, in t of the line: see `quadrics.spans`."""
    t0, t1, between, t_in, t_out, cap_in, cap_out, _, _ = line
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


class Quadrics(NamedTuple):
    """n quadrics: center, to_local and edges as in `shapes.placement`; f's coefficients (n, 10);
    the box's corners lower and upper (n, 3); clipped (n, 3), for each axis 1 if the box clips f and
    0 if f ends within it; capped (n,), 1 for solids; the columns of `owners`."""

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


def bounds(quadrics: Quadrics) -> Bounds:
    """Boxes along the axes (n, 3), (n, 3) around the clip boxes, rounded outwards."""
    return placement.bounds(quadrics.center, quadrics.edges, quadrics.lower, quadrics.upper)


def is_solid(quadrics: Quadrics) -> bool:
    return bool(np.all(quadrics.capped != 0))


@kernel
def spans(quadrics: Quadrics, i: int, ray: Ray) -> Spans:
    """The parts of the line inside the solid: f <= 0 within the box.  An end's u is 0 on f's
    surface, and 1 + the box's face (axis, + 3 on the positive side) on a cap."""
    line = line_of(quadrics, i, ray)
    s = solid_along(line)
    return Spans(
        in_world(line, s.t0),
        s.u0,
        in_world(line, s.t1),
        s.u1,
        in_world(line, s.t2),
        s.u2,
        in_world(line, s.t3),
        s.u3,
    )


@kernel
def _if_ahead(t: float, is_there: bool, near: Rebased, otherwise: float) -> float:
    """The world's t of a crossing, or `otherwise` if there is none or it is behind."""
    t = near.begin + t * near.unit
    found: float = select(is_there & (t > 0.0), t, otherwise)
    return found


@only_where
def _distance_to_solid(r: Roots, t_in: float, t_out: float, near: Rebased) -> float:
    """As `solid_along`, from the last crossing to the first."""
    whole = negated(r.between) & (r.t0 >= r.t1)
    t0, t1 = select(whole, -math.inf, r.t0), select(whole, math.inf, r.t1)
    between = r.between | whole
    again = larger(t_in, t1)
    t = _if_ahead(t_out, negated(between) & (again <= t_out), near, math.inf)
    t = _if_ahead(again, negated(between) & (again <= t_out), near, t)
    entry, leave = select(between, larger(t_in, t0), t_in), smaller(select(between, t1, t0), t_out)
    return _if_ahead(entry, entry <= leave, near, _if_ahead(leave, entry <= leave, near, t))


@only_where
def _distance_beside(quadric: Row, near: Rebased) -> float:
    """`distance` for lines that may meet the box."""
    r = roots(quadric.k, near.ray)
    t_in, t_out = inside(slabs(quadric.lower, quadric.upper, quadric.clipped, near.ray))
    t = _if_ahead(r.t1, (t_in <= r.t1) & (r.t1 <= t_out), near, math.inf)
    t = _if_ahead(r.t0, (t_in <= r.t0) & (r.t0 <= t_out), near, t)
    found: float = _distance_to_solid(quadric.capped > 0.0, t, r, t_in, t_out, near)
    return found


@kernel
def _distance(quadric: Row, ray: Ray) -> float:
    """A surface that is not capped includes its rim.  A line in the surface does not meet it."""
    near = _rebased_ray(quadric, ray)
    t: float = _distance_beside(negated(_is_outside(near.ray)), math.inf, quadric, near)
    return t


@kernel
def distance(
    ray: Ray,
    center: Vec3,
    x_of: Vec3,
    y_of: Vec3,
    z_of: Vec3,
    k: Coefficients,
    lower: Vec3,
    upper: Vec3,
    clipped: Vec3,
    capped: float,
) -> float:
    """The smallest t > 0 at which a ray meets a quadric, inf for a miss."""
    return _distance(Row(center, x_of, y_of, z_of, k, lower, upper, clipped, capped), ray)


nearer = make_nearer(distance)


@kernel
def intersect(quadrics: Quadrics, i: int, ray: Ray) -> Crossing:
    """Where the ray meets quadric i; u: which surface of it, see `spans`."""
    if quadrics.capped[i] != 0:
        s = spans(quadrics, i, ray)
        if s.t0 > 0.0:
            return Crossing(s.t0, s.u0, 0.0)
        if s.t1 > 0.0:
            return Crossing(s.t1, s.u1, 0.0)
        if s.t2 > 0.0:
            return Crossing(s.t2, s.u2, 0.0)
        return Crossing(s.t3 if s.t3 > 0.0 else math.inf, s.u3, 0.0)
    return Crossing(_distance(arguments(quadrics, i), ray), 0.0, 0.0)


@kernel
def found(quadrics: Quadrics, i: int, ray: Ray, t: float) -> Crossing:
    """The crossing of quadric i at t."""
    if quadrics.capped[i] != 0:
        return intersect(quadrics, i, ray)
    return Crossing(t, 0.0, 0.0)


@kernel
def crossings(quadrics: Quadrics, i: int, ray: Ray) -> Spans:
    """All crossings of the line and quadric i in order, also of a surface that is not capped."""
    if quadrics.capped[i] != 0:
        return spans(quadrics, i, ray)
    line = line_of(quadrics, i, ray)
    first = in_world(line, line.t0) if line.t_in <= line.t0 <= line.t_out else math.inf
    second = in_world(line, line.t1) if line.t_in <= line.t1 <= line.t_out else math.inf
    return one_span(min(first, second), 0.0, max(first, second), 0.0)


# ---- the surface at a hit -----------------------------------------------------------------------


@kernel
def _on_surface(quadrics: Quadrics, i: int, q: Vec3) -> Vec3:
    """q moved onto f = 0 along the world's normal, by Newton's steps as long as |f| decreases.

    Each step squares the distance, in radii of curvature: four are enough for an error of a
    hundredth, that of a ray from 1e13 sizes away.
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
    """The distance by which q must move along the normal so that f's computed sign is right there:
    for f at q, its noise there, and the noise at the next ray's origin, with one to spare for
    rounding.

    Next to a point where the gradient vanishes, f grows as the square of the distance from it;
    there this is the distance within which f is smaller than its noise.
    """
    k = quadrics.coefficients[i]
    uncertain = abs(value(k, q)) + 3.0 * noise(k, q)
    if uncertain == 0.0:
        return 0.0
    bend = abs(k[0]) + abs(k[1]) + abs(k[2]) + abs(k[3]) + abs(k[4]) + abs(k[5])
    return uncertain / max(length(gradient(k, q)), math.sqrt(uncertain * bend))


@kernel
def _in_box(quadrics: Quadrics, i: int, q: Vec3) -> Vec3:
    """q in coordinates where the box is the cube [-1, 1]³."""
    lower, upper = row(quadrics.lower, i), row(quadrics.upper, i)
    return Vec3(
        ((q.x - lower.x) - (upper.x - q.x)) / (upper.x - lower.x),
        ((q.y - lower.y) - (upper.y - q.y)) / (upper.y - lower.y),
        ((q.z - lower.z) - (upper.z - q.z)) / (upper.z - lower.z),
    )


@kernel
def uv(quadrics: Quadrics, ray: Ray, hit: Hit) -> tuple[float, float]:
    """In coordinates where the box is the cube [-1, 1]³: (phi / 2 pi around z from +x, z from 0 to
    1); for an ellipsoid as for a sphere; for a cap as for a box's face: the two other coordinates
    in the order x, y, z, from 0 to 1."""
    i, code = hit.row, int(hit.u)
    x, y, z = _in_box(quadrics, i, local_point(quadrics, i, at(ray, hit.t)))
    if code > 0:
        axis = (code - 1) % 3
        a, b = y if axis == 0 else x, y if axis == 2 else z
        return 0.5 * (a + 1.0), 0.5 * (b + 1.0)
    if quadrics.clipped[i, 2] == 0:
        return around(y, x), 2.0 * turns(math.sqrt(x * x + y * y), z)
    return around(y, x), 0.5 * (z + 1.0)


@kernel
def tangents(quadrics: Quadrics, ray: Ray, hit: Hit) -> Tangents:
    """Any tangents where u and v are no coordinates of the surface: on the z axis, and where v is
    constant along the surface."""
    i, code = hit.row, int(hit.u)
    size = row(quadrics.upper, i) - row(quadrics.lower, i)
    q = local_point(quadrics, i, at(ray, hit.t))
    if code > 0:
        axis = (code - 1) % 3
        a, b = 1 if axis == 0 else 0, 1 if axis == 2 else 2
        return Tangents(
            triple(quadrics.edges, i, a) * component(size, a),
            triple(quadrics.edges, i, b) * component(size, b),
        )
    q = _on_surface(quadrics, i, q)
    x, y, z = _in_box(quadrics, i, q)
    rho2 = x * x + y * y
    # The gradients of u, v and f, those of u and v scaled: along dp/du only u changes.
    du, u_size = Vec3(-y, x, 0.0), 2.0 * math.pi * rho2
    dv, v_size = Vec3(0.0, 0.0, 1.0), 2.0
    if quadrics.clipped[i, 2] == 0:
        dv, v_size = Vec3(x * z, y * z, -rho2), math.pi * math.sqrt(rho2) * (rho2 + z * z)
    df = gradient(quadrics.coefficients[i], q) * size
    along_u, along_v = cross(dv, df), cross(df, du)
    volume = dot(du, along_u)
    if volume != 0.0:
        half = size * (0.5 / volume)
        dpdu = world_vector(quadrics, i, along_u * half) * u_size
        dpdv = world_vector(quadrics, i, along_v * half) * v_size
        if max(max_abs(dpdu), max_abs(dpdv)) < math.inf:
            return Tangents(dpdu, dpdv)
    return any_tangents(normalize(world_covector(quadrics, i, _normal(quadrics, i, q))))


@kernel
def face_of(quadrics: Quadrics, hit: Hit) -> int:
    """0 for f's surface, else 1 + the face of the clip box: axis, + 3 on the positive side."""
    return int(hit.u)
