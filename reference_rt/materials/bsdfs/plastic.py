"""Plastic: a smooth clear coat over a diffuse base, with all reflections between the two.

Light enters, is scattered by the base, and partly reflected back by the coat from within, again and
again (Wolff 1994, "Diffuse-Reflectance Model for Smooth Dielectric Surfaces"; Pharr & Humphreys'
and Mitsuba's form):

    f = rho / (1 - c F_int) (1 - F(wi)) (1 - F(wo)) / (eta² pi),   c = rho if `nonlinear`, else 1,

where F_int is the internal diffuse reflectance of the coat: its hemispherical Fresnel reflectance
from within, an exact integral here.  Mitsuba has a fit, which makes its diffuse part brighter: by
0.1 % at eta = 1.33, 0.12 % at 1.5, 2.8 % at 2.4 (measured against the integral in 30 digits).  With
the exact integral and c = 1 the diffuse part of the light from wo is exactly rho (1 - F(wo)).
"""

from functools import cache
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import Examples, Positive
from reference_rt.core.vec3 import Vec3, max_component
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
from reference_rt.materials.microfacet.fresnel import fresnel, relative_index
from reference_rt.sampling.warp import cosine_hemisphere
from reference_rt.textures import At, Colours, Palette, ReflectanceParameter, colour_at


class Coated(Material):
    """A diffuse base under a clear coat; its back is black."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"reflectance": (0.7, 0.4, 0.1), "specular": (0.5, 0.6, 0.7), "nonlinear": True},
        {"interior_ior": 1.9, "exterior_ior": 1.2},
        {"reflectance": "texture", "specular": "texture"},
    )
    smooth: ClassVar[bool] = True
    type: str  # first, so that `to_json` writes it first
    reflectance: ReflectanceParameter = (0.5, 0.5, 0.5)
    """Diffuse reflectance of the base: linear sRGB from 0 to 1, or a texture."""
    specular: ReflectanceParameter = (1.0, 1.0, 1.0)
    """A factor of the light that the coat reflects: linear sRGB from 0 to 1, or a texture.  The
    default, 1, is physical."""
    interior_ior: Positive = 1.5
    """Index of refraction of the coat."""
    exterior_ior: Positive = 1.0
    """Index of refraction outside the coat."""
    nonlinear: bool = False
    """Whether `reflectance` colours the light at every bounce below the coat, so that colours
    saturate."""

    @property
    def colour(self) -> tuple[float, float, float] | str:
        return self.reflectance


@kernel
def base_albedo(rho: Vec3, internal: float, nonlinear: int) -> Vec3:
    """rho / (1 - c internal), c = rho if `nonlinear`, else 1: the albedo of the base, light that
    the coat throws back included;  internal: the coat's reflectance from within."""
    if nonlinear == 0:
        return rho * (1.0 / (1.0 - internal))
    return Vec3(
        rho.x / (1.0 - rho.x * internal),
        rho.y / (1.0 - rho.y * internal),
        rho.z / (1.0 - rho.z * internal),
    )


class Plastic(Coated):
    """A diffuse base under a smooth clear coat; black from behind."""

    delta: ClassVar[bool] = True
    type: Literal["plastic"] = "plastic"
    nonlinear: bool = False
    """Whether `reflectance` colours the light at every bounce below the coat, so that colours
    saturate.  Otherwise `reflectance` is the colour as seen through the coat."""

    def tabulate(self, palette: Palette) -> "Plastics":
        eta = relative_index(self.interior_ior, self.exterior_ior)
        return Plastics(
            palette.colours(self.reflectance),
            palette.colours(self.specular),
            np.array([eta]),
            np.array([hemispherical_fresnel(1.0 / eta)]),
            np.array([int(self.nonlinear)]),
        )


class Plastics(NamedTuple):
    """reflectance, specular (n);  eta (n,): index of the coat over that around it;  f_int (n,): its
    internal diffuse reflectance;  nonlinear (n,): 0 or 1."""

    reflectance: Colours
    specular: Colours
    eta: FloatArray
    f_int: FloatArray
    nonlinear: IntArray


@cache
def _gauss() -> tuple[FloatArray, FloatArray]:
    """Nodes and weights, which take 25 ms: scenes without plastic do not need them."""
    nodes, weights = np.polynomial.legendre.leggauss(128)
    return nodes, weights


def hemispherical_fresnel(eta: float) -> float:
    """The fraction of uniform diffuse light that a boundary reflects: the integral of 2 F(cos) cos
    over 0 <= cos <= 1;  eta: index behind it over that in front.

    For eta > 1, with q = exp(-2 w), cos = k sinh w and eta cos_t = k cosh w, k² = eta² - 1, make
    Fresnel's amplitudes -q and (m - q) / (1 - m q), m = (eta² - 1) / (eta² + 1), with
    q from (eta - 1) / (eta + 1) to 1: rational, and integrated in log q by Gauss-Legendre to 1e-14
    for eta up to 100.  For eta < 1 by reciprocity: 1 - F_h(eta) = eta² (1 - F_h(1 / eta)).
    """
    if eta == 1.0:
        return 0.0
    if eta < 1.0:
        return 1.0 - (1.0 - hemispherical_fresnel(1.0 / eta)) * eta * eta
    k2 = (eta - 1.0) * (eta + 1.0)
    m = k2 / (eta * eta + 1.0)
    least = np.log1p(-2.0 / (eta + 1.0))
    nodes, weights = _gauss()
    log_q = 0.5 * least * (nodes + 1.0)
    q = np.exp(log_q)
    f = 0.5 * (q * q + ((m - q) / (1.0 - m * q)) ** 2)
    # d cos² = -(k² / 4) (1 - q²) / q dlog q
    return float(-0.125 * least * k2 * np.sum(weights * f * (1.0 - q * q) / q))


class Shares(NamedTuple):
    """f_o, t_o: Fresnel reflectance and transmittance for wo;  base: rho / (1 - c F_int);
    specular: the colour of the mirrored light;  p: the probability of sampling that."""

    f_o: float
    t_o: float
    base: Vec3
    specular: Vec3
    p: float


@kernel
def _shares(plastics: Plastics, i: int, at: At, wo: Vec3) -> Shares:
    """The probabilities of the lobes are proportional to the power of their brightest channel."""
    coat = fresnel(wo.z, plastics.eta[i])
    f_o, t_o = coat.reflectance, coat.transmittance
    f_int = plastics.f_int[i]
    base = base_albedo(colour_at(plastics.reflectance, i, at), f_int, plastics.nonlinear[i])
    specular = colour_at(plastics.specular, i, at)
    s = f_o * max_component(specular)
    d = t_o * (1.0 - f_int) * max_component(base)
    return Shares(f_o, t_o, base, specular, s / (s + d) if s > 0.0 else 0.0)


@kernel
def _diffuse(plastics: Plastics, i: int, shares: Shares, wi: Vec3) -> Vec3:
    """f cos wi of the diffuse part: light that enters the coat and leaves it."""
    eta = float(plastics.eta[i])
    t_i = fresnel(wi.z, eta).transmittance
    return shares.base * (t_i * shares.t_o / (eta * eta) * (wi.z * INV_PI))


@kernel
def eval_pdf(plastics: Plastics, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) cos wi, and the density of `sample`, both without the mirrored direction."""
    if wo.z <= 0.0 or wi.z <= 0.0:
        return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    shares = _shares(plastics, i, at, wo)
    density = (1.0 - shares.p) * (wi.z * INV_PI)
    return Scattered(_diffuse(plastics, i, shares, wi), density)


@kernel
def sample(
    plastics: Plastics, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """The mirrored direction or a cosine-distributed one."""
    if wo.z <= 0.0:
        return NO_SAMPLE
    shares = _shares(plastics, i, at, wo)
    if u_lobe < shares.p:
        weight = shares.specular * (shares.f_o / shares.p)
        return BsdfSample(Vec3(-wo.x, -wo.y, wo.z), weight, shares.p, 1.0, True)
    wi = cosine_hemisphere(u0, u1)
    density = (1.0 - shares.p) * (wi.z * INV_PI)
    if not density > 0.0:
        return NO_SAMPLE
    return BsdfSample(wi, _diffuse(plastics, i, shares, wi) * (1.0 / density), density, 1.0, False)


@kernel
def branches(plastics: Plastics, i: int, at: At, wo: Vec3) -> Branches:
    """The mirrored direction."""
    if wo.z <= 0.0:
        return NO_BRANCHES
    f = fresnel(wo.z, plastics.eta[i]).reflectance
    return reflection(wo, colour_at(plastics.specular, i, at) * f)
