"""Dielectric: smooth glass or water, by Snell's and Fresnel's laws; `Transparent`, the description
of smooth, thin and rough dielectrics; and the table of the first two.
"""

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Examples, Positive
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import Branches, Material
from reference_rt.materials.microfacet.fresnel import fresnel, relative_index
from reference_rt.textures import At, Colours, Palette, ReflectanceParameter, colour_at


class Transparent(Material):
    """A boundary of two transparent media."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {
            "interior_ior": 1.0,
            "exterior_ior": 1.3,
            "reflectance": (0.9, 0.8, 0.7),
            "transmittance": (0.5, 0.6, 0.7),
        },
        {"reflectance": "texture", "transmittance": "texture"},
    )
    type: str  # first, so that `to_json` writes it first
    interior_ior: Positive = 1.5
    """Index of refraction of the interior, behind the normal."""
    exterior_ior: Positive = 1.0
    """Index of refraction of the exterior, which the normal points to."""
    reflectance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """A factor of the reflected light: linear sRGB from 0 to 1, or a texture.  The default, 1, is
    physical."""
    transmittance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """A factor of the refracted light: linear sRGB from 0 to 1, or a texture.  The default, 1, is
    physical."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.transmittance

    @property
    def transmits(self) -> bool:
        return True

    def tabulate(self, palette: Palette) -> Any:
        return Transparents(**self.columns(palette))

    def columns(self, palette: Palette) -> dict[str, Any]:
        """The columns that the tables share, one row: eta, reflectance, transmittance."""
        return {
            "eta": np.array([relative_index(self.interior_ior, self.exterior_ior)]),
            "reflectance": palette.colours(self.reflectance),
            "transmittance": palette.colours(self.transmittance),
        }


class Transparents(NamedTuple):
    """eta (n,): index of refraction of the interior (of a pane) over that of the exterior;
    reflectance, transmittance (n)."""

    eta: FloatArray
    reflectance: Colours
    transmittance: Colours


class Dielectric(Transparent):
    """A smooth boundary of two transparent media; the normal points to the exterior."""

    delta: ClassVar[bool] = True
    type: Literal["dielectric"] = "dielectric"


@kernel
def branches(dielectrics: Transparents, i: int, at: At, wo: Vec3) -> Branches:
    """Factor F for the reflection and T / eta² for the refraction: the radiance of refracted light
    scales with the square of the index."""
    refraction = fresnel(wo.z, dielectrics.eta[i])
    f, passing = refraction.reflectance, refraction.transmittance
    t = passing / (refraction.eta * refraction.eta)
    cos_t = -refraction.cos_t if wo.z > 0.0 else refraction.cos_t
    return Branches(
        Vec3(-wo.x, -wo.y, wo.z),
        colour_at(dielectrics.reflectance, i, at) * f,
        Vec3(-wo.x / refraction.eta, -wo.y / refraction.eta, cos_t),
        colour_at(dielectrics.transmittance, i, at) * t,
        f,
        passing,
        refraction.eta,
    )
