"""Constant environment: the same radiance from every direction."""

import math
from typing import Literal, NamedTuple

import numpy as np

from reference_rt.description import Colour, Description
from reference_rt.kernel import kernel
from reference_rt.lights.light import LightSample
from reference_rt.sampling.warp import uniform_sphere
from reference_rt.shapes.shape import FloatArray
from reference_rt.vec3 import Vec3, row

PDF = 0.25 / math.pi
"""Directions are drawn uniformly over the sphere."""


class Constant(Description):
    """Shines equally from infinitely far away on all sides."""

    type: Literal["constant"] = "constant"
    radiance: Colour
    """W sr^-1 m^-2, linear sRGB."""

    def tabulate(self) -> "Environment":
        return Environment(np.array([self.radiance]))


class Environment(NamedTuple):
    """radiance (1, 3)."""

    radiance: FloatArray


@kernel
def sample(environment: Environment, u0: float, u1: float) -> LightSample:
    wi = uniform_sphere(u0, u1)
    return LightSample(wi, row(environment.radiance, 0), PDF, wi, math.inf, False)


@kernel
def background(environment: Environment | None) -> Vec3:
    """The radiance of a ray that hits nothing."""
    if environment is None:
        return Vec3(0.0, 0.0, 0.0)
    return row(environment.radiance, 0)
