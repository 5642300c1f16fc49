"""Rough conductor: microfacets of a metal (Cook & Torrance 1982; Walter et al. 2007, eq. 20).

f = F D G / (4 cos wo cos wi): single scattering; light that would meet a second microfacet is lost.
With GGX and F = 1 that is, at normal incidence, 1 % of the light at alpha = 0.1, 12 % at 0.3 and
log 2 = 69 % at 1.
"""

from typing import ClassVar, Literal, NamedTuple

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Examples
from reference_rt.core.vec3 import Vec3, dot, reflect, row
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.conductor import Metal
from reference_rt.materials.material import NO_SAMPLE, BsdfSample, Material, Scattered
from reference_rt.materials.microfacet.fresnel import conductor_colour
from reference_rt.materials.microfacet.ggx_and_smith import (
    AlphaParameter,
    Distribution,
    Roughnesses,
    density,
    g1,
    g1_over_cos,
    half_vector,
    microfacets_at,
    roughnesses,
    sample_visible,
)
from reference_rt.textures import At, Colours, Palette, colour_at


class Rough(Material):
    """A boundary of microfacets."""

    smooth: ClassVar[bool] = True
    distribution: Distribution = "ggx"
    """The distribution of microfacet normals: GGX (Trowbridge-Reitz) or Beckmann."""
    alpha: AlphaParameter = (0.1, 0.1)
    """Roughness: the root mean square slope for `beckmann`.  A number, two [along u, along v], or a
    texture; above 0, at most 10.  Below 1e-4 it counts as 1e-4."""

    @property
    def oriented(self) -> bool:
        return not isinstance(self.alpha, str) and self.alpha[0] != self.alpha[1]


class RoughConductor(Rough, Metal):
    """A rough metal, by microfacets; black from behind."""

    EXAMPLES: ClassVar[Examples] = (
        *Metal.EXAMPLES,
        {"eta": 0.2, "k": 3.0, "alpha": (0.1, 0.4)},
        {"eta": 0.2, "k": 3.0, "distribution": "beckmann", "alpha": 0.3},
        {"eta": 0.2, "k": 3.0, "alpha": "texture"},
    )
    uses_u_lobe: ClassVar[bool] = False
    type: Literal["rough_conductor"] = "rough_conductor"

    def tabulate(self, palette: Palette) -> "RoughConductors":
        return RoughConductors(
            **self.columns(palette), roughness=roughnesses(self.distribution, self.alpha, palette)
        )


class RoughConductors(NamedTuple):
    """eta (n, 3) and k (n, 3): the index of refraction eta + i k;  reflectance (n);  roughness
    (n)."""

    eta: FloatArray
    k: FloatArray
    reflectance: Colours
    roughness: Roughnesses


@kernel
def _mirrored(conductors: RoughConductors, i: int, at: At, cosine: float) -> Vec3:
    """The reflectance of a microfacet at this angle of incidence."""
    f = conductor_colour(min(1.0, cosine), row(conductors.eta, i), row(conductors.k, i))
    return f * colour_at(conductors.reflectance, i, at)


@kernel
def eval_pdf(conductors: RoughConductors, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) cos wi, and the density of `sample`: that of visible normals over 4 wo·h."""
    if wo.z <= 0.0 or wi.z <= 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    m = microfacets_at(conductors.roughness, i, at)
    half = half_vector(wo, wi)
    normals = 0.25 * g1_over_cos(m, wo) * density(m, half.h)
    return Scattered(_mirrored(conductors, i, at, half.cosine) * (normals * g1(m, wi)), normals)


@kernel
def sample(
    conductors: RoughConductors, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """wo reflected at a visible microfacet: the weight is F G1(wi)."""
    if wo.z <= 0.0:
        return NO_SAMPLE
    m = microfacets_at(conductors.roughness, i, at)
    h = sample_visible(m, wo, u0, u1)
    wi = reflect(wo, h)
    density_of_wi = 0.25 * g1_over_cos(m, wo) * density(m, h)
    if wi.z <= 0.0 or density_of_wi == 0.0:
        return NO_SAMPLE
    weight = _mirrored(conductors, i, at, dot(wo, h)) * g1(m, wi)
    return BsdfSample(wi, weight, density_of_wi, 1.0, False)
