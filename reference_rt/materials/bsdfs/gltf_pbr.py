"""glTF's metallic-roughness material: appendix B of the glTF 2.0 specification, as written there.

With V = wo, L = wi, H the half vector, alpha = roughness² and w = (1 - V·H)^5,

    specular   = D G / (4 N·V N·L), GGX and the height-correlated G of Smith (Heitz 2014)
    metal      = (base + (1 - base) w) specular
    dielectric = (1 - s max F) base / pi + s F specular,  F = F0 + (1 - F0) w
    f          = (1 - metallic) dielectric + metallic metal,

F0 = ((1 - ior) / (1 + ior))² times the specular colour.  The index is that of KHR_materials_ior,
s and the specular colour are those of KHR_materials_specular; without the extensions F0 is 0.04 and
s is 1.

Light that would meet a second microfacet is lost, so that a metal scatters less than arrives.  The
dielectric does not conserve energy, as the appendix says: F depends on V·H, and at grazing angles
the base keeps nearly all its light besides what the microfacets mirror.  A white one reflects, at a
cosine of 1e-3, 1.92 of the light with roughness 0, 1.16 with 0.5 and 1.02 with 1 (by quadrature).
"""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Examples
from reference_rt.core.vec3 import Vec3, max_component, reflect
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.principled_lobes import schlick_weight
from reference_rt.materials.material import INV_PI, NO_SAMPLE, BsdfSample, Material, Scattered
from reference_rt.materials.microfacet.ggx_and_smith import (
    GGX,
    MIN_ALPHA,
    Microfacets,
    density,
    g1_over_cos,
    half_vector,
    sample_visible,
)
from reference_rt.sampling.warp import cosine_hemisphere
from reference_rt.textures import (
    At,
    Colours,
    Numbers,
    Palette,
    ReflectanceParameter,
    UnitParameter,
    colour_at,
    number_at,
)

_LEAST_MIRRORED = 0.05
"""The least Fresnel factor that lobe probabilities assume: a black metal mirrors nothing head-on,
but all at grazing angles."""


class GltfPbr(Material):
    """glTF's metallic-roughness material; black from behind, unless it is in a `two_sided`."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"base_color": (0.7, 0.4, 0.1), "metallic": 0.3, "roughness": 0.4, "ior": 1.8},
        {"metallic": 0.0, "specular": 0.6, "specular_color": (0.9, 0.6, 0.3)},
        dict.fromkeys(
            ("base_color", "metallic", "roughness", "specular", "specular_color"), "texture"
        ),
    )
    smooth: ClassVar[bool] = True
    type: Literal["gltf_pbr"] = "gltf_pbr"
    base_color: ReflectanceParameter = (1.0, 1.0, 1.0)
    """Colour of the diffuse base, and of a metal seen head-on: linear sRGB from 0 to 1, or a
    texture."""
    metallic: UnitParameter = 1.0
    """Blends from a dielectric (0) to a metal (1)."""
    roughness: UnitParameter = 1.0
    """Square root of the GGX roughness alpha, from 0 to 1; alpha below 1e-4 counts as 1e-4."""
    ior: float = Field(default=1.5, ge=0.0)
    """Index of refraction of the dielectric part; 0 mirrors all, as an infinite one."""
    specular: UnitParameter = 1.0
    """Strength of the dielectric part's highlight, from 0 to 1."""
    specular_color: ReflectanceParameter = (1.0, 1.0, 1.0)
    """Colour of the dielectric part's highlight seen head-on: linear sRGB from 0 to 1, or a
    texture."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.base_color

    def tabulate(self, palette: Palette) -> "GltfPbrs":
        # Of 1 / ior where that is smaller: the square is the same, and no index overflows.
        n = min(self.ior, 1.0 / self.ior) if self.ior > 0.0 else 0.0
        return GltfPbrs(
            palette.colours(self.base_color),
            palette.numbers(self.metallic),
            palette.numbers(self.roughness),
            np.array([((1.0 - n) / (1.0 + n)) ** 2]),
            palette.numbers(self.specular),
            palette.colours(self.specular_color),
        )


class GltfPbrs(NamedTuple):
    """f0 (n,): the dielectric part's reflectance head-on, without its colour;  the others (n) as in
    the description."""

    base_color: Colours
    metallic: Numbers
    roughness: Numbers
    f0: FloatArray
    specular: Numbers
    specular_color: Colours


class _Surface(NamedTuple):
    """The parameters at one point.  f0: the dielectric part's reflectance head-on;  m: the
    microfacets."""

    base: Vec3
    metallic: float
    f0: Vec3
    specular: float
    m: Microfacets


@kernel
def _surface(table: GltfPbrs, i: int, at: At) -> _Surface:
    roughness = number_at(table.roughness, i, at)
    alpha = max(MIN_ALPHA, roughness * roughness)
    return _Surface(
        colour_at(table.base_color, i, at),
        number_at(table.metallic, i, at),
        colour_at(table.specular_color, i, at) * float(table.f0[i]),
        number_at(table.specular, i, at),
        Microfacets(GGX, alpha, alpha),
    )


class _Factors(NamedTuple):
    """mirrored: of the specular BRDF;  base: of Lambert's."""

    mirrored: Vec3
    base: Vec3


@kernel
def _factors(s: _Surface, cosine: float) -> _Factors:
    """At this V·H."""
    w, one, dielectric = schlick_weight(cosine), Vec3(1.0, 1.0, 1.0), 1.0 - s.metallic
    f = s.f0 + (one - s.f0) * w
    metal = s.base + (one - s.base) * w
    return _Factors(
        f * (dielectric * s.specular) + metal * s.metallic,
        s.base * (dielectric * (1.0 - s.specular * max_component(f))),
    )


@kernel
def _mirroring(s: _Surface, wo: Vec3) -> float:
    """The probability of sampling the microfacets: by the brightest channels of both lobes.  The
    microfacets that mirror most light see it at the cosine of wo.  For most light of the base V·H
    is so large, from grazing angles too, that F is F0."""
    least = _LEAST_MIRRORED * (s.metallic + (1.0 - s.metallic) * s.specular)
    mirrored = max(least, max_component(_factors(s, wo.z).mirrored))
    base = max_component(_factors(s, 1.0).base)
    return mirrored / (mirrored + base) if mirrored > 0.0 else 0.0


@kernel
def _root(m: Microfacets, v: Vec3) -> float:
    """The root of alpha² + (1 - alpha²) cos²."""
    x, y = m.alpha_x * v.x, m.alpha_y * v.y
    return math.sqrt(x * x + y * y + v.z * v.z)


@kernel
def _scattered(s: _Surface, p: float, wo: Vec3, wi: Vec3) -> Scattered:
    """`eval_pdf` for directions above the surface;  p: the probability of the microfacets."""
    half = half_vector(wo, wi)
    factors, d, cosine = _factors(s, half.cosine), density(s.m, half.h), wi.z * INV_PI
    # G / (4 N·V N·L) times N·L, divided by N·L: finite at grazing angles.
    visibility = 0.5 / (_root(s.m, wo) + wo.z / wi.z * _root(s.m, wi))
    value = factors.mirrored * (d * visibility) + factors.base * cosine
    normals = 0.25 * g1_over_cos(s.m, wo) * d
    return Scattered(value, p * normals + (1.0 - p) * cosine)


@kernel
def eval_pdf(table: GltfPbrs, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) cos wi, and the density of `sample`."""
    if wo.z <= 0.0 or wi.z <= 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    s = _surface(table, i, at)
    return _scattered(s, _mirroring(s, wo), wo, wi)


@kernel
def sample(
    table: GltfPbrs, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """wo reflected at a visible microfacet, or a cosine-distributed direction."""
    if wo.z <= 0.0:
        return NO_SAMPLE
    s = _surface(table, i, at)
    p = _mirroring(s, wo)
    wi = reflect(wo, sample_visible(s.m, wo, u0, u1)) if u_lobe < p else cosine_hemisphere(u0, u1)
    if wi.z <= 0.0:
        return NO_SAMPLE
    value, density_of_wi = _scattered(s, p, wo, wi)
    if not density_of_wi > 0.0:
        return NO_SAMPLE
    return BsdfSample(wi, value * (1.0 / density_of_wi), density_of_wi, 1.0, False)


__all__ = ["GltfPbr", "GltfPbrs", "eval_pdf", "sample"]
