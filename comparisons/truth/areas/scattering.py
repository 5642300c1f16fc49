"""Scattering: light that a medium scatters once, or as often as it likes in a ball.

A sun's irradiance E is that of a plane across its rays; a medium of albedo a and phase function p
scatters a sigma_t p of it per unit of way and solid angle."""

import numpy as np
import numpy.typing as npt

from comparisons.truth.case import Expected, FloatArray, case
from comparisons.truth.film import View, pixel_means, seen_from_above
from comparisons.truth.scattering import (
    Phase,
    blend,
    henyey_greenstein,
    isotropic,
    let_through,
    rayleigh,
    relative_expm1,
    seen_ball,
    sent_back,
)

FOG = np.array([0.5, 1.0, 2.0])
ALBEDO = np.array([0.9, 0.6, 0.3])
SUN = np.array([6.0, 4.0, 2.0])
HALF = float(np.tan(np.radians(25.0)))
ABOVE = View((0, 0, 1), (0, 1.2, 0), (0, 0, 1), (HALF, HALF), (32, 32))
BELOW = View((0, 0, -1), (0, 1.2, 0), (0, 0, 1), (HALF, HALF), (32, 32))
SINGLE = "Chandrasekhar 1960, 54"


def _unit(v: npt.ArrayLike) -> FloatArray:
    return np.asarray(np.asarray(v, float) / np.linalg.norm(v))


# ---- a sun and a layer --------------------------------------------------------------------------


def _layer(view: View, phase: Phase, towards: npt.ArrayLike, thickness: float) -> Expected:
    """What a layer of FOG sends to a view from above, or lets through to one from below.  towards:
    the direction in which the sun's light travels."""
    sun = _unit(towards)

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        rays = view.rays(x, y)
        share = sent_back if view is ABOVE else let_through
        light = share(np.abs(rays[..., 2]), -sun[2], thickness * FOG)
        return np.asarray(ALBEDO * SUN * phase(-rays @ sun)[..., None] * light)

    return Expected(pixel_means(seen, 32, 32, 8), 1e-9)


BACK = (
    r"$a p(\Theta) E \frac{\mu_0}{\mu + \mu_0} "
    r"(1 - \exp(-\tau (\frac{1}{\mu} + \frac{1}{\mu_0})))$"
)
THROUGH = (
    r"$a p(\Theta) E \frac{\mu_0}{\mu_0 - \mu} "
    r"(\exp(-\frac{\tau}{\mu_0}) - \exp(-\frac{\tau}{\mu}))$"
)


@case(BACK, "a sun on a layer of fog, scattered once: all directions alike", SINGLE)
def sun_on_fog() -> Expected:
    """At the optical depth x the sun is exp(-x / mu0) as bright, and of what is scattered there
    exp(-x / mu) comes out: the integral over x / mu."""
    return _layer(ABOVE, isotropic, [-0.3, 0.5, -0.8], 1.5)


@case(BACK, "scattering like that of air", SINGLE)
def sun_on_air() -> Expected:
    """As `sun_on_fog` with Rayleigh's phase function."""
    return _layer(ABOVE, rayleigh, [0.6, 0.5, -0.4], 1.5)


@case(BACK, "scattering that mostly turns back", SINGLE)
def sun_on_frost() -> Expected:
    """As `sun_on_fog` with Henyey and Greenstein's phase function for g = -0.5."""
    return _layer(ABOVE, henyey_greenstein(-0.5), [0.2, 0.9, -0.7], 1.0)


@case(THROUGH, "scattering that mostly goes on", SINGLE)
def sun_through_haze() -> Expected:
    """From below the layer: exp(-(tau - x) / mu) comes out.  Henyey and Greenstein's phase function
    for g = 0.7; the sun is in the view, so close to the middle of the phase function's peak."""
    return _layer(BELOW, henyey_greenstein(0.7), [0.1, -1.0, -0.9], 1.0)


@case(THROUGH, "a blend of two phase functions", SINGLE)
def sun_through_dust() -> Expected:
    """As `sun_through_haze`, with 0.7 of g = 0.8 and 0.3 of g = -0.4."""
    phase = blend(henyey_greenstein(0.8), henyey_greenstein(-0.4), 0.3)
    return _layer(BELOW, phase, [0.5, 0.8, -0.6], 1.0)


@case(
    r"$a p E \exp(-\frac{\sigma_t h}{\mu_0}) \int \sigma_t "
    r"\exp(-\sigma_t t (1 - \frac{w_z}{\mu_0})) dt$",
    "a camera in fog, which looks up and down", SINGLE,
)  # fmt: skip
def sun_over_camera() -> Expected:
    """The camera is at the depth h in fog that has no bottom.  Along a ray that rises by w_z the
    sun is brighter, up to the surface; along others the fog has no end."""
    size, depth = (32, 32), 0.5
    half = float(np.tan(np.radians(35.0)))
    view = View((0, 0, -0.5), (0, 1, -0.45), (0, 0, 1), (half, half), size)
    sun = _unit([0.4, -0.6, -0.8])

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        rays = view.rays(x, y)
        rise = rays[..., 2:]
        rate = FOG * (1.0 + rise / sun[2])
        way = depth / np.where(rise > 0.0, rise, 1.0)
        part = np.where(rise > 0.0, way * relative_expm1(rate * way), 1.0 / rate)
        start = FOG * np.exp(FOG * depth / sun[2])
        phase = henyey_greenstein(0.4)(-rays @ sun)[..., None]
        return np.asarray(ALBEDO * SUN * phase * start * part)

    return Expected(pixel_means(seen, *size, 8), 1e-9)


@case(
    r"$a p E \frac{\mu_0}{\mu + \mu_0} (1 - \exp(-\sigma_t t_1 (1 + \frac{\mu}{\mu_0})))$",
    "a shadow in fog", SINGLE,
)  # fmt: skip
def shadow_in_fog() -> Expected:
    """A screen hovers over half of a half space of fog.  The sun's rays are along its edge, so that
    the shadow's side is upright; rays come from the lit side, and reach the shadow after t_1."""
    c, s = np.cos(np.radians(40.0)), np.sin(np.radians(40.0))
    sun, ray = _unit([0.0, 0.5, -1.0]), np.array([s, 0.0, -c])
    phase, mu0 = henyey_greenstein(0.3)(-ray @ sun), -sun[2]

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        # The ray through the column x comes down at (x - 12) / 16 / cos, for a view 1 wide.
        t1 = np.maximum((12.0 - x) / 16.0 / c, 0.0)[..., None] / s
        lit = -np.expm1(-FOG * t1 * (1.0 + c / mu0))
        return np.asarray(ALBEDO * SUN * phase * mu0 / (c + mu0) * lit)

    return Expected(pixel_means(seen, 16, 16), 1e-9)


# ---- a point light ------------------------------------------------------------------------------


def _endless(view: View, phase: Phase, light: npt.ArrayLike) -> Expected:
    """A point light in FOG without end, off the view by the distance D of each ray: in the angle
    s at the light, which sees the ray's place t0 + D tan s, the square of the distance cancels."""
    node, weight = np.polynomial.legendre.leggauss(80)
    offset = np.asarray(light, float) - view.eye

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        t0 = view.rays(x, y) @ offset
        far = np.sqrt(offset @ offset - t0**2)
        start = np.arctan2(-t0, far)[..., None]
        s = start + (np.pi / 2.0 - start) * (node + 1.0) / 2.0
        way = t0[..., None] + far[..., None] * (np.sin(s) + 1.0) / np.cos(s)
        values = phase(-np.sin(s)) * weight * (np.pi / 2.0 - start) / 2.0 / far[..., None]
        return np.stack([(values * np.exp(-f * way)).sum(axis=-1) * f for f in FOG], axis=-1)

    return Expected(pixel_means(seen, 16, 16, 4) * ALBEDO * SUN, 1e-8)


POINT = (
    r"$\frac{a \sigma_t I}{D} \int p(\Theta) \exp(-\sigma_t (t + d)) ds$ "
    "over the angle at the light"
)
HALF_16 = float(np.tan(np.radians(20.0)))


@case(POINT, "a point light in fog without end", "Pegoraro & Parker 2009")
def point_in_fog() -> Expected:
    """The light is beside the view, in Henyey and Greenstein's fog of g = 0.5, scattered once: d is
    the way from the light to the ray, and t from there to the camera."""
    view = View((0, 0, 0), (0, 1, 0), (0, 0, 1), (HALF_16, HALF_16), (16, 16))
    return _endless(view, henyey_greenstein(0.5), [0.9, 0.9, 0.3])


@case(POINT, "a sun and a sky cannot be seen in fog without end", "Pegoraro & Parker 2009")
def endless_fog() -> Expected:
    """As `point_in_fog` with Rayleigh's phase function.  No light of the sun or of the sky arrives:
    it would have come an endless way."""
    view = View((0, 0, 0), (0, 1, 0.2), (0, 0, 1), (HALF_16, HALF_16), (16, 16))
    return _endless(view, rayleigh, [-0.8, 0.5, -0.4])


@case(
    r"$\int a \sigma_t p(\Theta) \frac{I}{d^2} \exp(-\sigma_t (t + s)) dt$ over the chord",
    "a point light before a ball of fog", "elementary",
)  # fmt: skip
def point_by_ball() -> Expected:
    """At the place t of a ray's chord the light comes from the distance d, of which s is in the
    ball.  Gauss's rule along the chord.  Pixels at the rim are not stated."""
    node, weight = np.polynomial.legendre.leggauss(40)
    light = np.array([1.2, 0.7, 1.1])
    phase = henyey_greenstein(0.4)

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        r2 = x * x + y * y
        half = np.sqrt(1.0 - np.minimum(r2, 0.81))[..., None]
        t = half * (1.0 + node)
        at = np.stack(np.broadcast_arrays(x[..., None], y[..., None], half - t), axis=-1)
        d2 = ((light - at) ** 2).sum(axis=-1)
        to = (light - at) / np.sqrt(d2)[..., None]
        b = (at * to).sum(axis=-1)
        way = t - b + np.sqrt(np.maximum(b * b + 1.0 - (at * at).sum(axis=-1), 0.0))
        share = phase(-to[..., 2]) / d2 * weight * half
        value = np.stack([f * (share * np.exp(-f * way)).sum(axis=-1) for f in FOG], axis=-1)
        rest = np.where(r2 > 1.0, 0.0, np.nan)[..., None]
        return np.where(r2[..., None] < 0.81, value, rest)

    return Expected(seen_from_above(seen, 2.4, 32, 4) * ALBEDO * SUN, 1e-6)


# ---- balls --------------------------------------------------------------------------------------


def _ball(sigma: npt.ArrayLike, albedo: npt.ArrayLike) -> Expected:
    """A ball of radius 1, by Legendre's series in the square of the distance from its middle, which
    is smooth up to 0.9: the terms fall as 2.5 to the power of their number."""
    sky, count = np.array([0.5, 1.0, 2.0]), 24
    node, weight = np.polynomial.legendre.leggauss(count)
    basis = np.polynomial.legendre.legvander(node, len(node) - 1)
    norm = np.arange(len(node)) + 0.5
    across = np.sqrt(0.81 * (node + 1.0) / 2.0)
    pairs = zip(np.asarray(sigma), np.asarray(albedo), strict=True)
    series = [norm * (basis.T @ (weight * seen_ball(f * across, f, a))) for f, a in pairs]

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        r2 = x * x + y * y
        at = 2.0 * np.minimum(r2, 0.81) / 0.81 - 1.0
        value = np.moveaxis(np.polynomial.legendre.legval(at, np.transpose(series)), 0, -1)
        rest = np.where(r2 > 1.0, 1.0, np.nan)[..., None]
        return np.asarray(sky * np.where(r2[..., None] < 0.81, value, rest))

    return Expected(seen_from_above(seen, 2.4, 32, 8), 1e-6)


PEIERLS = r"$L (1 - \int (1 - a J(r)) \exp(-t) dt)$, $J = 1 - K (1 - a J)$"


@case(PEIERLS, "a ball of fog in a sky, scattered at will", "Davison 1957, ch. V")
def ball_of_fog() -> Expected:
    """The mean radiance J in the ball obeys Peierls' integral equation, solved by Gauss's rule.  Of
    the sky's light that meets a ball of little absorption, the share 4 R / 3 of that on a unit of
    way is absorbed, however often it is scattered: tests hold that (Blanco & Fournier 2003)."""
    return _ball([0.5, 1.5, 4.0], [0.4, 0.8, 0.95])


@case(PEIERLS, "a ball of thick fog in a sky: many scatterings", "Davison 1957, ch. V")
def ball_of_milk() -> Expected:
    """As `ball_of_fog`."""
    return _ball([8.0, 4.0, 10.0], [0.99, 0.9, 0.999])
