"""Point light: equal intensity to all sides."""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour, Description, Examples, Vector
from reference_rt.core.vec3 import Vec3, luminance, row
from reference_rt.jit.kernel import kernel
from reference_rt.lights.light import LightSample, from_position
from reference_rt.lights.selection.bounds import LightBounds, of_points
from reference_rt.textures import NO_TEXTURES, Palette


class Point(Description):
    """A point that emits the same intensity in all directions."""

    EXAMPLES: ClassVar[Examples] = ({"position": (0.0, 3.0, 0.0), "intensity": (1.0, 2.0, 3.0)},)
    type: Literal["point"] = "point"
    position: Vector
    """Where it is: [x, y, z] in world coordinates, in scene units."""
    intensity: Colour
    """Radiant intensity in every direction: W sr^-1, linear sRGB."""

    def tabulate(self, palette: Palette = NO_TEXTURES) -> "Points":
        return Points(np.array([self.position]), np.array([self.intensity]))


class Points(NamedTuple):
    """position (n, 3), intensity (n, 3) in W sr^-1."""

    position: FloatArray
    intensity: FloatArray


@kernel
def sample(points: Points, i: int, p: Vec3) -> LightSample:
    """The one direction to the light: see `from_position`."""
    return from_position(row(points.position, i), row(points.intensity, i), 1.0, p)


def power(points: Points, scene_radius: float) -> FloatArray:
    """Luminance of the power (n,): 4 pi I."""
    return np.asarray(4.0 * math.pi * luminance(Vec3(*points.intensity.T)))


def bounds(points: Points) -> LightBounds:
    """All sides, as those of a group of normals that face any way."""
    n = len(points.position)
    intensity = np.asarray(luminance(Vec3(*points.intensity.T)))
    found = of_points(points.position, np.tile([0.0, 0.0, 1.0], (n, 1)), np.zeros(n), intensity)
    return found._replace(spread=np.full(n, math.pi))
