"""Dielectric: smooth glass or water, by Snell's and Fresnel's laws."""

from typing import ClassVar, Literal

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.transparent import Transparent, Transparents
from reference_rt.materials.material import Branches
from reference_rt.materials.microfacet.fresnel import fresnel
from reference_rt.textures import At, colour_at


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
