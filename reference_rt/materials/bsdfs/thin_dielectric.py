"""Thin dielectric: a pane of glass as one surface, light bouncing between its two faces."""

from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Positive
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import Branches, Material
from reference_rt.materials.microfacet.fresnel import fresnel, relative_index
from reference_rt.textures import At, Colours, Palette, ReflectanceParameter, colour_at


class ThinDielectric(Material):
    """A pane too thin to shift what is seen through it; the same from both sides."""

    delta: ClassVar[bool] = True
    type: Literal["thin_dielectric"] = "thin_dielectric"
    interior_ior: Positive = 1.5
    """Index of refraction of the pane."""
    exterior_ior: Positive = 1.0
    """Index of refraction on both its sides."""
    reflectance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """What the mirrored light is multiplied with: 1 is physical."""
    transmittance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """What the light that passes is multiplied with."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.transmittance

    @property
    def transmits(self) -> bool:
        return True

    def tabulate(self, palette: Palette) -> "ThinDielectrics":
        return ThinDielectrics(
            np.array([relative_index(self.interior_ior, self.exterior_ior)]),
            palette.colours(self.reflectance),
            palette.colours(self.transmittance),
        )


class ThinDielectrics(NamedTuple):
    """eta (n,): index of the pane over that around it;  reflectance, transmittance (n)."""

    eta: FloatArray
    reflectance: Colours
    transmittance: Colours


@kernel
def branches(panes: ThinDielectrics, i: int, at: At, wo: Vec3) -> Branches:
    """With R the reflectance of one face, both together mirror R + T R T + T R R R T + ... =
    2 R / (1 + R), and the rest, T / (1 + R), goes straight on, as dense as before (PBR 4ed,
    9.5.3)."""
    face = fresnel(abs(wo.z), panes.eta[i])
    r = 2.0 * face.reflectance / (1.0 + face.reflectance)
    t = face.transmittance / (1.0 + face.reflectance)
    return Branches(
        Vec3(-wo.x, -wo.y, wo.z),
        colour_at(panes.reflectance, i, at) * r,
        -wo,
        colour_at(panes.transmittance, i, at) * t,
        r,
        t,
        1.0,
    )
