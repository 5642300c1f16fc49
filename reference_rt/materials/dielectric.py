"""Dielectric: smooth glass or water, by Snell's and Fresnel's laws."""

import math
from typing import Literal, NamedTuple

import numpy as np

from reference_rt.description import Positive
from reference_rt.kernel import kernel
from reference_rt.materials.material import Branches, Material
from reference_rt.shapes.shape import FloatArray
from reference_rt.vec3 import Vec3


class Dielectric(Material):
    """A smooth boundary of two transparent media; the normal points to the exterior."""

    type: Literal["dielectric"] = "dielectric"
    interior_ior: Positive = 1.5
    """Index of refraction behind the normal."""
    exterior_ior: Positive = 1.0
    """Index of refraction on the normal's side."""

    @property
    def colour(self) -> tuple[float, float, float]:
        return 1.0, 1.0, 1.0

    def tabulate(self) -> "Dielectrics":
        return Dielectrics(np.array([self.interior_ior / self.exterior_ior]))


class Dielectrics(NamedTuple):
    """eta (n,): interior over exterior index of refraction."""

    eta: FloatArray


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
def branches(dielectrics: Dielectrics, i: int, wo: Vec3) -> Branches:
    """Reflection F and refraction (1 - F) / eta²: radiance gathers where light slows down."""
    refraction = fresnel(wo.z, dielectrics.eta[i])
    f = refraction.reflectance
    t = (1.0 - f) / (refraction.eta * refraction.eta)
    cos_t = -refraction.cos_t if wo.z > 0.0 else refraction.cos_t
    return Branches(
        Vec3(-wo.x, -wo.y, wo.z),
        Vec3(f, f, f),
        Vec3(-wo.x / refraction.eta, -wo.y / refraction.eta, cos_t),
        Vec3(t, t, t),
        f,
        refraction.eta,
    )
