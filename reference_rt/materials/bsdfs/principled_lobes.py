"""The lobes of the principled material: the part that each adds to f cos, for wo above.

Burley 2012, "Physically Based Shading at Disney", and Burley 2015, "Extending the Disney BRDF to a
BSDF with Integrated Subsurface Scattering", in Mitsuba's form where the papers leave a choice:
Fresnel's equations for the dielectric part and Schlick's for the coloured ones, separable masking,
and at eta = 1 no main lobe at all, metals included.
"""

import math
from typing import NamedTuple

from reference_rt.core.vec3 import Vec3, luminance, max_component
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import INV_PI
from reference_rt.materials.microfacet.fresnel import Refraction, fresnel
from reference_rt.materials.microfacet.ggx_and_smith import (
    GGX,
    Microfacets,
    density,
    g1,
    g1_over_cos,
)
from reference_rt.sampling.warp import on_circle


class Surface(NamedTuple):
    """The parameters at one point, and for the side that wo is on.

    diffuse, transmitting: the shares (1 - metallic) (1 - spec_trans) and (1 - metallic)
    spec_trans;  coat_alpha: roughness of the clear coat;  eta: index of refraction on the other
    side over that on wo's;  relative_ior: inside over outside;  front: whether wo is outside;
    m: the main lobe's microfacets."""

    base: Vec3
    roughness: float
    metallic: float
    spec_tint: float
    sheen: float
    sheen_tint: float
    clearcoat: float
    coat_alpha: float
    flatness: float
    diffuse: float
    transmitting: float
    eta: float
    relative_ior: float
    front: bool
    m: Microfacets


SHEEN_ALBEDO = 0.1
"""The albedo of a white sheen at grazing angles, where it is brightest (measured)."""

_MIN_ALPHA = 1e-3
"""Mitsuba's: smaller ones count as this."""


@kernel
def microfacets(roughness: float, anisotropic: float) -> Microfacets:
    """GGX microfacets: alpha is the squared roughness, divided between u and v."""
    aspect, alpha = math.sqrt(1.0 - 0.9 * anisotropic), roughness * roughness
    return Microfacets(GGX, max(_MIN_ALPHA, alpha / aspect), max(_MIN_ALPHA, alpha * aspect))


@kernel
def upwards(v: Vec3, side: float) -> Vec3:
    """`v` mirrored so that wo is above: the microfacets are the same from either side."""
    return Vec3(v.x, v.y, -v.z) if side < 0.0 else v


class Facet(NamedTuple):
    """mirrored, refracted: the factors on radiance of a microfacet of the main lobe, without the
    1 / eta²;  share, passing: the probabilities with which `sample` reflects and refracts."""

    mirrored: Vec3
    refracted: Vec3
    share: float
    passing: float


@kernel
def schlick_weight(cosine: float) -> float:
    """(1 - cos)^5 (Schlick 1994)."""
    x = min(max(1.0 - cosine, 0.0), 1.0)
    x2 = x * x
    return x2 * x2 * x


@kernel
def fresnel_at(s: Surface, cosine: float) -> Refraction:
    """Fresnel's equations for a microfacet at this cosine, from wo's side."""
    return fresnel(cosine if s.front else -cosine, s.relative_ior)


@kernel
def _lerp(a: Vec3, b: Vec3, t: float) -> Vec3:
    return a * (1.0 - t) + b * t


@kernel
def tint(base: Vec3) -> Vec3:
    """The colour without its luminance; white for black."""
    y = luminance(base)
    return base / y if y > 0.0 else Vec3(1.0, 1.0, 1.0)


@kernel
def facet(s: Surface, refraction: Refraction) -> Facet:
    """On the outside a mixture of a dielectric, a dielectric of tinted reflection and a metal; on
    the inside a dielectric.  Refracted light is tinted by the root of the base colour, once on its
    way in and once on its way out (Burley 2015, section 5)."""
    f, passing, one = refraction.reflectance, refraction.transmittance, Vec3(1.0, 1.0, 1.0)
    if s.eta == 1.0:
        f, passing = 0.0, 1.0
    root = Vec3(math.sqrt(s.base.x), math.sqrt(s.base.y), math.sqrt(s.base.z))
    refracted = root * (s.transmitting * passing)
    mirrored = one * (s.transmitting * f)
    if s.front:
        r0 = (s.eta - 1.0) / (s.eta + 1.0)
        rise = schlick_weight(refraction.thin)
        plain = one * ((1.0 - s.metallic) * (1.0 - s.spec_tint) * f)
        tinted = _lerp(tint(s.base) * (r0 * r0), one, rise)
        metal = _lerp(s.base, one, rise)
        mirrored = plain + tinted * ((1.0 - s.metallic) * s.spec_tint) + metal * s.metallic
    if f == 0.0:
        mirrored = Vec3(0.0, 0.0, 0.0)
    r, t = max_component(mirrored), max_component(refracted)
    if r + t == 0.0:
        return Facet(mirrored, refracted, 1.0, 0.0)
    return Facet(mirrored, refracted, r / (r + t), t / (r + t))


@kernel
def visible_normals(m: Microfacets, wo: Vec3, h: Vec3) -> float:
    """G1(wo) D(h) / wo.z: the density of visible normals over wo·h."""
    return g1_over_cos(m, wo) * density(m, h)


@kernel
def diffuse(s: Surface, wo: Vec3, wi: Vec3, cos_d: float) -> Vec3:
    """Burley 2012, section 5.3, with the retro-reflection as a term of its own (Burley 2015, eq.
    4), blended by `flatness` with the approximation of subsurface scattering (2012, section 5.3:
    after Hanrahan & Krueger 1993)."""
    f_i, f_o = schlick_weight(wi.z), schlick_weight(wo.z)
    retro = 2.0 * s.roughness * cos_d * cos_d
    lambert = (1.0 - 0.5 * f_i) * (1.0 - 0.5 * f_o)
    surface = lambert + retro * (f_o + f_i + f_o * f_i * (retro - 1.0))
    fall = 0.5 * retro - 1.0
    under = (1.0 + fall * f_i) * (1.0 + fall * f_o)
    skin = 1.25 * (under * (1.0 / (wi.z + wo.z) - 0.5) + 0.5)
    mixed = surface + s.flatness * (skin - surface)
    return s.base * (s.diffuse * mixed * (wi.z * INV_PI))


@kernel
def sheen_colour(s: Surface) -> Vec3:
    """Of all but the metallic part."""
    white = Vec3(1.0, 1.0, 1.0)
    return _lerp(white, tint(s.base), s.sheen_tint) * (s.sheen * (1.0 - s.metallic))


@kernel
def sheen(s: Surface, wi: Vec3, cos_d: float) -> Vec3:
    """Burley 2012, section 5.5: cloth's edges."""
    return sheen_colour(s) * (schlick_weight(cos_d) * wi.z)


@kernel
def coat_fresnel(thin: float) -> float:
    """Schlick's approximation for a lacquer of index 1.5, with the cosine on that side of the base
    which has the smaller index."""
    return 0.04 + 0.96 * schlick_weight(thin)


@kernel
def coat_normals(s: Surface, h: Vec3) -> float:
    """GTR1, Berry's distribution: with long tails (Burley 2012, section 5.4 and eq. 4)."""
    a2 = s.coat_alpha * s.coat_alpha
    return (a2 - 1.0) / (math.pi * math.log(a2) * (h.x * h.x + h.y * h.y + a2 * (h.z * h.z)))


@kernel
def sample_coat(s: Surface, u0: float, u1: float) -> Vec3:
    """A normal with density `coat_normals` times cos (Burley 2012, eq. 6):
    cos² = (1 - a^(2 - 2 u1)) / (1 - a²)."""
    a2 = s.coat_alpha * s.coat_alpha
    grown = math.exp((1.0 - u1) * math.log(a2))
    cos_phi, sin_phi = on_circle(u0)
    r = math.sqrt(max(0.0, grown - a2) / (1.0 - a2))
    return Vec3(r * cos_phi, r * sin_phi, math.sqrt((1.0 - grown) / (1.0 - a2)))


@kernel
def coat(s: Surface, wo: Vec3, wi: Vec3, h: Vec3, thin: float) -> float:
    """A quarter of the strength and masking of roughness 1/4, by eye (Burley 2012, section 5.4);
    its 1 / (4 cos wo cos wi) is left out, as in Mitsuba."""
    m = Microfacets(GGX, 0.25, 0.25)
    shown = g1(m, wo) * g1(m, wi)
    strength = 0.25 * s.clearcoat * coat_fresnel(thin)
    return strength * coat_normals(s, h) * shown * wi.z
