"""Sampling the visible normals of Beckmann's distribution of slopes."""

import math

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.sampling.warp import about_normal

SQRT_PI = math.sqrt(math.pi)

FAR = 6.5
"""A slope, in units of alpha, that Beckmann's distribution exceeds with probability
erfc(6.5) / 2 = 2e-20: less than any sampler's step."""

_LEAST = 1e-18
"""Smaller numbers count as this."""

_ROUNDED = 2.0**-51
"""The relative error of a sum of two products with erfc and exp, each of which is right to 2 u."""

_CUBED = 1e-5
"""A step, times the relative curvature there, whose cube is below 1e-15."""


@kernel
def visible_beckmann(w: Vec3, u0: float, u1: float) -> Vec3:
    """A visible normal for roughness 1, not of unit length: the slope towards w is from
    `_slope_seen`; the slope across it is normally distributed for every w (Heitz & d'Eon 2014,
    "Importance Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals")."""
    sine = math.sqrt(w.x * w.x + w.y * w.y)
    x = _slope_seen(w.z, sine, u0)
    # By symmetry from the lower half, where fewer digits cancel.
    y = _slope_across(u1) if u1 < 0.5 else -_slope_across(1.0 - u1)
    cos_phi, sin_phi = (w.x / sine, w.y / sine) if sine > 0.0 else (1.0, 0.0)
    return Vec3(sin_phi * y - cos_phi * x, -sin_phi * x - cos_phi * y, 1.0)


@kernel
def seen(cosine: float, sine: float, x: float) -> float:
    """The integral of 2 (cosine - sine x) exp(-x²) from -infinity to x."""
    return cosine * SQRT_PI * math.erfc(-x) + sine * math.exp(-x * x)


@kernel
def _slope_across(u: float) -> float:
    """The quantile u of the slopes: the root of erfc(-x) = 2 u."""
    u = max(u, _LEAST)
    return _refined(1.0, 0.0, FAR, u * (2.0 * SQRT_PI), about_normal(u))


@kernel
def _slope_seen(cosine: float, sine: float, u: float) -> float:
    """The quantile u of the slopes x that are visible from a direction at this angle: those of
    density (cosine - sine x) exp(-x²) up to cosine / sine.

    Seen from above it is normally distributed, at grazing angles it is -sqrt(-log u).  Between them
    the mean of the two, weighted by angle, is so close that two steps are enough (measured).
    """
    u = max(u, _LEAST)
    most = cosine / sine if cosine < FAR * sine else FAR
    grazing = math.atan2(sine, cosine) / (0.5 * math.pi)
    x = (1.0 - grazing) * about_normal(u) - grazing * math.sqrt(-math.log(u))
    goal = u * seen(cosine, sine, most)
    return _refined(cosine, sine, most, goal, x if x < most else 0.0)


@kernel
def _refined(cosine: float, sine: float, most: float, goal: float, x: float) -> float:
    """The root of `seen` = goal below `most`, to the last digits of the goal: by Halley's method
    from a start x near it.  The error after a step is about the cube of that before."""
    for _ in range(64):
        off = goal - seen(cosine, sine, x)
        height = cosine - sine * x
        slope = 2.0 * height * math.exp(-x * x)
        if not (slope > 0.0 and abs(off) > _ROUNDED * goal):
            break
        step = off / slope
        bend = -2.0 * x - sine / height  # the second derivative over the first
        x_next = x + step / max(0.5, 1.0 + 0.5 * step * bend)
        x = x_next if x_next < most else 0.5 * (x + most)
        if abs(step) * (1.0 + abs(bend)) < _CUBED:
            break
    return min(x, most)
