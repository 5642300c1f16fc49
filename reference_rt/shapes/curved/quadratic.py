"""Quadratic surfaces in local coordinates: values, gradients, roots along a line, clip box.

f(q) = A x² + B y² + C z² + D xy + E yz + F xz + G x + H y + I z + J;  `k` holds the coefficients in
this order (10,).  Along a line, f is a t² + 2 b t + c.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from reference_rt.core.ray import UNIT_ROUNDOFF, Ray
from reference_rt.core.vec3 import Vec3, dot, max_abs
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import (
    larger,
    negated,
    only_where,
    select,
    smaller,
    square_root,
    with_sign,
)
from reference_rt.shapes.box import Slabs

Coefficients = Sequence[float]


@kernel
def value(k: Coefficients, q: Vec3) -> float:
    """f(q)."""
    f: float = (
        q.x * (k[0] * q.x + k[3] * q.y + k[5] * q.z + k[6])
        + q.y * (k[1] * q.y + k[4] * q.z + k[7])
        + q.z * (k[2] * q.z + k[8])
        + k[9]
    )
    return f


@kernel
def noise(k: Coefficients, q: Vec3) -> float:
    """A bound on the error of `value`: each of the ten terms has at most 9 roundings, that of its
    coefficient included."""
    x, y, z = abs(q.x), abs(q.y), abs(q.z)
    terms: float = (
        x * (abs(k[0]) * x + abs(k[3]) * y + abs(k[5]) * z + abs(k[6]))
        + y * (abs(k[1]) * y + abs(k[4]) * z + abs(k[7]))
        + z * (abs(k[2]) * z + abs(k[8]))
        + abs(k[9])
    )
    return 9.0 * UNIT_ROUNDOFF * terms


@kernel
def gradient(k: Coefficients, q: Vec3) -> Vec3:
    return Vec3(
        2.0 * k[0] * q.x + k[3] * q.y + k[5] * q.z + k[6],
        k[3] * q.x + 2.0 * k[1] * q.y + k[4] * q.z + k[7],
        k[5] * q.x + k[4] * q.y + 2.0 * k[2] * q.z + k[8],
    )


@kernel
def second_degree(k: Coefficients, d: Vec3) -> float:
    """The terms of second degree of f, at d."""
    f: float = (
        d.x * (k[0] * d.x + k[3] * d.y + k[5] * d.z)
        + d.y * (k[1] * d.y + k[4] * d.z)
        + d.z * (k[2] * d.z)
    )
    return f


@kernel
def short(t: float, step: float, d: Vec3) -> float:
    """t rounded to a multiple of about step / |d|: then o + t d does not round if o and d are short
    numbers, as those of a lattice."""
    large = 2.0**52 * step / max_abs(d)  # the spacing of floats at `large` is the multiple
    return (t + large) - large


@only_where
def _discriminant_beside(k: Coefficients, ray: Ray, a: float, b: float) -> float:
    """b² - a c for an origin next to the roots."""
    between = ray.o + ray.d * short(-b / a, 2.0**-16, ray.d)
    b = 0.5 * dot(gradient(k, between), ray.d)
    return b * b - a * value(k, between)


@kernel
def _discriminant(k: Coefficients, ray: Ray, a: float, b: float, c: float) -> float:
    """b² - a c, the same for any origin on the line.

    If the roots are close together compared with their distance from the origin, the products
    cancel and the rounding of c is larger than the difference of the roots.  The origin is then
    moved next to both, where b and c are small.
    """
    found = b * b - a * c
    cancels = abs(found) < 0.0625 * (b * b)
    better: float = _discriminant_beside(cancels, found, k, ray, a, b)
    return better


STEEP = 0.5
"""A gradient below this is flat: the largest are 1 to 2, where local coordinates are 1 (`fit`)."""


@only_where
def _from_beside(
    k: Coefficients, ray: Ray, a: float, slope: float, t: float, p: Vec3, g: Vec3
) -> float:
    """The root t from p, the point there, where the gradient is g."""
    b, f = 0.5 * dot(g, ray.d), value(k, p)
    # The same root of a s² + 2 b s + f = 0 either way: without cancellation.
    same = b * slope > 0.0
    s = select(same, -f, slope - b) / select(same, b + slope, a)
    refined: float = select(abs(s) < 0.5 * abs(t), t + s, t)
    return refined


@kernel
def _refined_root(k: Coefficients, ray: Ray, a: float, slope: float, t: float) -> float:
    """The root t, where f grows by 2 `slope`, refined from an origin next to it if f is flat there.

    a, b and c round by u times the square of the distance from the origin.  That moves a root as
    much as moving the ray sideways by this error over the gradient would: next to the apex of a
    cone, by any number of u.  From an origin next to the root f rounds by u times the gradient, as
    if the ray had moved by u.  The sign of t, which that of c has decided, stays.
    """
    p = ray.o + ray.d * t
    g = gradient(k, p)
    refined: float = _from_beside(max_abs(g) < STEEP, t, k, ray, a, slope, t, p, g)
    return refined


class Roots(NamedTuple):
    """The part of a line with f <= 0: if `between`, from t0 to t1 (empty if t0 > t1), or else up to
    t0 and from t1 on."""

    t0: float
    t1: float
    between: bool


@only_where
def _two_roots(
    k: Coefficients, ray: Ray, a: float, b: float, c: float, rest: float
) -> tuple[float, float]:
    """By q = -(b ± sqrt(b² - a c)) without cancellation: q / a and c / q.  rest: b² - a c."""
    half = with_sign(square_root(rest), b)
    q = -(b + half)
    # Where f has no quadratic term along the line, one root is ±inf, as IEEE says.
    curved, moves = abs(a) > 0.0, abs(q) > 0.0
    t0 = select(curved, q / select(curved, a, 1.0), q * math.inf)
    t1 = select(moves, c / select(moves, q, 1.0), t0)
    t0, t1 = _refined_root(k, ray, a, -half, t0), _refined_root(k, ray, a, half, t1)
    return smaller(t0, t1), larger(t0, t1)


@kernel
def roots(k: Coefficients, ray: Ray) -> Roots:
    """The sign of c says on which side the ray begins, and the signs of the roots follow from it
    without rounding: a ray that leaves the surface does not meet it again at its own origin."""
    a = second_degree(k, ray.d)
    b = 0.5 * dot(gradient(k, ray.o), ray.d)
    c = value(k, ray.o)
    rest = _discriminant(k, ray, a, b, c)
    constant = (abs(a) <= 0.0) & (abs(b) <= 0.0)
    has_roots = (rest >= 0.0) & negated(constant)
    everywhere = (constant & (c <= 0.0)) | ((rest < 0.0) & (a < 0.0))
    nearest = select(everywhere, -math.inf, math.inf)
    t0, t1 = _two_roots(has_roots, (nearest, -nearest), k, ray, a, b, c, rest)
    return Roots(t0, t1, (a >= 0.0) | negated(has_roots))


@only_where
def _slab(lower: float, upper: float, o: float, d: float) -> tuple[float, float]:
    """The t at which a line enters and leaves the slab between two planes; NaN for a plane that
    contains the line, which `box.inside` ignores.

    By division, as the roots: a root that is at a plane in exact numbers is then there in floats.
    """
    at_lower, at_upper = (lower - o) / d, (upper - o) / d
    up = with_sign(1.0, d) > 0.0
    return select(up, at_lower, at_upper), select(up, at_upper, at_lower)


@kernel
def slabs(lower: Vec3, upper: Vec3, clipped: Vec3, ray: Ray) -> Slabs:
    """`box.slabs` for a box with the corners `lower` and `upper`;  clipped: 1 for the axes that it
    clips, else 0; across these all points are inside."""
    o, d, whole = ray.o, ray.d, (-math.inf, math.inf)
    x_in, x_out = _slab(clipped.x > 0.0, whole, lower.x, upper.x, o.x, d.x)
    y_in, y_out = _slab(clipped.y > 0.0, whole, lower.y, upper.y, o.y, d.y)
    z_in, z_out = _slab(clipped.z > 0.0, whole, lower.z, upper.z, o.z, d.z)
    return Slabs(x_in, x_out, y_in, y_out, z_in, z_out, d.x > 0.0, d.y > 0.0, d.z > 0.0)
