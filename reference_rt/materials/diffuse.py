"""Diffuse: Lambert's law, f = reflectance / pi, on the front side."""

from typing import Literal, NamedTuple

import numpy as np

from reference_rt.description import Reflectance
from reference_rt.kernel import kernel
from reference_rt.materials.material import INV_PI, BsdfSample, Material, no_sample
from reference_rt.sampling.warp import cosine_hemisphere
from reference_rt.shapes.shape import FloatArray
from reference_rt.vec3 import Vec3, row


class Diffuse(Material):
    """Scatters equally to all sides of its front; its back is black."""

    type: Literal["diffuse"] = "diffuse"
    reflectance: Reflectance = (0.5, 0.5, 0.5)

    @property
    def colour(self) -> tuple[float, float, float]:
        return self.reflectance

    def tabulate(self) -> "Diffuses":
        return Diffuses(np.array([self.reflectance]))


class Diffuses(NamedTuple):
    """reflectance (n, 3), linear sRGB."""

    reflectance: FloatArray


@kernel
def evaluate(diffuses: Diffuses, i: int, wo: Vec3, wi: Vec3) -> Vec3:
    """f(wo, wi) cos wi."""
    if wo.z <= 0.0 or wi.z <= 0.0:
        return Vec3(0.0, 0.0, 0.0)
    return row(diffuses.reflectance, i) * (wi.z * INV_PI)


@kernel
def pdf(wo: Vec3, wi: Vec3) -> float:
    """The density of `sample` per solid angle: cos wi / pi."""
    if wo.z <= 0.0 or wi.z <= 0.0:
        return 0.0
    return wi.z * INV_PI


@kernel
def sample(diffuses: Diffuses, i: int, wo: Vec3, u0: float, u1: float) -> BsdfSample:
    """A direction with density cos / pi: the weight is the reflectance."""
    if wo.z <= 0.0:
        return no_sample()
    wi = cosine_hemisphere(u0, u1)
    return BsdfSample(wi, row(diffuses.reflectance, i), wi.z * INV_PI, 1.0, False)
