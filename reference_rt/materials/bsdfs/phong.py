"""Phong: local shading with ambient, diffuse and specular terms (Phong 1975; Blinn 1977 with the
half vector).

    f cos = k_d max(0, l·n) + k_s max(0, e·r)^p      r: the direction of the light l mirrored at n
    f cos = k_d max(0, l·n) + k_s max(0, h·n)^p      h: half way between l and e (`half_vector`)

for lights in front of the surface.  The highlight is not multiplied by the cosine, so that f is not
reciprocal (f cos is symmetric instead), and constants whose sum is too large create energy: see
`energy_bound`.
"""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Examples, Positive
from reference_rt.core.vec3 import (
    Vec3,
    dot,
    frame_from_normal,
    max_component,
    normalize,
    reflect,
    to_world,
)
from reference_rt.jit.kernel import kernel
from reference_rt.materials.material import (
    INV_PI,
    NO_BRANCHES,
    NO_SAMPLE,
    Branches,
    BsdfSample,
    Material,
    Scattered,
    reflection,
)
from reference_rt.sampling.warp import cosine_hemisphere, on_circle
from reference_rt.textures import At, ColourParameter, Colours, Palette, colour_at


class Phong(Material):
    """The textbook's local shading, without 1/π: ambient, diffuse and specular terms, and a mirror;
    black from behind."""

    EXAMPLES: ClassVar[Examples] = (
        {"diffuse": 0.1},
        {"diffuse": (0.1, 0.2, 0.3), "specular": 0.4, "exponent": 9.0, "ambient": 0.2},
        {"diffuse": 0.1, "specular": 0.4, "half_vector": True, "mirror": (0.1, 0.2, 0.1)},
        {"diffuse": "small", "specular": "small", "mirror": "small", "ambient": "texture"},
    )
    smooth: ClassVar[bool] = True
    delta: ClassVar[bool] = True
    type: Literal["phong"] = "phong"
    ambient: ColourParameter = (0.0, 0.0, 0.0)
    """k_a, the factor of the `ambient` light under `whitted`: linear sRGB of at least 0, or a
    texture."""
    diffuse: ColourParameter
    """k_d, the factor of n·l, without 1/π: linear sRGB of at least 0, or a texture."""
    specular: ColourParameter = (0.0, 0.0, 0.0)
    """k_s, the factor of the highlight: linear sRGB of at least 0, or a texture."""
    exponent: Positive = 32.0
    """p, the exponent of the highlight's cosine: larger ones make it narrower; above 0."""
    half_vector: bool = False
    """Whether the highlight's cosine is that of normal and half vector (Blinn) rather than that of
    light and mirrored direction."""
    mirror: ColourParameter = (0.0, 0.0, 0.0)
    """k_r, the factor of the radiance in the mirrored direction: linear sRGB of at least 0, or a
    texture."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.diffuse

    def tabulate(self, palette: Palette) -> "Phongs":
        return Phongs(
            palette.colours(self.ambient, math.inf),
            palette.colours(self.diffuse, math.inf),
            palette.colours(self.specular, math.inf),
            palette.colours(self.mirror, math.inf),
            np.array([self.exponent]),
            np.array([int(self.half_vector)]),
        )

    def energy_bound(self, palette: Palette) -> float:
        """An upper bound of the albedo for any wo: pi k_d + 2 pi k_s / (p + 1) + k_r in the
        brightest channel, with 8 pi k_s / (p + 1) for the half vector.

        The highlight's term is the lobe's integral over the whole sphere, a part of which is below
        the surface; for half vectors with dwi = 4 (wo·h) dh and wo·h <= 1.  A texture counts with
        its greatest value.
        """
        lobe = (8.0 if self.half_vector else 2.0) * math.pi / (self.exponent + 1.0)
        d, s, r = (
            np.full(3, palette.greatest[palette.numbers_of[value]])
            if isinstance(value, str)
            else np.array(value)
            for value in (self.diffuse, self.specular, self.mirror)
        )
        return float(np.max(math.pi * d + lobe * s + r))


class Phongs(NamedTuple):
    """ambient, diffuse, specular, mirror (n): k_a, k_d, k_s, k_r;  exponent (n,);  half_vector
    (n,): 0 or 1."""

    ambient: Colours
    diffuse: Colours
    specular: Colours
    mirror: Colours
    exponent: FloatArray
    half_vector: IntArray


@kernel
def power(x: float, p: float) -> float:
    """max(0, x)^p for p > 0, with a relative error of p |log x| u."""
    if x <= 0.0:
        return 0.0
    return math.exp(p * math.log(x))


class Shares(NamedTuple):
    """The probabilities of sampling the lobes, which add to 1; all 0 if the material is black."""

    diffuse: float
    specular: float
    mirror: float


@kernel
def _shares(phongs: Phongs, i: int, at: At) -> Shares:
    """In proportion to upper bounds of the lobes' power in the brightest channel."""
    lobe = 8.0 if phongs.half_vector[i] != 0 else 2.0
    d = math.pi * max_component(colour_at(phongs.diffuse, i, at))
    s = lobe * math.pi * max_component(colour_at(phongs.specular, i, at))
    s = s / (phongs.exponent[i] + 1.0)
    r = max_component(colour_at(phongs.mirror, i, at))
    total = d + s + r
    if not total > 0.0:
        return Shares(0.0, 0.0, 0.0)
    return Shares(d / total, s / total, r / total)


@kernel
def eval_pdf(phongs: Phongs, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) cos wi, and the density of `sample`, both without the mirrored direction.

    The lobe's density is (p + 1) / (2 pi) (e·r)^p around the mirrored direction; with half vectors
    it is (p + 1) / (2 pi) (h·n)^p dh/dwi, and dh/dwi = 1 / (4 wo·h).
    """
    if wo.z <= 0.0 or wi.z <= 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    p = float(phongs.exponent[i])
    if phongs.half_vector[i] != 0:
        h = normalize(wo + wi)
        highlight = power(min(h.z, 1.0), p)
        lobe = highlight / (4.0 * dot(wo, h))
    else:
        highlight = power(min(dot(wo, Vec3(-wi.x, -wi.y, wi.z)), 1.0), p)
        lobe = highlight
    k_d, k_s = colour_at(phongs.diffuse, i, at), colour_at(phongs.specular, i, at)
    shares = _shares(phongs, i, at)
    density = shares.diffuse * (wi.z * INV_PI) + shares.specular * lobe * (p + 1.0) * (0.5 * INV_PI)
    return Scattered(k_d * wi.z + k_s * highlight, density)


@kernel
def _cosine_power(p: float, u0: float, u1: float) -> Vec3:
    """A direction around z with density (p + 1) / (2 pi) cos^p: cos = (1 - u0)^(1 / (p + 1))."""
    log_cosine = math.log(1.0 - u0) / (p + 1.0)
    sine = math.sqrt(-math.expm1(2.0 * log_cosine))
    cos_phi, sin_phi = on_circle(u1)
    return Vec3(sine * cos_phi, sine * sin_phi, math.exp(log_cosine))


@kernel
def sample(
    phongs: Phongs, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """The mirrored direction, or one of the highlight's lobe, or a cosine-distributed one.
    Sampling fails where the lobe's direction points below the surface."""
    shares = _shares(phongs, i, at)
    if wo.z <= 0.0 or shares.diffuse + shares.specular + shares.mirror == 0.0:
        return NO_SAMPLE
    mirrored = Vec3(-wo.x, -wo.y, wo.z)
    if u_lobe < shares.mirror:
        weight = colour_at(phongs.mirror, i, at) * (1.0 / shares.mirror)
        return BsdfSample(mirrored, weight, shares.mirror, 1.0, True)
    wi = Vec3(0.0, 0.0, 0.0)
    if u_lobe < shares.mirror + shares.specular:
        lobe = _cosine_power(phongs.exponent[i], u0, u1)
        if phongs.half_vector[i] != 0:
            if dot(wo, lobe) > 0.0:
                wi = reflect(wo, lobe)
        else:
            wi = to_world(frame_from_normal(mirrored), lobe)
    else:
        wi = cosine_hemisphere(u0, u1)
    value, density = eval_pdf(phongs, i, at, wo, wi)
    if not density > 0.0:
        return NO_SAMPLE
    weight = value * (1.0 / density)
    return BsdfSample(wi, weight, density, 1.0, False)


@kernel
def branches(phongs: Phongs, i: int, at: At, wo: Vec3) -> Branches:
    """The mirrored direction."""
    if wo.z <= 0.0:
        return NO_BRANCHES
    return reflection(wo, colour_at(phongs.mirror, i, at))


@kernel
def ambient(phongs: Phongs, i: int, at: At) -> Vec3:
    """k_a."""
    return colour_at(phongs.ambient, i, at)
