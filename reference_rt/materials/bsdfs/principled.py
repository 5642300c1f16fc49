"""Principled: Burley's material for artists, from plaster to metal and glass, in Mitsuba's form.

The lobes and their sources are in `principled_lobes.py`.  The front has a diffuse lobe, a sheen, a
main lobe of GGX microfacets that reflect and, with `spec_trans`, refract, and a clear coat; the
back has the main lobe alone, and only with `spec_trans`.  It follows Mitsuba's vectorised variants:
in its scalar ones a material with spec_trans = 1 has no sheen.

The BSDF is reciprocal (for refraction: radiance over the index of refraction squared).  It does not
conserve energy, because the lobes are added without scaling one by what another reflects.  At
grazing angles the albedo of a white base is up to 1.6, of a grey one of 0.5 up to 1.2; of a white
one with a sheen, or flatness 1, 1.7; a saturated sheen, whose tint has luminance 1 and so a blue of
13.9, has 3.1 in blue.  The albedo of a metal or a glass alone (metallic = 1 or spec_trans = 1, no
sheen, no coat) is never above 1: measured on grids of parameters, which the tests repeat.
"""

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Examples, Positive
from reference_rt.core.vec3 import Vec3, dot, max_component, reflect
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.principled_lobes import (
    SHEEN_ALBEDO,
    Facet,
    Surface,
    coat,
    coat_fresnel,
    coat_normals,
    diffuse,
    facet,
    fresnel_at,
    microfacets,
    sample_coat,
    sheen,
    sheen_colour,
    upwards,
    visible_normals,
)
from reference_rt.materials.material import INV_PI, NO_SAMPLE, BsdfSample, Material, Scattered
from reference_rt.materials.microfacet.fresnel import Refraction, relative_index
from reference_rt.materials.microfacet.ggx_and_smith import (
    g1,
    half_vector,
    refract,
    refraction_half,
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

_LEAST_MAIN = 0.05
"""The least reflectance that the main lobe's probability assumes: at grazing angles it reflects
all."""


class Principled(Material):
    """Burley's principled material, from plaster to metal and glass, in Mitsuba's form."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"roughness": 0.3, "metallic": 0.7, "anisotropic": 0.6, "spec_tint": 0.4},
        {"base_colour": (0.7, 0.4, 0.1), "sheen": 0.8, "sheen_tint": 0.5, "flatness": 0.4},
        {"clearcoat": 0.9, "clearcoat_gloss": 0.6, "specular": 0.3},
        {"spec_trans": 0.8, "eta": 1.4, "roughness": 0.4},
        dict.fromkeys(
            (
                *("base_colour", "roughness", "metallic", "spec_tint", "anisotropic", "sheen"),
                *("sheen_tint", "clearcoat", "clearcoat_gloss", "spec_trans", "flatness"),
            ),
            "texture",
        ),
    )
    smooth: ClassVar[bool] = True
    type: Literal["principled"] = "principled"
    base_colour: ReflectanceParameter = (0.5, 0.5, 0.5)
    """Colour of the diffuse lobe and of metal: linear sRGB from 0 to 1, or a texture."""
    roughness: UnitParameter = 0.5
    """Square root of the GGX roughness alpha, from 0 to 1; alpha is at least 0.001."""
    metallic: UnitParameter = 0.0
    """Blends from a dielectric (0) to a metal of the base colour (1)."""
    specular: Annotated[float, Field(ge=0.0, le=1.0)] | None = None
    """Reflectance at normal incidence over 0.08, from 0 to 1.  Default, without `eta`: 0.5.  With
    `spec_trans`, 0 counts as 0.001."""
    eta: Positive | None = None
    """Instead of `specular`: index of refraction inside over outside.  With `spec_trans`, 1 counts
    as 1.001."""
    spec_tint: UnitParameter = 0.0
    """How far the base colour tints a dielectric's highlight, from 0 to 1."""
    anisotropic: UnitParameter = 0.0
    """How far the highlight is stretched along the direction of u, from 0 to 1."""
    sheen: UnitParameter = 0.0
    """Strength of a lobe at grazing angles, as of cloth, from 0 to 1."""
    sheen_tint: UnitParameter = 0.0
    """How far the base colour tints the sheen, from 0 to 1."""
    clearcoat: UnitParameter = 0.0
    """Strength of a second, colourless highlight, from 0 to 1."""
    clearcoat_gloss: UnitParameter = 0.0
    """How narrow that highlight is: 0 is an alpha of 0.1, 1 one of 0.001."""
    spec_trans: UnitParameter = 0.0
    """Blends from a diffuse inside (0) to one that refracts (1)."""
    flatness: UnitParameter = 0.0
    """Blends the diffuse lobe towards an approximation of subsurface scattering, from 0 to 1."""

    @model_validator(mode="after")
    def _one_index(self) -> "Principled":
        if self.specular is not None and self.eta is not None:
            raise ValueError("specular and eta both give the index of refraction; expected one")
        return self

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.base_colour

    @property
    def oriented(self) -> bool:
        return self.anisotropic != 0.0

    @property
    def transmits(self) -> bool:
        return self.spec_trans != 0.0

    @property
    def relative_ior(self) -> float:
        """Inside over outside: of specular s, ((eta - 1) / (eta + 1))² = 0.08 s."""
        if self.eta is not None:
            eta = 1.001 if self.eta == 1.0 and self.spec_trans != 0.0 else self.eta
            return relative_index(eta, 1.0)
        specular = 0.5 if self.specular is None else self.specular
        if specular == 0.0 and self.spec_trans != 0.0:
            specular = 1e-3
        return float(2.0 / (1.0 - np.sqrt(0.08 * specular)) - 1.0)

    def tabulate(self, palette: Palette) -> "Principleds":
        return Principleds(
            palette.colours(self.base_colour),
            np.array([self.relative_ior]),
            *(palette.numbers(getattr(self, name)) for name in Principleds._fields[2:]),
        )


class Principleds(NamedTuple):
    """base_colour (n);  eta (n,): index of refraction inside over outside;  the others (n) as in
    the description."""

    base_colour: Colours
    eta: FloatArray
    roughness: Numbers
    metallic: Numbers
    spec_tint: Numbers
    anisotropic: Numbers
    sheen: Numbers
    sheen_tint: Numbers
    clearcoat: Numbers
    clearcoat_gloss: Numbers
    spec_trans: Numbers
    flatness: Numbers


@kernel
def _surface(table: Principleds, i: int, at: At, side: float) -> Surface:
    """The parameters of row i at the texture coordinates `at`, for wo.z = side."""
    roughness = number_at(table.roughness, i, at)
    metallic, spec_trans = number_at(table.metallic, i, at), number_at(table.spec_trans, i, at)
    eta = float(table.eta[i])
    return Surface(
        colour_at(table.base_colour, i, at),
        roughness,
        metallic,
        number_at(table.spec_tint, i, at),
        number_at(table.sheen, i, at),
        number_at(table.sheen_tint, i, at),
        number_at(table.clearcoat, i, at),
        0.1 - 0.099 * number_at(table.clearcoat_gloss, i, at),
        number_at(table.flatness, i, at),
        (1.0 - metallic) * (1.0 - spec_trans),
        (1.0 - metallic) * spec_trans,
        eta if side > 0.0 else 1.0 / eta,
        eta,
        side > 0.0,
        microfacets(roughness, number_at(table.anisotropic, i, at)),
    )


class _Shares(NamedTuple):
    """The lobes' probabilities times a factor: the power of their brightest channels."""

    cosine: float
    coat: float
    main: float


@kernel
def _shares(s: Surface, wo: Vec3) -> _Shares:
    refraction = fresnel_at(s, wo.z)
    flat = facet(s, refraction)
    main = 0.0
    if s.eta != 1.0 and (s.front or s.transmitting > 0.0):
        main = max(_LEAST_MAIN, max_component(flat.mirrored) + max_component(flat.refracted))
    if not s.front:
        return _Shares(0.0, 0.0, main)
    cosine = s.diffuse * max_component(s.base) + SHEEN_ALBEDO * max_component(sheen_colour(s))
    return _Shares(cosine, s.clearcoat * coat_fresnel(refraction.thin), main)


@kernel
def _scattered(s: Surface, shares: _Shares, wo: Vec3, wi: Vec3) -> Scattered:
    """`eval_pdf` for wo above the surface."""
    total = shares.cosine + shares.coat + shares.main
    if wi.z < 0.0:
        bent = refraction_half(wo, wi, s.relative_ior, s.front)
        f = facet(s, bent.refraction)
        normals = visible_normals(s.m, wo, bent.h) * bent.spread
        value = f.refracted * (normals * g1(s.m, wi))
        if not total > 0.0:
            return Scattered(value, 0.0)
        return Scattered(value, shares.main / total * f.passing * (normals * (s.eta * s.eta)))
    h, cos_d = half_vector(wo, wi)
    refraction = fresnel_at(s, cos_d)
    f, normals = facet(s, refraction), visible_normals(s.m, wo, h)
    value = f.mirrored * (0.25 * normals * g1(s.m, wi))
    if s.front:
        c = coat(s, wo, wi, h, refraction.thin)
        value = value + diffuse(s, wo, wi, cos_d) + sheen(s, wi, cos_d) + Vec3(c, c, c)
    if not total > 0.0:
        return Scattered(value, 0.0)
    density = shares.main * f.share * 0.25 * normals
    density += shares.cosine * (wi.z * INV_PI)
    if shares.coat > 0.0 and cos_d > 0.0:
        density += shares.coat * coat_normals(s, h) * h.z / (4.0 * cos_d)
    return Scattered(value, density / total)


@kernel
def eval_pdf(table: Principleds, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) |cos wi|, and the density of `sample`."""
    side = wo.z
    if side == 0.0 or wi.z == 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    s, wo = _surface(table, i, at, side), upwards(wo, side)
    value, density = _scattered(s, _shares(s, wo), wo, upwards(wi, side))
    if side < 0.0 and s.transmitting == 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), density)
    return Scattered(value, density)


@kernel
def _main(f: Facet, refraction: Refraction, wo: Vec3, h: Vec3, u: float) -> Vec3:
    """wo reflected or refracted at a microfacet."""
    if u < f.share:
        return reflect(wo, h)
    return refract(wo, h, refraction)


@kernel
def sample(
    table: Principleds, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """A direction of one of three lobes: cosine-distributed, of the coat, or of the main lobe's
    microfacets, which reflect or refract.  Sampling fails where a direction is on the wrong
    side."""
    side = wo.z
    if side == 0.0:
        return NO_SAMPLE
    s, wo = _surface(table, i, at, side), upwards(wo, side)
    shares = _shares(s, wo)
    u = u_lobe * (shares.cosine + shares.coat + shares.main)
    is_through = False
    if u < shares.cosine:
        wi = cosine_hemisphere(u0, u1)
    elif u < shares.cosine + shares.coat:
        wi = reflect(wo, sample_coat(s, u0, u1))
    else:
        if not shares.main > 0.0:
            return NO_SAMPLE
        h = sample_visible(s.m, wo, u0, u1)
        refraction = fresnel_at(s, max(0.0, dot(wo, h)))
        f = facet(s, refraction)
        u = (u - shares.cosine - shares.coat) / shares.main
        wi = _main(f, refraction, wo, h, u)
        is_through = u >= f.share
    if wi.z == 0.0 or (wi.z < 0.0) != is_through:
        return NO_SAMPLE
    value, density = _scattered(s, shares, wo, wi)
    if not density > 0.0:
        return NO_SAMPLE
    weight = value * (1.0 / density)
    return BsdfSample(upwards(wi, side), weight, density, s.eta if is_through else 1.0, False)
