"""Conductor: a smooth metal, by Fresnel's equations with a complex index of refraction."""

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Colour
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import Branches, Material, no_branches, reflection
from reference_rt.materials.microfacet.fresnel import conductor_colour
from reference_rt.textures import At, Colours, Palette, ReflectanceParameter, colour_at


def _above_zero(eta: tuple[float, float, float]) -> tuple[float, float, float]:
    if min(eta) <= 0.0:
        raise ValueError(f"expected indices of refraction above 0, got {min(eta):g}")
    return eta


Index = Annotated[Colour, AfterValidator(_above_zero)]
"""Real parts of indices of refraction at the three primaries, above 0."""


class Conductor(Material):
    """A smooth metal; its back is black."""

    delta: ClassVar[bool] = True
    type: Literal["conductor"] = "conductor"
    eta: Index
    """The index of refraction, relative to what is outside."""
    k: Colour
    """The extinction coefficient: the imaginary part of the index."""
    reflectance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """What the mirrored light is multiplied with: 1 is physical."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return metal_colour(self.eta, self.k, self.reflectance)

    def tabulate(self, palette: Palette) -> "Conductors":
        return Conductors(
            np.array([self.eta]), np.array([self.k]), palette.colours(self.reflectance)
        )


class Conductors(NamedTuple):
    """eta (n, 3) and k (n, 3): the index of refraction eta + i k;  reflectance (n)."""

    eta: FloatArray
    k: FloatArray
    reflectance: Colours


def metal_colour(
    eta: tuple[float, float, float],
    k: tuple[float, float, float],
    reflectance: tuple[float, float, float] | str,
) -> tuple[float, float, float] | str:
    """What a metal mirrors straight back; the texture, where it has one."""
    if isinstance(reflectance, str):
        return reflectance
    r, g, b = conductor_colour(1.0, Vec3(*eta), Vec3(*k)) * Vec3(*reflectance)
    return r, g, b


@kernel
def branches(conductors: Conductors, i: int, at: At, wo: Vec3) -> Branches:
    """The one mirrored direction."""
    if wo.z <= 0.0:
        return no_branches()
    f = conductor_colour(wo.z, row(conductors.eta, i), row(conductors.k, i))
    return reflection(wo, f * colour_at(conductors.reflectance, i, at))
