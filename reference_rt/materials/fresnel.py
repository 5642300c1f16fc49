"""Fresnel's equations: how much of the light a smooth boundary mirrors."""

import math
from typing import NamedTuple

from reference_rt.kernel import kernel
from reference_rt.vec3 import Vec3


class Refraction(NamedTuple):
    """reflectance: the fraction of power that is reflected, 1 for total internal reflection;
    cos_t: the cosine of the refracted direction;  eta: index on its side over that on wo's."""

    reflectance: float
    cos_t: float
    eta: float


@kernel
def fresnel(cos_o: float, interior_over_exterior: float) -> Refraction:
    """Unpolarised Fresnel reflectance and Snell's law (PBR 4ed, 9.5.1).

    `cos_o` = wo·n, negative inside.
    """
    eta = interior_over_exterior if cos_o > 0.0 else 1.0 / interior_over_exterior
    cos_i = abs(cos_o)
    # 1 - sin²t as a sum of squares' differences keeps its sign exact near the critical angle.
    cos2_t = 1.0 - (1.0 - cos_i) * (1.0 + cos_i) / (eta * eta)
    if cos2_t <= 0.0:
        return Refraction(1.0, 0.0, eta)
    cos_t = math.sqrt(cos2_t)
    parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return Refraction(0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t, eta)


@kernel
def conductor_reflectance(cos_o: float, eta: float, k: float) -> float:
    """Unpolarised Fresnel reflectance of an absorbing medium of index eta + i k, relative to the
    medium outside, for 0 <= cos_o <= 1 (PBR 4ed, 9.3.6, in real arithmetic: Lazányi &
    Szirmay-Kalos 2005, eq. 2-3).

    a² + b² = |(eta + ik)² - sin²|, a the real part of its root.
    """
    cos2 = cos_o * cos_o
    sin2 = (1.0 - cos_o) * (1.0 + cos_o)
    p = (eta - k) * (eta + k) - sin2
    q = 2.0 * eta * k
    modulus = math.sqrt(p * p + q * q)
    a2 = 0.5 * (modulus + p)
    if p < 0.0:
        a2 = 0.5 * q * q / (modulus - p)  # without cancellation
    a = math.sqrt(a2)
    # Sums of what is not negative, and differences over them.
    s_high = modulus + cos2 + 2.0 * a * cos_o
    s_low = modulus + cos2 - 2.0 * a * cos_o
    p_high = cos2 * modulus + sin2 * sin2 + 2.0 * a * cos_o * sin2
    p_low = cos2 * modulus + sin2 * sin2 - 2.0 * a * cos_o * sin2
    if s_high == 0.0:
        return 1.0
    s = max(0.0, s_low / s_high)
    ratio = 1.0 if p_high == 0.0 else max(0.0, p_low / p_high)
    return 0.5 * s * (1.0 + ratio)


@kernel
def conductor_colour(cos_o: float, eta: Vec3, k: Vec3) -> Vec3:
    """The same for three wavelengths."""
    return Vec3(
        conductor_reflectance(cos_o, eta.x, k.x),
        conductor_reflectance(cos_o, eta.y, k.y),
        conductor_reflectance(cos_o, eta.z, k.z),
    )
