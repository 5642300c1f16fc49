"""Microfacets: a rough boundary as a height field of tiny mirrors, described by statistics (Walter
et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Heitz 2014,
"Understanding the Masking-Shadowing Function").

There are two distributions of slopes, both anisotropic: GGX, which is Trowbridge & Reitz's of 1975,
and Beckmann's.  `alpha` is the root of twice the mean square slope for Beckmann and a scale of
slopes for GGX, along x and along y.  Masking and shadowing are independent, G(wo, wi) = G1(wo)
G1(wi), as in Mitsuba: the separable form, not the height-correlated one.  Light that meets a second
microfacet is lost.  G1 is Smith's, exact for both.  (Mitsuba has a rational approximation of
Beckmann's: up to 0.31 % off.)

Directions are in the shading frame; `v` may be on either side, and the microfacets are those
visible from this side.  No result is NaN or infinite for unit vectors and MIN_ALPHA <= alpha <=
MAX_ALPHA."""

import math
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Strict, WithJsonSchema

from reference_rt.core.arrays import IntArray
from reference_rt.core.vec3 import Vec3, dot, normalize
from reference_rt.jit.kernel import kernel
from reference_rt.materials.microfacet.fresnel import Refraction, fresnel
from reference_rt.sampling.warp import about_normal, on_circle, turns
from reference_rt.textures import At, Numbers, Palette, number_at
from reference_rt.textures.texture import MayBeTexture

# ---- sampling the visible normals of Beckmann's distribution of slopes ---------------------------


SQRT_PI = math.sqrt(math.pi)

FAR = 6.5
"""A slope, in units of alpha, that Beckmann's distribution exceeds with probability
erfc(6.5) / 2 = 2e-20: less than any sampler's step."""

_LEAST = 1e-18
"""Smaller numbers count as this."""

_ROUNDED = 2.0**-51
"""The relative error of a sum of two products with erfc and exp, each of which is right to 2 u."""

_CUBED = 1e-5
"""A step, times the relative curvature there, whose cube is below 1e-15."""


@kernel
def visible_beckmann(w: Vec3, u0: float, u1: float) -> Vec3:
    """A visible normal for roughness 1, not of unit length: the slope towards w is from
    `_slope_seen`; the slope across it is normally distributed for every w (Heitz & d'Eon 2014,
    "Importance Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals")."""
    sine = math.sqrt(w.x * w.x + w.y * w.y)
    x = _slope_seen(w.z, sine, u0)
    y = about_normal(max(u1, _LEAST))
    cos_phi, sin_phi = (w.x / sine, w.y / sine) if sine > 0.0 else (1.0, 0.0)
    return Vec3(sin_phi * y - cos_phi * x, -sin_phi * x - cos_phi * y, 1.0)


@kernel
def seen(cosine: float, sine: float, x: float) -> float:
    """The integral of 2 (cosine - sine x) exp(-x²) from -infinity to x."""
    return _seen(cosine, sine, x, math.exp(-x * x))


@kernel
def _seen(cosine: float, sine: float, x: float, gauss: float) -> float:
    """The same, given exp(-x²)."""
    return cosine * SQRT_PI * math.erfc(-x) + sine * gauss


@kernel
def _slope_seen(cosine: float, sine: float, u: float) -> float:
    """The quantile u of the slopes x that are visible from a direction at this angle: those of
    density (cosine - sine x) exp(-x²) up to cosine / sine.

    Seen from above it is normally distributed, at grazing angles it is -sqrt(-log u).  Between them
    the mean of the two, weighted by angle, is so close that two steps are enough (measured).
    """
    u = max(u, _LEAST)
    most = cosine / sine if cosine < FAR * sine else FAR
    grazing = 4.0 * turns(sine, cosine)
    x = (1.0 - grazing) * about_normal(u) - grazing * math.sqrt(-math.log(u))
    goal = u * seen(cosine, sine, most)
    return _refined(cosine, sine, most, goal, x if x < most else 0.0)


@kernel
def _refined(cosine: float, sine: float, most: float, goal: float, x: float) -> float:
    """The root of `seen` = goal below `most`, to the last digits of the goal: by Halley's method
    from a start x near it.  The error after a step is about the cube of that before."""
    for _ in range(64):
        gauss = math.exp(-x * x)
        off = goal - _seen(cosine, sine, x, gauss)
        height = cosine - sine * x
        slope = 2.0 * height * gauss
        if not (slope > 0.0 and abs(off) > _ROUNDED * goal):
            break
        step = off / slope
        bend = -2.0 * x - sine / height  # the second derivative over the first
        x_next = x + step / max(0.5, 1.0 + 0.5 * step * bend)
        x = x_next if x_next < most else 0.5 * (x + most)
        if abs(step) * (1.0 + abs(bend)) < _CUBED:
            break
    return min(x, most)


GGX, BECKMANN = 0, 1
_KINDS = ("ggx", "beckmann")

MIN_ALPHA = 1e-4
"""Smaller ones are clamped to this: the lobe, a hundredth of a degree wide, looks like a mirror's,
and half vectors, whose error is a few u, still resolve it to 1e-10."""

MAX_ALPHA = 10.0
"""Slopes of 84 degrees: no surface is rougher; larger ones are refused."""


def _alpha(value: Any) -> Any:
    if isinstance(value, str):
        return value
    both = list(value) if isinstance(value, list | tuple) else [value, value]
    wrong = (isinstance(a, bool) or not isinstance(a, int | float | str) for a in both)
    if len(both) != 2 or any(wrong):
        raise ValueError(
            "expected a number, two of them [alpha_u, alpha_v], or the name of a texture"
        )
    for a in both:
        if not isinstance(a, str) and not 0.0 < a <= MAX_ALPHA:  # also refuses NaN
            raise ValueError(f"expected a roughness above 0 and at most {MAX_ALPHA:g}, got {a:g}")
    return tuple(a if isinstance(a, str) else float(a) for a in both)


_ALPHA = {"type": "number", "exclusiveMinimum": 0, "maximum": MAX_ALPHA}
_NAME = {"type": "string", "description": "the name of a texture"}

AlphaParameter = Annotated[
    Annotated[tuple[float | str, float | str], Strict(False)] | str,
    MayBeTexture(),
    BeforeValidator(_alpha),
    WithJsonSchema(
        {
            "anyOf": [
                _ALPHA,
                {
                    "type": "array",
                    "items": {"anyOf": [_ALPHA, _NAME]},
                    "minItems": 2,
                    "maxItems": 2,
                },
                _NAME,
            ]
        }
    ),
]
"""Roughness above 0: a number, the name of a texture, or two of these, [alpha_u, alpha_v].  What is
below MIN_ALPHA, zeros of a texture too, counts as MIN_ALPHA."""

Distribution = Literal["ggx", "beckmann"]


class Roughnesses(NamedTuple):
    """Parameters of n materials: kind (n,), GGX or BECKMANN; alpha_x (n), alpha_y (n)."""

    kind: IntArray
    alpha_x: Numbers
    alpha_y: Numbers


def roughnesses(
    distribution: Distribution,
    alpha: tuple[float | str, float | str] | str,
    palette: Palette,
) -> Roughnesses:
    """One row.  Raises ValueError for a texture with values above MAX_ALPHA."""
    along_x, along_y = (alpha, alpha) if isinstance(alpha, str) else alpha
    return Roughnesses(
        np.array([_KINDS.index(distribution)]),
        palette.numbers(along_x, most=MAX_ALPHA),
        palette.numbers(along_y, most=MAX_ALPHA),
    )


class Microfacets(NamedTuple):
    """The distribution at one point: kind, GGX or BECKMANN; roughness along x and along y."""

    kind: int
    alpha_x: float
    alpha_y: float


@kernel
def microfacets_at(table: Roughnesses, i: int, at: At) -> Microfacets:
    """The distribution of row i at the texture coordinates `at`."""
    return Microfacets(
        table.kind[i],
        max(MIN_ALPHA, number_at(table.alpha_x, i, at)),
        max(MIN_ALPHA, number_at(table.alpha_y, i, at)),
    )


class Half(NamedTuple):
    """h: the half vector, the normal that mirrors wo to wi, 0 for opposite directions;
    cosine: wo·h = wi·h, the same bits for both, and with all digits at grazing angles."""

    h: Vec3
    cosine: float


@kernel
def half_vector(wo: Vec3, wi: Vec3) -> Half:
    """Of two unit vectors, whose sum has the length 2 wo·h."""
    total = wo + wi
    length2 = dot(total, total)
    if length2 < 1e-280:  # the squares underflow
        return Half(Vec3(0.0, 0.0, 0.0), 0.0)
    length = math.sqrt(length2)
    return Half(total * (1.0 / length), min(1.0, 0.5 * length))


@kernel
def density(m: Microfacets, h: Vec3) -> float:
    """D(h): the area of microfacets with normal h, per area of the surface and solid angle.

    Heitz 2014, appendix A, with tan² multiplied out.  0 for h.z <= 0.
    """
    if h.z <= 0.0:
        return 0.0
    x, y = h.x / m.alpha_x, h.y / m.alpha_y
    slope2, z2 = x * x + y * y, h.z * h.z
    area = math.pi * m.alpha_x * m.alpha_y
    if m.kind == GGX:
        norm = slope2 + z2
        return 1.0 / (area * norm * norm)
    if slope2 > 700.0 * z2:
        return 0.0  # below e^-700
    return math.exp(-slope2 / z2) / (area * z2 * z2)


@kernel
def g1_over_cos(m: Microfacets, v: Vec3) -> float:
    """G1(v) / |v.z|, finite at grazing angles.

    Smith's G1 = 1 / (1 + Lambda) (Heitz 2014, appendix A; Beckmann's with exp and erf), numerator
    and denominator multiplied by the factor that diverges at grazing angles.
    """
    z = abs(v.z)
    x, y = m.alpha_x * v.x, m.alpha_y * v.y
    s = math.sqrt(x * x + y * y)  # alpha sin: a = z / s
    if m.kind == GGX:
        return 2.0 / (z + math.sqrt(s * s + z * z))
    if z > FAR * s:
        return 1.0 / z
    a = z / s
    return 2.0 * SQRT_PI / (s * (a * SQRT_PI * (1.0 + math.erf(a)) + math.exp(-a * a)))


@kernel
def g1(m: Microfacets, v: Vec3) -> float:
    """Smith's masking: the fraction of microfacets facing `v` that are visible from there."""
    return min(1.0, abs(v.z) * g1_over_cos(m, v))


@kernel
def visible_density(m: Microfacets, v: Vec3, h: Vec3) -> float:
    """The density of the normals h visible from `v`, per solid angle: G1(v) max(0, v·h) D(h) /
    |v.z| (Heitz 2014), for v on the side of h."""
    return g1_over_cos(m, v) * max(0.0, dot(v, h)) * density(m, h)


@kernel
def sample_visible(m: Microfacets, v: Vec3, u0: float, u1: float) -> Vec3:
    """A normal with `visible_density`, for v.z >= 0.

    The surface is stretched by alpha to roughness 1 in all directions; the normal found there is
    then transformed back (Heitz 2014).
    """
    w = normalize(Vec3(m.alpha_x * v.x, m.alpha_y * v.y, v.z))
    h = _visible_ggx(w, u0, u1) if m.kind == GGX else visible_beckmann(w, u0, u1)
    return normalize(Vec3(m.alpha_x * h.x, m.alpha_y * h.y, h.z))


@kernel
def _visible_ggx(w: Vec3, u0: float, u1: float) -> Vec3:
    """A visible normal for roughness 1, not of unit length: the microfacets of a hemisphere mirror
    w to a spherical cap, uniformly (Dupuy & Benyoub 2023, "Sampling Visible GGX Normals with
    Spherical Caps")."""
    down = u1 * (1.0 + w.z)  # 1 - z of the point of the cap
    r = math.sqrt(down * (2.0 - down))
    cos_phi, sin_phi = on_circle(u0)
    return Vec3(r * cos_phi + w.x, r * sin_phi + w.y, (1.0 - u1) * (1.0 + w.z))


@kernel
def refract(wo: Vec3, h: Vec3, refraction: Refraction) -> Vec3:
    """wo refracted at a microfacet with normal h; refraction: `fresnel` of the two.

    Rounding changes its length by some 10 u times the index; a step of Newton's method for
    1 / sqrt(x) at 1 corrects that.
    """
    wi = h * refraction.gap - wo * (1.0 / refraction.eta)
    return wi * (1.5 - 0.5 * dot(wi, wi))


class RefractionHalf(NamedTuple):
    """The microfacet that refracts wo to wi.  h: its normal;  spread: the Jacobian dh / dwi, times
    wo·h / eta², 0 where no microfacet refracts wo to wi;  refraction: its Fresnel terms, computed
    from the side of the smaller index, where no digits cancel."""

    h: Vec3
    spread: float
    refraction: Refraction


@kernel
def refraction_half(wo: Vec3, wi: Vec3, n: float, is_outside: bool) -> RefractionHalf:
    """Walter et al. 2007, eq. 16 and 17;  n: the index inside over that outside;  is_outside:
    whether wo is outside.

    The operations are the same from either side, which makes the BSDF reciprocal to the last bit.
    The normal is along outer + n inner, computed as (outer + inner) + (n - 1) inner, which loses no
    digits for n near 1.
    """
    outer, inner = (wo, wi) if is_outside else (wi, wo)
    scaled = (outer + inner) + inner * (n - 1.0)  # at least |n - 1| long
    length2 = dot(scaled, scaled)
    if length2 < 1e-280:
        return RefractionHalf(Vec3(0.0, 0.0, 0.0), 0.0, fresnel(0.0, n))
    h = scaled * (1.0 / math.sqrt(length2))
    if h.z < 0.0:
        h = -h
    cos_o, cos_i = dot(wo, h), dot(wi, h)
    thin = dot(outer, h) if n > 1.0 else dot(inner, h)
    refraction = fresnel(math.copysign(thin, n - 1.0), n)
    if cos_o <= 0.0 or cos_i >= 0.0:
        return RefractionHalf(h, 0.0, refraction)
    scale = 1.0 if is_outside else n * n  # |wo + eta wi| is |outer + n inner| / n from inside
    return RefractionHalf(h, cos_o * -cos_i * scale / length2, refraction)
