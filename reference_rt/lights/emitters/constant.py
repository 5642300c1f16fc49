"""Light that is the same everywhere: the constant environment, from every direction; ambient light,
I_a of Whitted's integrator, from none.
"""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour, Description, Examples
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.jit.kernel import kernel
from reference_rt.lights.light import LightSample
from reference_rt.sampling.warp import uniform_sphere


class Ambient(Description):
    """The textbook's ambient light: a `phong` material adds k_a I_a under `whitted`.  No other
    material or integrator uses it."""

    EXAMPLES: ClassVar[Examples] = ({"radiance": (0.1, 0.2, 0.3)},)
    type: Literal["ambient"] = "ambient"
    radiance: Colour
    """The ambient radiance I_a: W sr^-1 m^-2, linear sRGB."""


PDF = 0.25 / math.pi
"""Directions are drawn uniformly over the sphere."""


class Constant(Description):
    """The same radiance from every direction, infinitely far away."""

    EXAMPLES: ClassVar[Examples] = ({"radiance": (0.2, 0.3, 0.4)},)
    type: Literal["constant"] = "constant"
    radiance: Colour
    """Radiance from every direction: W sr^-1 m^-2, linear sRGB."""

    def tabulate(self) -> "Environment":
        return Environment(Vec3(*self.radiance))


class Environment(NamedTuple):
    radiance: Vec3


@kernel
def radiance(environment: Environment, d: Vec3) -> Vec3:
    """The radiance from direction `d`."""
    return environment.radiance


@kernel
def pdf(environment: Environment, d: Vec3) -> float:
    """The density of `sample` per solid angle, in every direction."""
    return PDF


@kernel
def sample(environment: Environment, u0: float, u1: float) -> LightSample:
    """A direction, uniformly over the sphere."""
    wi = uniform_sphere(u0, u1)
    return LightSample(wi, environment.radiance, PDF, wi, math.inf, False)


def power(environment: Environment, scene_radius: float) -> FloatArray:
    """Luminance of the power (1,) into the sphere of the scene's radius R: 4 pi² R² L, its area
    4 pi R² times the irradiance pi L."""
    arriving = luminance(environment.radiance)
    return np.array([4.0 * math.pi * math.pi * scene_radius * scene_radius * arriving])
