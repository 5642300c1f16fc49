"""Rough dielectric: microfacets of glass (Walter et al. 2007, eq. 20 and 21).

With eta the index of refraction on wi's side over that on wo's, and for radiance (hence the factor
1 / eta², which the eta² of Walter's eq. 17 cancels):

    reflection, h along wo + wi:      f = F D G / (4 |cos wo cos wi|)
    refraction, h along wo + eta wi:  f = (1 - F) D G |wo·h wi·h| / (|cos wo cos wi| |wo + eta wi|²)

This is single scattering; light that would meet a second microfacet is lost: with GGX, eta = 1.5
and normal incidence 0.1 % of the light at alpha = 0.1, 1 % at 0.3 and 11 % at 1 from outside; from
inside 1 %, 10 % and 58 %.
"""

import math
from typing import ClassVar, Literal, NamedTuple

from pydantic import model_validator

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Examples
from reference_rt.core.vec3 import Vec3, dot, max_component, reflect
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.dielectric import Transparent
from reference_rt.materials.bsdfs.rough_conductor import Rough
from reference_rt.materials.material import NO_SAMPLE, BsdfSample, Scattered
from reference_rt.materials.microfacet.fresnel import Refraction, fresnel
from reference_rt.materials.microfacet.ggx_and_smith import (
    Microfacets,
    Roughnesses,
    density,
    g1,
    g1_over_cos,
    half_vector,
    microfacets_at,
    refract,
    refraction_half,
    roughnesses,
    sample_visible,
    visible_density,
)
from reference_rt.textures import At, Colours, Palette, colour_at


class RoughDielectric(Rough, Transparent):
    """A rough boundary of transparent media, by microfacets; the normal points to the exterior."""

    EXAMPLES: ClassVar[Examples] = (
        *Transparent.EXAMPLES,
        {"alpha": (0.1, 0.4)},
        {"distribution": "beckmann", "alpha": 0.3},
        {"alpha": (0.2, "texture")},
    )
    type: Literal["rough_dielectric"] = "rough_dielectric"

    @model_validator(mode="after")
    def _bends(self) -> "RoughDielectric":
        # Directions are off by u, and so the half vector is off by u / |eta - 1|: a thousandth of
        # MIN_ALPHA.
        if abs(self.interior_ior / self.exterior_ior - 1.0) < 1e-9:
            raise ValueError(
                "interior_ior and exterior_ior are equal: such a boundary bends nothing; "
                "expected indices that differ by a billionth or more"
            )
        return self

    def tabulate(self, palette: Palette) -> "RoughDielectrics":
        return RoughDielectrics(
            **self.columns(palette), roughness=roughnesses(self.distribution, self.alpha, palette)
        )


class RoughDielectrics(NamedTuple):
    """eta (n,): interior over exterior index of refraction;  reflectance, transmittance and
    roughness (n)."""

    eta: FloatArray
    reflectance: Colours
    transmittance: Colours
    roughness: Roughnesses


class _Facet(NamedTuple):
    """mirrored, refracted: a microfacet's factors on radiance, without the 1 / eta²;
    share, passing: the probabilities with which `sample` reflects and refracts."""

    mirrored: Vec3
    refracted: Vec3
    share: float
    passing: float


@kernel
def _facet(dielectrics: RoughDielectrics, i: int, at: At, refraction: Refraction) -> _Facet:
    mirrored = colour_at(dielectrics.reflectance, i, at) * refraction.reflectance
    refracted = colour_at(dielectrics.transmittance, i, at) * refraction.transmittance
    r, t = max_component(mirrored), max_component(refracted)
    if r + t == 0.0:
        return _Facet(mirrored, refracted, 1.0, 0.0)
    return _Facet(mirrored, refracted, r / (r + t), t / (r + t))


@kernel
def _fresnel_at(dielectrics: RoughDielectrics, i: int, side: float, cosine: float) -> Refraction:
    """Fresnel's equations for a microfacet at this cosine, from the side of wo.z = `side`."""
    return fresnel(math.copysign(cosine, side), dielectrics.eta[i])


@kernel
def _upwards(v: Vec3, side: float) -> Vec3:
    """`v` mirrored so that wo is above: the microfacets are the same from either side."""
    return Vec3(v.x, v.y, -v.z) if side < 0.0 else v


@kernel
def _mirrored_density(m: Microfacets, wo: Vec3, h: Vec3) -> float:
    """The density of the reflected direction: that of visible normals over 4 wo·h."""
    return 0.25 * g1_over_cos(m, wo) * density(m, h)


@kernel
def eval_pdf(dielectrics: RoughDielectrics, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) |cos wi|, and the density of `sample`."""
    side = wo.z
    if side == 0.0 or wi.z == 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    wo, wi = _upwards(wo, side), _upwards(wi, side)
    m = microfacets_at(dielectrics.roughness, i, at)
    seen = g1_over_cos(m, wo)
    shown = seen * g1(m, wi)
    if wi.z > 0.0:
        half = half_vector(wo, wi)
        facet = _facet(dielectrics, i, at, _fresnel_at(dielectrics, i, side, half.cosine))
        normals = density(m, half.h)
        value = facet.mirrored * (0.25 * normals * shown)
        return Scattered(value, facet.share * (0.25 * seen * normals))
    n = float(dielectrics.eta[i])
    found = refraction_half(wo, wi, n, side > 0.0)
    facet = _facet(dielectrics, i, at, found.refraction)
    normals = density(m, found.h)
    value = facet.refracted * (normals * found.spread * shown)
    eta = n if side > 0.0 else 1.0 / n
    return Scattered(value, facet.passing * seen * normals * found.spread * (eta * eta))


@kernel
def sample(
    dielectrics: RoughDielectrics, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """wo reflected or refracted at a visible microfacet."""
    side = wo.z
    if side == 0.0:
        return NO_SAMPLE
    wo = _upwards(wo, side)
    m = microfacets_at(dielectrics.roughness, i, at)
    h = sample_visible(m, wo, u0, u1)
    refraction = _fresnel_at(dielectrics, i, side, max(0.0, dot(wo, h)))
    facet = _facet(dielectrics, i, at, refraction)
    if u_lobe < facet.share:
        wi = reflect(wo, h)
        density_of_wi = facet.share * _mirrored_density(m, wo, h)
        if wi.z <= 0.0 or density_of_wi == 0.0:
            return NO_SAMPLE
        weight = facet.mirrored * (g1(m, wi) / facet.share)
        return BsdfSample(_upwards(wi, side), weight, density_of_wi, 1.0, False)
    eta, gap = refraction.eta, refraction.gap
    wi = refract(wo, h, refraction)
    spread = refraction.cos_t / (gap * gap)  # wo + eta wi is eta gap h
    density_of_wi = facet.passing * visible_density(m, wo, h) * spread
    if wi.z >= 0.0 or not density_of_wi > 0.0:
        return NO_SAMPLE
    weight = facet.refracted * (g1(m, wi) / (facet.passing * eta * eta))
    return BsdfSample(_upwards(wi, side), weight, density_of_wi, eta, False)
