"""Directional light: parallel light from infinitely far away, as the sun's."""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour, Description, Direction, Examples
from reference_rt.core.vec3 import Vec3, luminance, row
from reference_rt.jit.kernel import kernel
from reference_rt.lights.light import LightSample
from reference_rt.textures import NO_TEXTURES, Palette


class Directional(Description):
    """Parallel light from infinitely far away, such as the sun's without its size."""

    EXAMPLES: ClassVar[Examples] = (
        {"direction": (1.0, -2.0, -1.0), "irradiance": (0.3, 0.4, 0.5)},
    )
    type: Literal["directional"] = "directional"
    direction: Direction
    """The direction in which light travels, away from its source: world coordinates, of any length
    but 0."""
    irradiance: Colour
    """Irradiance on a plane perpendicular to the light: W m^-2, linear sRGB."""

    def tabulate(self, palette: Palette = NO_TEXTURES) -> "Directionals":
        away = np.array(self.direction) / math.hypot(*self.direction)
        return Directionals(-away[None], np.array([self.irradiance]))


class Directionals(NamedTuple):
    """towards (n, 3): the unit direction towards the light; irradiance (n, 3) across it."""

    towards: FloatArray
    irradiance: FloatArray


@kernel
def sample(directionals: Directionals, i: int) -> LightSample:
    """The one direction, with the full irradiance."""
    wi = row(directionals.towards, i)
    return LightSample(wi, row(directionals.irradiance, i), 1.0, wi, math.inf, True)


def power(directionals: Directionals, scene_radius: float) -> FloatArray:
    """Luminance of the power (n,) through the disk of the scene's radius R: pi R² E."""
    irradiance = luminance(Vec3(*directionals.irradiance.T))
    return np.asarray(math.pi * scene_radius * scene_radius * irradiance)
