"""Maps from the unit square to shapes and directions, each with its density."""

import math

from reference_rt.kernel import kernel
from reference_rt.vec3 import Vec3


@kernel
def cosine_hemisphere(u0: float, u1: float) -> Vec3:
    """A direction with density cos theta / pi: the disk lifted to the hemisphere (Malley)."""
    r = math.sqrt(u0)
    phi = 2.0 * math.pi * u1
    return Vec3(r * math.cos(phi), r * math.sin(phi), math.sqrt(1.0 - u0))


@kernel
def uniform_sphere(u0: float, u1: float) -> Vec3:
    """A direction with density 1 / (4 pi) (Archimedes: height is uniform)."""
    z = 1.0 - 2.0 * u0
    r = math.sqrt(max(0.0, 1.0 - z * z))
    phi = 2.0 * math.pi * u1
    return Vec3(r * math.cos(phi), r * math.sin(phi), z)
