"""A line against a quadric and its clip box, in local coordinates."""

import math
from typing import Any, NamedTuple

from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import dot, max_abs, row
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.box import face_entered, face_left, inside
from reference_rt.shapes.curved.quadratic import roots, short, slabs
from reference_rt.shapes.placement import local_ray, local_vector
from reference_rt.shapes.rounding import along_from
from reference_rt.shapes.shape import Spans, no_spans, one_span


@kernel
def _rebased_ray(quadrics: Any, i: int, ray: Ray) -> tuple[Ray, float, float]:
    """(the ray in local coordinates, begin, unit): the world's t is begin + t unit.

    The origin of a ray from far away is moved next to the local origin, in the world and without
    the rounding of large numbers (`along_from`): f along the ray then rounds as numbers of the
    shape's size do.  A ray that begins within the box, or next to it, must not be moved: see
    `roots`.  Directions whose powers would overflow or underflow are scaled to length 1.
    """
    local = local_ray(quadrics, i, ray)
    size = max_abs(local.d)
    unit = 1.0
    if size > 0.0 and not 2.0**-200 < size < 2.0**200:
        unit = 1.0 / size
    d = local.d * unit
    if max_abs(local.o) <= 1.25:
        return Ray(local.o, d, local.t_max), 0.0, unit
    begin = short(-dot(local.o, d) / dot(d, d), 0.0625, d) * unit
    near = along_from(ray.o, ray.d, row(quadrics.center, i), begin)
    return Ray(local_vector(quadrics, i, near), d, local.t_max), begin, unit


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


@kernel
def line_of(quadrics: Any, i: int, ray: Ray) -> Line:
    near, begin, unit = _rebased_ray(quadrics, i, ray)
    r = roots(quadrics.coefficients[i], near)
    s = slabs(quadrics.lower[i], quadrics.upper[i], quadrics.clipped[i], near)
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
