"""Rays with directions of any length, and of numbers that are none."""

import math
from typing import NamedTuple

from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, is_finite, max_abs
from reference_rt.jit.kernel import kernel

SHORT = 2.0**-64
"""Of a direction: its square, and that of the same of an instance 2^400 times as large, are not 0.
What is neither shorter nor longer than the inverse is left alone."""


class Scaled(NamedTuple):
    """A ray whose direction is `unit` times as long as what was asked with: its t times `unit` are
    those of the question;  valid: whether it is a ray, of finite numbers and d != 0."""

    ray: Ray
    unit: float
    valid: bool


@kernel
def scaled(o: Vec3, d: Vec3, t_max: float) -> Scaled:
    """By a power of two, which changes no bit of what is computed: squares of directions that are
    very long or short would leave the range of float64."""
    unit, valid = 1.0, is_finite(o) and is_finite(d) and max_abs(d) > 0.0
    if valid and not SHORT <= max_abs(d) <= 1.0 / SHORT:
        _, exponent = math.frexp(max_abs(d))
        unit = math.ldexp(1.0, -min(max(exponent, -1000), 1000))
        d = d * unit
    return Scaled(Ray(o, d, t_max / unit), unit, valid)


@kernel
def is_told(t: float, p: Vec3) -> bool:
    """Whether float64 has numbers for a hit."""
    return 0.0 < t < math.inf and is_finite(p)
