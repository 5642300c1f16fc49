"""Mirror: R = 2 (wo·n) n - wo, times a colour, on the front side."""

from typing import Literal, NamedTuple

import numpy as np

from reference_rt.description import Reflectance
from reference_rt.kernel import kernel
from reference_rt.materials.material import Branches, Material, no_branches
from reference_rt.shapes.shape import FloatArray
from reference_rt.vec3 import Vec3, row


class Mirror(Material):
    """A perfect mirror with a colour (the text-book's k_r); its back is black."""

    type: Literal["mirror"] = "mirror"
    reflectance: Reflectance = (1.0, 1.0, 1.0)

    @property
    def colour(self) -> tuple[float, float, float]:
        return self.reflectance

    def tabulate(self) -> "Mirrors":
        return Mirrors(np.array([self.reflectance]))


class Mirrors(NamedTuple):
    """reflectance (n, 3), linear sRGB."""

    reflectance: FloatArray


@kernel
def branches(mirrors: Mirrors, i: int, wo: Vec3) -> Branches:
    """The one mirrored direction."""
    if wo.z <= 0.0:
        return no_branches()
    zero = Vec3(0.0, 0.0, 0.0)
    return Branches(Vec3(-wo.x, -wo.y, wo.z), row(mirrors.reflectance, i), zero, zero, 1.0, 1.0)
