"""Principled thin: Burley's material for leaves, paper and panes, which are only a surface.

Burley 2015, "Extending the Disney BRDF to a BSDF with Integrated Subsurface Scattering", section
5.4, in Mitsuba's form: the diffuse lobe and the sheen of `principled`, a diffuse lobe on the other
side, and GGX microfacets that reflect, and transmit without bending: what they transmit is what
they reflect, mirrored to the other side.  The same from both sides.
"""

from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Examples, Positive
from reference_rt.core.vec3 import Vec3, dot, max_component, reflect
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.principled_lobes import (
    SHEEN_ALBEDO,
    Surface,
    diffuse,
    microfacets,
    schlick_weight,
    sheen,
    sheen_colour,
    tint,
    upwards,
    visible_normals,
)
from reference_rt.materials.material import INV_PI, NO_SAMPLE, BsdfSample, Material, Scattered
from reference_rt.materials.microfacet.fresnel import fresnel, relative_index
from reference_rt.materials.microfacet.ggx_and_smith import (
    Microfacets,
    g1,
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
from reference_rt.textures.parameter import DoubleUnitParameter

_LEAST = 0.05
"""The least reflectance and transmittance that the specular lobes' probabilities assume."""


class PrincipledThin(Material):
    """The principled material of thin sheets, such as leaves and panes; the same on both sides."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"roughness": 0.3, "spec_trans": 0.6, "eta": 1.7, "anisotropic": 0.6, "spec_tint": 0.4},
        {"base_colour": (0.7, 0.4, 0.1), "sheen": 0.8, "sheen_tint": 0.5, "flatness": 0.4},
        {"diff_trans": 1.2},
        dict.fromkeys(
            (
                *("base_colour", "roughness", "anisotropic", "spec_trans", "spec_tint", "sheen"),
                *("sheen_tint", "flatness", "diff_trans"),
            ),
            "texture",
        ),
    )
    smooth: ClassVar[bool] = True
    type: Literal["principled_thin"] = "principled_thin"
    base_colour: ReflectanceParameter = (0.5, 0.5, 0.5)
    """Colour of the diffuse lobes: linear sRGB from 0 to 1, or a texture."""
    roughness: UnitParameter = 0.5
    """Square root of the GGX roughness alpha, from 0 to 1; alpha is at least 0.001."""
    anisotropic: UnitParameter = 0.0
    """How far the highlight is stretched along the direction of u, from 0 to 1."""
    spec_trans: UnitParameter = 0.0
    """Blends from a diffuse sheet (0) to a pane (1)."""
    eta: Positive = 1.5
    """Index of refraction of the pane over that of its surroundings."""
    spec_tint: UnitParameter = 0.0
    """How far the base colour tints the pane's highlight, from 0 to 1."""
    sheen: UnitParameter = 0.0
    """Strength of a lobe at grazing angles, as of cloth, from 0 to 1."""
    sheen_tint: UnitParameter = 0.0
    """How far the base colour tints the sheen, from 0 to 1."""
    flatness: UnitParameter = 0.0
    """Blends the diffuse lobe towards an approximation of subsurface scattering, from 0 to 1."""
    diff_trans: DoubleUnitParameter = 0.0
    """The diffuse light that passes, from 0 (none) over 1 (half of it) to 2 (all)."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.base_colour

    @property
    def oriented(self) -> bool:
        return self.anisotropic != 0.0

    @property
    def transmits(self) -> bool:
        return True

    def tabulate(self, palette: Palette) -> "ThinPrincipleds":
        return ThinPrincipleds(
            palette.colours(self.base_colour),
            np.array([relative_index(self.eta, 1.0)]),
            *(
                palette.numbers(getattr(self, name), 2.0 if name == "diff_trans" else 1.0)
                for name in ThinPrincipleds._fields[2:]
            ),
        )


class ThinPrincipleds(NamedTuple):
    """base_colour (n);  eta (n,): index of refraction of the pane;  the others (n) as in the
    description."""

    base_colour: Colours
    eta: FloatArray
    roughness: Numbers
    anisotropic: Numbers
    spec_trans: Numbers
    spec_tint: Numbers
    sheen: Numbers
    sheen_tint: Numbers
    flatness: Numbers
    diff_trans: Numbers


class Thin(NamedTuple):
    """The parameters at one point.  surface: of the diffuse lobe and the sheen;  spec_trans;
    passing: the share of light that the diffuse lobe on the other side has;  through: the
    microfacets that transmit, narrower ones than those of `surface.m`, which reflect."""

    surface: Surface
    spec_trans: float
    passing: float
    through: Microfacets


@kernel
def _thin(table: ThinPrincipleds, i: int, at: At) -> Thin:
    roughness = number_at(table.roughness, i, at)
    anisotropic = number_at(table.anisotropic, i, at)
    spec_trans = number_at(table.spec_trans, i, at)
    passing = 0.5 * number_at(table.diff_trans, i, at)
    eta = float(table.eta[i])
    diffusing = (1.0 - spec_trans) * (1.0 - passing)
    surface = Surface(
        colour_at(table.base_colour, i, at),
        roughness,
        0.0,
        number_at(table.spec_tint, i, at),
        number_at(table.sheen, i, at) * diffusing,
        number_at(table.sheen_tint, i, at),
        0.0,
        0.1,
        number_at(table.flatness, i, at),
        diffusing,
        0.0,
        eta,
        eta,
        True,
        microfacets(roughness, anisotropic),
    )
    # Two rough faces blur less than one: Burley 2015, figure 15.
    narrowed = (0.65 * eta - 0.35) * roughness
    return Thin(
        surface, spec_trans, (1.0 - spec_trans) * passing, microfacets(narrowed, anisotropic)
    )


class Pane(NamedTuple):
    """mirrored, passing: the factors of a microfacet on radiance."""

    mirrored: Vec3
    passing: Vec3


@kernel
def _pane(t: Thin, cosine: float) -> Pane:
    """A dielectric's reflectance, or one of tinted reflection by Schlick's approximation; what is
    transmitted has the base colour."""
    s = t.surface
    refraction = fresnel(cosine, s.eta)
    r0 = (s.eta - 1.0) / (s.eta + 1.0)
    rise = schlick_weight(cosine if s.eta > 1.0 else refraction.cos_t)
    tinted = tint(s.base) * (r0 * r0 * (1.0 - rise)) + Vec3(rise, rise, rise)
    f = refraction.reflectance * (1.0 - s.spec_tint)
    mirrored = Vec3(f, f, f) + tinted * s.spec_tint
    passed = s.base * (t.spec_trans * refraction.transmittance)
    return Pane(mirrored * t.spec_trans, passed)


class _Shares(NamedTuple):
    """The lobes' probabilities times a factor: the power of their brightest channels."""

    cosine: float
    behind: float
    mirrored: float
    passing: float


@kernel
def _shares(t: Thin, wo: Vec3) -> _Shares:
    s = t.surface
    pane, base = _pane(t, wo.z), max_component(s.base)
    return _Shares(
        s.diffuse * base + SHEEN_ALBEDO * max_component(sheen_colour(s)),
        t.passing * base,
        max(t.spec_trans * _LEAST, max_component(pane.mirrored)),
        max(t.spec_trans * _LEAST, max_component(pane.passing)),
    )


@kernel
def _scattered(t: Thin, shares: _Shares, wo: Vec3, wi: Vec3) -> Scattered:
    """`eval_pdf` for wo above the surface."""
    s = t.surface
    total = shares.cosine + shares.behind + shares.mirrored + shares.passing
    if wi.z < 0.0:
        mirrored = Vec3(wi.x, wi.y, -wi.z)
        half = half_vector(wo, mirrored)
        value, density = s.base * (t.passing * (-wi.z * INV_PI)), shares.behind * -wi.z * INV_PI
        # As in Mitsuba: no light where it would arrive at the front of a microfacet.
        if t.spec_trans > 0.0 and dot(wi, half.h) < 0.0:
            normals = 0.25 * visible_normals(t.through, wo, half.h)
            pane = _pane(t, half.cosine)
            value = value + pane.passing * (normals * g1(t.through, mirrored))
            density += shares.passing * normals
    else:
        half = half_vector(wo, wi)
        value = diffuse(s, wo, wi, half.cosine) + sheen(s, wi, half.cosine)
        density = shares.cosine * wi.z * INV_PI
        if t.spec_trans > 0.0:
            normals = 0.25 * visible_normals(s.m, wo, half.h)
            pane = _pane(t, half.cosine)
            value = value + pane.mirrored * (normals * g1(s.m, wi))
            density += shares.mirrored * normals
    return Scattered(value, density / total if total > 0.0 else 0.0)


@kernel
def eval_pdf(table: ThinPrincipleds, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) |cos wi|, and the density of `sample`."""
    side = wo.z
    if side == 0.0 or wi.z == 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    t, wo = _thin(table, i, at), upwards(wo, side)
    return _scattered(t, _shares(t, wo), wo, upwards(wi, side))


@kernel
def sample(
    table: ThinPrincipleds, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """A direction of one of four lobes: cosine-distributed on either side, or of microfacets that
    reflect, or that transmit.  Sampling fails where a direction is on the wrong side."""
    side = wo.z
    if side == 0.0:
        return NO_SAMPLE
    t, wo = _thin(table, i, at), upwards(wo, side)
    shares = _shares(t, wo)
    first, second = shares.cosine, shares.cosine + shares.behind
    third = second + shares.mirrored
    u = u_lobe * (third + shares.passing)
    if u < second:
        wi = cosine_hemisphere(u0, u1)
        is_through = u >= first
        if is_through:
            wi = Vec3(wi.x, wi.y, -wi.z)
    else:
        is_through = u >= third
        h = sample_visible(t.through if is_through else t.surface.m, wo, u0, u1)
        wi = reflect(wo, h)
        if not wi.z > 0.0:
            return NO_SAMPLE
        if is_through:
            wi = Vec3(wi.x, wi.y, -wi.z)
            if not dot(wi, h) < 0.0:
                return NO_SAMPLE
    if wi.z == 0.0:
        return NO_SAMPLE
    value, density = _scattered(t, shares, wo, wi)
    if not density > 0.0:
        return NO_SAMPLE
    return BsdfSample(upwards(wi, side), value * (1.0 / density), density, 1.0, False)


__all__ = ["PrincipledThin", "ThinPrincipleds", "eval_pdf", "sample"]
