"""Rays from outside, with directions of any length: scaled to a safe range, invalid ones marked."""

import math
from typing import NamedTuple

from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, is_finite, max_abs
from reference_rt.jit.kernel import kernel

SHORT = 2.0**-64
"""Directions whose largest component is between SHORT and 1 / SHORT are not scaled: their squares,
also in an instance that is 2^400 times as large, do not underflow."""


class Scaled(NamedTuple):
    """ray: with a direction `unit` times the original one, so that its t times `unit` are those of
    the original;  valid: whether o and d are finite and d is not 0."""

    ray: Ray
    unit: float
    valid: bool


@kernel
def scaled(o: Vec3, d: Vec3, t_max: float) -> Scaled:
    """Scales very long and very short directions, whose squares would leave the range of float64,
    by a power of two, which changes no bit of the results."""
    unit, valid = 1.0, is_finite(o) and is_finite(d) and max_abs(d) > 0.0
    if valid and not SHORT <= max_abs(d) <= 1.0 / SHORT:
        _, exponent = math.frexp(max_abs(d))
        unit = math.ldexp(1.0, -min(max(exponent, -1000), 1000))
        d = d * unit
    return Scaled(Ray(o, d, t_max / unit), unit, valid)


@kernel
def is_representable(t: float, p: Vec3) -> bool:
    """Whether a hit is representable in float64: 0 < t < inf and p finite."""
    return 0.0 < t < math.inf and is_finite(p)
