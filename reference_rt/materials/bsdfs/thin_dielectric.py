"""Thin dielectric: a pane of glass as one surface, with all reflections between its faces."""

from typing import ClassVar, Literal, NamedTuple

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Positive
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.dielectric import Transparent
from reference_rt.materials.material import Branches
from reference_rt.materials.microfacet.fresnel import fresnel
from reference_rt.textures import At, Colours, Palette, ReflectanceParameter, colour_at


class ThinDielectric(Transparent):
    """A pane too thin to shift what is seen through it; the same from both sides."""

    delta: ClassVar[bool] = True
    type: Literal["thin_dielectric"] = "thin_dielectric"
    interior_ior: Positive = 1.5
    """Index of refraction of the pane."""
    exterior_ior: Positive = 1.0
    """Index of refraction of the medium on both sides."""
    transmittance: ReflectanceParameter = (1.0, 1.0, 1.0)
    """A factor of the light that passes: linear sRGB from 0 to 1, or a texture.  The default, 1, is
    physical."""

    def tabulate(self, palette: Palette) -> "Panes":
        return Panes(**self.columns(palette))


class Panes(NamedTuple):
    """As `Transparents`, of n panes."""

    eta: FloatArray
    reflectance: Colours
    transmittance: Colours


@kernel
def branches(panes: Panes, i: int, at: At, wo: Vec3) -> Branches:
    """With R the reflectance of one face, the two together reflect R + T R T + T R R R T + ... =
    2 R / (1 + R).  The rest, T / (1 + R), passes undeviated, its radiance unchanged (PBR 4ed,
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
