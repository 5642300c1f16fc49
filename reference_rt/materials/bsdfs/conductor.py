"""Conductor: a smooth metal, by Fresnel's equations with a complex index of refraction."""

from typing import ClassVar, Literal, NamedTuple

from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.metal import Metal
from reference_rt.materials.material import NO_BRANCHES, Branches, reflection
from reference_rt.materials.microfacet.fresnel import conductor_colour
from reference_rt.textures import At, Colours, Palette, colour_at


class Conductor(Metal):
    """A smooth metal; black from behind."""

    delta: ClassVar[bool] = True
    type: Literal["conductor"] = "conductor"

    def tabulate(self, palette: Palette) -> "Conductors":
        return Conductors(**self.columns(palette))


class Conductors(NamedTuple):
    """eta (n, 3) and k (n, 3): the index of refraction eta + i k;  reflectance (n)."""

    eta: FloatArray
    k: FloatArray
    reflectance: Colours


@kernel
def branches(conductors: Conductors, i: int, at: At, wo: Vec3) -> Branches:
    """The one mirrored direction."""
    if wo.z <= 0.0:
        return NO_BRANCHES
    f = conductor_colour(wo.z, row(conductors.eta, i), row(conductors.k, i))
    return reflection(wo, f * colour_at(conductors.reflectance, i, at))
