"""Sphere |p - c| = r: the algebraic, the geometric and the robust method (row T5).

Costs are for a hit from outside, without comparisons.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, dot
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.textbook.method import FloatArray, family, ray_of, vector


class SphereParameters(NamedTuple):
    """center (3,) in world coordinates; radius > 0."""

    center: npt.ArrayLike
    radius: float


Prepared = tuple[Vec3, float]


def prepare(sphere: SphereParameters) -> Prepared:
    """Center and radius, checked."""
    radius = np.float64(sphere.radius)
    if not (0.0 < radius < math.inf):
        raise ValueError(f"radius: expected a finite number above 0, got {sphere.radius!r}")
    return vector(sphere.center, "center"), radius


@kernel
def algebraic(ray: Ray, center: Vec3, r: float) -> float:
    """Substitute p(t) into |p - c|² = r²: a t² + b t + c = 0, with the cases of the discriminant.

    With f = o - c: a = d·d, b = 2 d·f, c = f·f - r², D = b² - 4ac.  D < 0: no point; D = 0: one,
    -b / 2a; D > 0: two, (-b ± sqrt(D)) / 2a.
    Cost: 13 +, 16 *, 2 /, 1 sqrt.
    Fails: far away.  D = 4 |d|² h², h half the chord, is a difference of numbers of about
    4 |d|² |f|²: measured, the error of t |d| is up to 3 u |f|² / h.  At 1e7 radii that is a tenth
    of a radius; at 1e8 a fifth of all hits is lost.
    """
    f = ray.o - center
    a = dot(ray.d, ray.d)
    b = 2.0 * dot(ray.d, f)
    c = dot(f, f) - r * r
    discriminant = b * b - 4.0 * a * c
    if discriminant < 0.0:
        return math.inf
    if discriminant == 0.0:
        t = -b / (2.0 * a)
        return t if t > 0.0 else math.inf
    root = math.sqrt(discriminant)
    t0 = (-b - root) / (2.0 * a)
    t1 = (-b + root) / (2.0 * a)
    if t0 > 0.0:
        return t0
    return t1 if t1 > 0.0 else math.inf


@kernel
def geometric(ray: Ray, center: Vec3, r: float) -> float:
    """By the closest approach to the centre, with early rejection.

    L = c - o.  Outside (L² > r²) and t_ca = L·d < 0: the sphere is behind.  d² = L² - t_ca² > r²:
    the line misses it.  Else t_hc = sqrt(r² - d²), t = t_ca - t_hc from outside, t_ca + t_hc from
    inside.  Lectures take |d| = 1; here t_ca and t_hc are divided by d·d and |d|.
    Cost: 12 +, 11 *, 2 /, 1 sqrt; a sphere behind needs 7 +, 7 *.
    Fails: far away, as `algebraic` does, since L² - t_ca² cancels like the discriminant.  At 1e8
    radii almost half of all hits are lost.
    """
    to_center = center - ray.o
    l2 = dot(to_center, to_center)
    r2 = r * r
    along = dot(to_center, ray.d)
    outside = l2 > r2
    if outside and along < 0.0:
        return math.inf
    a = dot(ray.d, ray.d)
    t_ca = along / a
    d2 = l2 - t_ca * along
    if d2 > r2:
        return math.inf
    t_hc = math.sqrt((r2 - d2) / a)
    t = t_ca - t_hc if outside else t_ca + t_hc
    return t if t > 0.0 else math.inf


@kernel
def robust(ray: Ray, center: Vec3, r: float) -> float:
    """The quadratic without its two cancellations; the renderer's method, which also computes the
    closest approach with an error that does not grow with distance (`shapes.rounding.along_from`).

    r² - |f + t_ca d|², with the closest approach as a vector, replaces the discriminant: its error
    is u |f| r instead of u |f|².  The root of larger magnitude comes from q = b ± sqrt(D) without
    cancellation, the other from c / q.
    Cost: 17 +, 18 *, 3 /, 1 sqrt.
    Fails: near the surface, as the others do.  There c = f·f - r² has an error of u r², so that a
    root near zero is off by some u r and may have the wrong sign: offset rays that leave a surface
    by more.  Near the silhouette from far away: hits within some u |f| of it are lost.
    """
    f = ray.o - center
    a = dot(ray.d, ray.d)
    b = -dot(f, ray.d)
    approach = f + ray.d * (b / a)
    discriminant = r * r - dot(approach, approach)
    if discriminant < 0.0:
        return math.inf
    q = b + math.copysign(math.sqrt(a * discriminant), b)
    t0 = (dot(f, f) - r * r) / q
    t1 = q / a
    near, far = (t0, t1) if t0 < t1 else (t1, t0)
    if near > 0.0:
        return near
    return far if far > 0.0 else math.inf


@entry_kernel
def _algebraic(sphere: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = algebraic(ray_of(o, d, i), *sphere)


@entry_kernel
def _geometric(sphere: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = geometric(ray_of(o, d, i), *sphere)


@entry_kernel
def _robust(sphere: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = robust(ray_of(o, d, i), *sphere)


_method = family("sphere", "T5", SphereParameters, prepare)

METHODS = (
    _method(
        "algebraic",
        "the quadratic and its three discriminant cases",
        "Haines 1989, in Glassner (ed.), An Introduction to Ray Tracing, ch. 2",
        _algebraic,
    ),
    _method(
        "geometric",
        "closest approach and half chord, with early rejections",
        "Haines 1989, in Glassner (ed.), An Introduction to Ray Tracing, ch. 2",
        _geometric,
    ),
    _method(
        "robust",
        "the quadratic without cancellation",
        "Haines, Günther & Akenine-Möller 2019, Ray Tracing Gems, ch. 7",
        _robust,
    ),
)
