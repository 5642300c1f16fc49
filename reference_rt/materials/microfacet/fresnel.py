"""Fresnel's equations: the fractions of light that a smooth boundary reflects and refracts."""

import math
from typing import NamedTuple

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel

MOST_INDEX = 1e70
"""Relative indices are clamped to this and to one over it, so that their fourth powers are
floats."""


def relative_index(interior: float, exterior: float) -> float:
    """The index inside over that outside."""
    return min(max(interior / exterior, 1.0 / MOST_INDEX), MOST_INDEX)


class Refraction(NamedTuple):
    """Reflection and refraction at a smooth boundary.

    reflectance, transmittance: the fractions of power, each to its last digits, (1, 0) for total
    internal reflection;  cos_t: the cosine of the refracted direction;  eta: index on its side over
    that on wo's side;  gap: cos_o / eta - cos_t, without cancellation: the refracted direction is
    gap n - wo / eta;  thin: the cosine on the side of the smaller index.
    """

    reflectance: float
    transmittance: float
    cos_t: float
    eta: float
    gap: float
    thin: float


@kernel
def fresnel(cos_o: float, n: float) -> Refraction:
    """Unpolarised Fresnel reflectance and Snell's law (PBR 4ed, 9.5.1), for the index `n` inside
    over that outside;  `cos_o` = wo·normal, negative inside.

    With c the cosine outside and g n times the one inside, g² - c² = n² - 1 = k, and the amplitudes
    (c - g) / (c + g) and (n² c - g) / (n² c + g) become

        -k / (c + g)²   and   k ((n² + 1) c² - 1) / (n² c + g)²,

    or with (n² + 1) g² - n⁴, which is the same.  No digits are lost where the indices are nearly
    equal, nor by computing a small transmittance as 1 - R.
    """
    k = (n - 1.0) * (n + 1.0)
    cosine = abs(cos_o)
    if cos_o > 0.0:
        eta, c = n, cosine
        other2 = c * c + k
    else:
        eta, g = 1.0 / n, n * cosine
        other2 = g * g - k
    if other2 <= 0.0:
        return Refraction(1.0, 0.0, 0.0, eta, cosine / eta, 0.0)
    if cos_o > 0.0:
        g = math.sqrt(other2)
        cos_t = g / n
    else:
        c = math.sqrt(other2)
        cos_t = c
    n2 = n * n
    s_sum, p_sum = c + g, n2 * c + g
    s = k / (s_sum * s_sum)
    beyond = (n2 + 1.0) * c * c - 1.0 if n > 1.0 else (n2 + 1.0) * g * g - n2 * n2
    p = k * beyond / (p_sum * p_sum)
    reflectance = min(1.0, 0.5 * (s * s + p * p))
    passing = 2.0 * c * g * (1.0 / (s_sum * s_sum) + n2 / (p_sum * p_sum))
    gap = -k / (n * s_sum) if cos_o > 0.0 else k / s_sum
    thin = c if n > 1.0 else g / n
    return Refraction(reflectance, passing, cos_t, eta, gap, thin)


@kernel
def conductor_reflectance(cos_o: float, eta: float, k: float) -> float:
    """Unpolarised Fresnel reflectance of an absorbing medium of index eta + i k, relative to the
    medium outside, for 0 <= cos_o <= 1 (PBR 4ed, 9.3.6, in real arithmetic: Lazányi &
    Szirmay-Kalos 2005, eq. 2-3).

    a² + b² = |(eta + ik)² - sin²|, a the real part of its root.  The root's square is cos² + e with
    e = (eta + ik)² - 1, so that a small reflectance is |e|² / |cos + root|⁴, without cancellation.
    """
    cos2 = cos_o * cos_o
    sin2 = (1.0 - cos_o) * (1.0 + cos_o)
    e = (eta - 1.0) * (eta + 1.0) - k * k
    # Two equal forms: the one of smaller terms.
    p = cos2 + e if cos2 < 0.5 else (eta - k) * (eta + k) - sin2
    q = 2.0 * eta * k
    modulus = math.sqrt(p * p + q * q)
    a2 = 0.5 * (modulus + p)
    if p < 0.0:
        a2 = 0.5 * q * q / (modulus - p)  # without cancellation
    a = math.sqrt(a2)
    # Sums of numbers that are not negative, and differences, which are divided by them.
    s_high = modulus + cos2 + 2.0 * a * cos_o
    s_low = modulus + cos2 - 2.0 * a * cos_o
    p_high = cos2 * modulus + sin2 * sin2 + 2.0 * a * cos_o * sin2
    p_low = cos2 * modulus + sin2 * sin2 - 2.0 * a * cos_o * sin2
    if s_high == 0.0:
        return 1.0
    s = s_low / s_high
    if s < 0.5:
        e, f = e / s_high, q / s_high
        s = e * e + f * f
    ratio = 1.0 if p_high == 0.0 else max(0.0, p_low / p_high)
    return 0.5 * s * (1.0 + ratio)


@kernel
def conductor_colour(cos_o: float, eta: Vec3, k: Vec3) -> Vec3:
    """`conductor_reflectance` for the three primaries."""
    return Vec3(
        conductor_reflectance(cos_o, eta.x, k.x),
        conductor_reflectance(cos_o, eta.y, k.y),
        conductor_reflectance(cos_o, eta.z, k.z),
    )
