"""Quadratic surfaces in local coordinates: values, gradients, roots along a line, clip box.

f(q) = A x² + B y² + C z² + D xy + E yz + F xz + G x + H y + I z + J;  `k` holds the coefficients in
this order (10,).  Along a line, f is a t² + 2 b t + c.
"""

import math
from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF, Ray
from reference_rt.core.vec3 import Vec3, dot, max_abs
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.box import Slabs


@kernel
def value(k: FloatArray, q: Vec3) -> float:
    """f(q)."""
    f: float = (
        q.x * (k[0] * q.x + k[3] * q.y + k[5] * q.z + k[6])
        + q.y * (k[1] * q.y + k[4] * q.z + k[7])
        + q.z * (k[2] * q.z + k[8])
        + k[9]
    )
    return f


@kernel
def noise(k: FloatArray, q: Vec3) -> float:
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
def gradient(k: FloatArray, q: Vec3) -> Vec3:
    return Vec3(
        2.0 * k[0] * q.x + k[3] * q.y + k[5] * q.z + k[6],
        k[3] * q.x + 2.0 * k[1] * q.y + k[4] * q.z + k[7],
        k[5] * q.x + k[4] * q.y + 2.0 * k[2] * q.z + k[8],
    )


@kernel
def second_degree(k: FloatArray, d: Vec3) -> float:
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


@kernel
def _discriminant(k: FloatArray, ray: Ray, a: float, b: float, c: float) -> float:
    """b² - a c, the same for any origin on the line.

    If the roots are close together compared with their distance from the origin, the products
    cancel and the rounding of c is larger than the difference of the roots.  The origin is then
    moved next to both, where b and c are small.
    """
    found = b * b - a * c
    if not abs(found) < 0.0625 * (b * b):
        return found
    between = ray.o + ray.d * short(-b / a, 2.0**-16, ray.d)
    b = 0.5 * dot(gradient(k, between), ray.d)
    return b * b - a * value(k, between)


STEEP = 0.5
"""A gradient below this is flat: the largest are 1 to 2, where local coordinates are 1 (`fit`)."""


@kernel
def _refined_root(k: FloatArray, ray: Ray, a: float, slope: float, t: float) -> float:
    """The root t, where f grows by 2 `slope`, refined from an origin next to it if f is flat there.

    a, b and c round by u times the square of the distance from the origin.  That moves a root as
    much as moving the ray sideways by this error over the gradient would: next to the apex of a
    cone, by any number of u.  From an origin next to the root f rounds by u times the gradient, as
    if the ray had moved by u.  The sign of t, which that of c has decided, stays.
    """
    p = ray.o + ray.d * t
    g = gradient(k, p)
    if not max_abs(g) < STEEP:
        return t
    b = 0.5 * dot(g, ray.d)
    # The same root of a s² + 2 b s + c = 0 either way: without cancellation.
    s = -value(k, p) / (b + slope) if b * slope > 0.0 else (slope - b) / a
    return t + s if abs(s) < 0.5 * abs(t) else t


class Roots(NamedTuple):
    """The part of a line with f <= 0: if `between`, from t0 to t1 (empty if t0 > t1), or else up to
    t0 and from t1 on."""

    t0: float
    t1: float
    between: bool


@kernel
def roots(k: FloatArray, ray: Ray) -> Roots:
    """By q = -(b ± sqrt(b² - a c)) without cancellation: q / a and c / q.

    The sign of c says on which side the ray begins, and the signs of the roots follow from it
    without rounding: a ray that leaves the surface does not meet it again at its own origin.
    """
    nowhere, everywhere = Roots(math.inf, -math.inf, True), Roots(-math.inf, math.inf, True)
    a = second_degree(k, ray.d)
    b = 0.5 * dot(gradient(k, ray.o), ray.d)
    c = value(k, ray.o)
    if a == 0.0 and b == 0.0:
        return everywhere if c <= 0.0 else nowhere
    rest = _discriminant(k, ray, a, b, c)
    if not rest >= 0.0:
        return everywhere if rest < 0.0 and a < 0.0 else nowhere
    half = math.copysign(math.sqrt(rest), b)
    q = -(b + half)
    # Where f has no quadratic term along the line, one root is ±inf, as IEEE says.
    t0 = q / a if a != 0.0 else q * math.inf
    t1 = c / q if q != 0.0 else t0
    t0, t1 = _refined_root(k, ray, a, -half, t0), _refined_root(k, ray, a, half, t1)
    return Roots(min(t0, t1), max(t0, t1), a >= 0.0)


@kernel
def _slab(lower: float, upper: float, clipped: int, o: float, d: float) -> tuple[float, float]:
    """The t at which a line enters and leaves the slab between two planes; NaN for a plane that
    contains the line, which `box.inside` ignores.

    By division, as the roots: a root that is at a plane in exact numbers is then there in floats.
    """
    if clipped == 0:
        return -math.inf, math.inf
    at_lower, at_upper = (lower - o) / d, (upper - o) / d
    return (at_lower, at_upper) if math.copysign(1.0, d) > 0.0 else (at_upper, at_lower)


@kernel
def slabs(lower: FloatArray, upper: FloatArray, clipped: IntArray, ray: Ray) -> Slabs:
    """`box.slabs` for a box with the corners `lower` and `upper` (3,);  clipped (3,): the axes that
    it clips; across the others all points are inside."""
    o, d = ray.o, ray.d
    x_in, x_out = _slab(lower[0], upper[0], clipped[0], o.x, d.x)
    y_in, y_out = _slab(lower[1], upper[1], clipped[1], o.y, d.y)
    z_in, z_out = _slab(lower[2], upper[2], clipped[2], o.z, d.z)
    return Slabs(x_in, x_out, y_in, y_out, z_in, z_out, d.x > 0.0, d.y > 0.0, d.z > 0.0)
