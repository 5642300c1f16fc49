"""Formulas that cases of media use: phase functions, single scattering, H, a ball's light.

Cosines of scattering are those of the angle by which light is turned: 1 for light that goes on."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.special import exp1, expn

from comparisons.truth.case import FloatArray

Phase = Callable[[npt.ArrayLike], FloatArray]
"""1/sr, of cosines (...): its integral over all directions is 1."""


def isotropic(cosine: npt.ArrayLike) -> FloatArray:
    """The same in all directions."""
    return np.full_like(np.asarray(cosine, float), 1.0 / (4.0 * np.pi))


def rayleigh(cosine: npt.ArrayLike) -> FloatArray:
    """Of particles much smaller than the wavelength, without polarisation (Rayleigh 1871)."""
    return np.asarray(3.0 * (1.0 + np.square(cosine)) / (16.0 * np.pi))


def henyey_greenstein(g: float) -> Phase:
    """g: the mean cosine, above 0 for light that mostly goes on (Henyey & Greenstein 1941)."""
    return lambda c: (1.0 - g * g) / (4.0 * np.pi * (1.0 + g * g - 2.0 * g * np.asarray(c)) ** 1.5)


def blend(first: Phase, second: Phase, weight: float) -> Phase:
    """The mean of two, of which the second has the weight."""
    return lambda c: (1.0 - weight) * first(c) + weight * second(c)


def relative_expm1(x: npt.ArrayLike) -> FloatArray:
    """(1 - exp(-x)) / x, which is 1 at 0."""
    x = np.asarray(x, float)
    safe = np.where(x == 0.0, 1.0, x)
    return np.asarray(np.where(x == 0.0, 1.0, -np.expm1(-safe) / safe))


def left(cosine: FloatArray, depth: npt.ArrayLike) -> FloatArray:
    """(..., 3): the share of light that passes layers of optical depths (3,) at cosines (...)."""
    return np.exp(-np.asarray(depth, float) / np.abs(cosine)[..., None])


# ---- half spaces --------------------------------------------------------------------------------

H_NODES = 96


def chandrasekhar_h(mu: npt.ArrayLike, albedo: npt.ArrayLike) -> FloatArray:
    """Chandrasekhar's H function of isotropic scattering, for albedos below 1, broadcast.

    H(mu) = exp(-(mu / pi) int_0^(pi/2) ln(1 - albedo t cot t) / (cos² t + mu² sin² t) dt) (Stibbs &
    Weir 1959).  In the angle s, tan s = mu tan t, the denominator is gone; nodes crowd where the
    logarithm is steep if the albedo is near 1: s is pi / 2 times a square.
    """
    x, weight = np.polynomial.legendre.leggauss(H_NODES)
    x, weight = (x + 1.0) / 2.0, weight / 2.0
    s, weight = np.pi / 2.0 * x**2, weight * np.pi * x
    c = np.asarray(mu, float)[..., None] * np.cos(s)
    t = np.arctan2(np.sin(s), c)
    a = np.asarray(albedo, float)[..., None]
    return np.asarray(np.exp(-(np.log1p(-a * t * c / np.sin(s)) @ weight) / np.pi))


def half_space(
    mu: FloatArray, albedo: npt.ArrayLike, mu0: float, irradiance: npt.ArrayLike
) -> FloatArray:
    """(..., 3): the radiance that an isotropically scattering half space sends back at cosines mu
    (...), of a sun at the cosine mu0 whose irradiance is that of a plane across its rays
    (Chandrasekhar 1960, ch. III): a E / (4 pi) mu0 / (mu + mu0) H(mu) H(mu0)."""
    a, mu = np.asarray(albedo, float), mu[..., None]
    h = chandrasekhar_h(mu, a) * chandrasekhar_h(mu0, a)
    return np.asarray(a * np.asarray(irradiance) / (4.0 * np.pi) * mu0 / (mu + mu0) * h)


def half_space_in_sky(mu: FloatArray, albedo: npt.ArrayLike) -> FloatArray:
    """(..., 3): the same under a sky of radiance 1: the integral of `half_space` over mu0 is that
    of the equation of H, 1 / H(mu) = sqrt(1 - a) + (a / 2) int_0^1 x H(x) / (mu + x) dx."""
    a = np.asarray(albedo, float)
    return np.asarray(1.0 - np.sqrt(1.0 - a) * chandrasekhar_h(mu[..., None], a))


# ---- layers, scattered once ---------------------------------------------------------------------


def sent_back(mu: FloatArray, mu0: float, depth: npt.ArrayLike) -> FloatArray:
    """(..., 3): times albedo, phase function and irradiance, what a layer of optical depths (3,)
    scatters once and sends back at cosines mu (...) of a sun at mu0."""
    mu = mu[..., None]
    path = np.asarray(depth, float) * (1.0 / mu + 1.0 / mu0)
    return np.asarray(-mu0 / (mu + mu0) * np.expm1(-path))


def let_through(mu: FloatArray, mu0: float, depth: npt.ArrayLike) -> FloatArray:
    """(..., 3): the same of what it lets through: the integral over the depth x, where light is
    scattered, of exp(-x / mu0) exp(-(depth - x) / mu) / mu."""
    mu, depth = mu[..., None], np.asarray(depth, float)
    x = depth * (1.0 / mu0 - 1.0 / mu)
    return np.asarray(depth / mu * np.exp(-depth / mu) * relative_expm1(x))


# ---- a ball -------------------------------------------------------------------------------------

BALL_NODES = 128

Lack = Callable[[FloatArray], FloatArray]
"""Of distances from the centre of a ball, in mean free paths."""


def ball_in_sky(radius: float, albedo: float) -> Lack:
    """What the mean radiance in a ball of this optical radius, which scatters isotropically, lacks
    of 1 in a sky of radiance 1.

    The mean radiance J is what is left of the sky's, and what the ball scatters.  What it lacks, D
    = 1 - J, is scattered likewise, and absorption makes it evenly: D = K (1 - a) + a K D, where K
    is the mean over all directions of the integral along them of exp(-t).  In a ball, K D times the
    distance r is (1 / 2) int_0^R (E1(|r - q|) - E1(r + q)) q D(q) dq, E1 the exponential integral:
    Peierls' equation (Davison 1957, ch. V).  Gauss's nodes; x(q) - x(r) in place of x(q) takes away
    the pole of E1, whose integral is known.
    """
    node, weight = np.polynomial.legendre.leggauss(BALL_NODES)
    q, weight = radius * (node + 1.0) / 2.0, weight * radius / 2.0
    distance = np.abs(q[:, None] - q)
    np.fill_diagonal(distance, 1.0)
    near = exp1(distance) * weight / 2.0
    np.fill_diagonal(near, 0.0)
    whole = 1.0 - (expn(2, q) + expn(2, radius - q)) / 2.0
    kernel = near + np.diag(whole - near.sum(axis=1)) - exp1(q[:, None] + q) * weight / 2.0
    x = np.linalg.solve(np.eye(len(q)) - albedo * kernel, (1.0 - albedo) * kernel @ q)
    basis = np.polynomial.legendre.legvander(node, len(q) - 1)
    series = (2.0 * np.arange(len(q)) + 1.0) / radius * (basis.T @ (weight * x / q))
    return lambda r: np.asarray(np.polynomial.legendre.legval(2.0 * r / radius - 1.0, series))


def seen_ball(across: FloatArray, radius: float, albedo: float) -> FloatArray:
    """The radiance of that ball where rays pass its centre at optical distances `across` (...): 1
    without the integral along the ray of (1 - a J) exp(-t)."""
    lack = ball_in_sky(radius, albedo)
    x, weight = np.polynomial.legendre.leggauss(64)
    half = np.sqrt(radius**2 - across**2)[..., None]
    t = half * (1.0 + x)
    r = np.sqrt(across[..., None] ** 2 + (t - half) ** 2)
    missing = (1.0 - albedo + albedo * lack(r)) * np.exp(-t)
    return np.asarray(1.0 - missing @ weight * half[..., 0])
