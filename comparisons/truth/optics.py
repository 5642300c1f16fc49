"""Formulas that several cases use: irradiance of polygons, Fresnel, microfacets."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from comparisons.truth.case import FloatArray


def polygon_irradiance(
    corners: npt.ArrayLike, points: FloatArray, normal: npt.ArrayLike
) -> FloatArray:
    """The irradiance (...) of a polygon (n, 3) of radiance 1 at points (..., 3), above the horizon
    of all of them (Lambert 1760): half the sum over edges of the angle that an edge subtends, times
    the cosine between `normal` and the normal of the plane through point and edge."""
    v = np.asarray(corners, float) - points[..., None, :]
    w = np.roll(v, -1, axis=-2)
    cross = np.cross(v, w)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, (v * w).sum(axis=-1))
    safe = np.where(length > 0.0, length, 1.0)
    total = (angle / safe * (cross @ np.asarray(normal, float))).sum(axis=-1)
    return np.asarray(np.abs(total) / 2.0)


def polygon_irradiance_rate(
    corners: npt.ArrayLike, velocity: npt.ArrayLike, points: FloatArray, normal: npt.ArrayLike
) -> FloatArray:
    """The derivative of `polygon_irradiance` as the corners move: the product rule in each edge,
    whose angle is atan2(|v x w|, v . w)."""
    v = np.asarray(corners, float) - points[..., None, :]
    w, dv = np.roll(v, -1, axis=-2), np.broadcast_to(velocity, np.shape(corners))
    dw, n = np.roll(dv, -1, axis=-2), np.asarray(normal, float)
    cross, dcross = np.cross(v, w), np.cross(dv, w) + np.cross(v, dw)
    length, cosine = np.linalg.norm(cross, axis=-1), (v * w).sum(axis=-1)
    dlength, dcosine = (cross * dcross).sum(axis=-1) / length, (dv * w + v * dw).sum(axis=-1)
    angle = np.arctan2(length, cosine)
    dangle = (cosine * dlength - length * dcosine) / (length**2 + cosine**2)
    parts = angle / length * (cross @ n)
    rates = (dangle - angle / length * dlength) / length * (cross @ n)
    rates += angle / length * (dcross @ n)
    return np.asarray(np.sign(parts.sum(axis=-1)) * rates.sum(axis=-1) / 2.0)


def on_floor(x: FloatArray, y: FloatArray, z: float = 0.0) -> FloatArray:
    """(..., 3): points (x, y, z)."""
    return np.stack([x, y, np.full_like(x, z)], axis=-1)


UP = (0.0, 0.0, 1.0)


def floor_irradiance(corners: npt.ArrayLike, x: FloatArray, y: FloatArray) -> FloatArray:
    """`polygon_irradiance` at points (x, y, 0) of a floor."""
    return polygon_irradiance(corners, on_floor(x, y), UP)


def fresnel(cosine: FloatArray, eta: float) -> FloatArray:
    """The unpolarised reflectance of a boundary;  eta: index behind over index in front."""
    sin2 = (1.0 - cosine**2) / eta**2
    behind = np.sqrt(np.maximum(0.0, 1.0 - sin2))
    s = (cosine - eta * behind) / (cosine + eta * behind)
    p = (eta * cosine - behind) / (eta * cosine + behind)
    return np.asarray(np.where(sin2 >= 1.0, 1.0, (s**2 + p**2) / 2.0))


def fresnel_metal(cosine: FloatArray, eta: float, k: float) -> FloatArray:
    """The same of a metal, with the complex index eta - i k (Born & Wolf, sec. 14.2)."""
    index = complex(eta, -k)
    behind = np.sqrt(1.0 - (1.0 - cosine**2) / index**2 + 0j)
    s = (cosine - index * behind) / (cosine + index * behind)
    p = (index * cosine - behind) / (index * cosine + behind)
    return np.asarray((np.abs(s) ** 2 + np.abs(p) ** 2) / 2.0)


def fresnel_rate(cosine: FloatArray, index: complex) -> FloatArray:
    """The derivative of both reflectances by the real part of the index, which is not beyond the
    critical angle: by that of the cosine behind and the quotient rule."""
    behind = np.sqrt(1.0 - (1.0 - cosine**2) / index**2 + 0j)
    turn = (1.0 - cosine**2) / (index**3 * behind)
    s = (cosine - index * behind) / (cosine + index * behind)
    p = (index * cosine - behind) / (index * cosine + behind)
    ds = -2.0 * cosine * (behind + index * turn) / (cosine + index * behind) ** 2
    dp = 2.0 * cosine * (behind - index * turn) / (index * cosine + behind) ** 2
    return np.asarray((s.conj() * ds + p.conj() * dp).real)


def ggx(tangent2: FloatArray, alpha: float) -> FloatArray:
    """D times cos⁴ of the half vector's angle, by its tangent squared (Walter et al. 2007)."""
    return np.asarray(1.0 / (np.pi * alpha**2 * (1.0 + tangent2 / alpha**2) ** 2))


def beckmann(tangent2: FloatArray, alpha: float) -> FloatArray:
    """The same for Beckmann's distribution."""
    return np.asarray(np.exp(-tangent2 / alpha**2) / (np.pi * alpha**2))


def smith_ggx(cosine: FloatArray, alpha: float) -> FloatArray:
    """Smith's Lambda."""
    tangent2 = 1.0 / cosine**2 - 1.0
    return np.asarray((np.sqrt(1.0 + alpha**2 * tangent2) - 1.0) / 2.0)


def smith_beckmann(cosine: FloatArray, alpha: float) -> FloatArray:
    """Smith's Lambda of Beckmann's distribution, exactly."""
    from scipy.special import erf

    tangent = np.sqrt(np.maximum(1.0 / cosine**2 - 1.0, 1e-30))
    a = 1.0 / (alpha * tangent)
    tail = np.exp(-(a**2)) / (a * np.sqrt(np.pi))
    return np.asarray((erf(a) - 1.0 + tail) / 2.0)


DISTRIBUTIONS = {"ggx": (ggx, smith_ggx), "beckmann": (beckmann, smith_beckmann)}


def rough_metal(
    wi: FloatArray, wo: FloatArray, alpha: float, eta: float, k: float, name: str = "ggx"
) -> FloatArray:
    """f times cos wi of directions (..., 3) about the normal +z: D G F / (4 cos wo), with the
    height-correlated or the separable G: Mitsuba's and ours are separable, G1(wi) G1(wo)."""
    d, lam = DISTRIBUTIONS[name]
    h = wi + wo
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    hz = h[..., 2]
    tangent2 = 1.0 / hz**2 - 1.0
    ci, co = wi[..., 2], wo[..., 2]
    up = (ci > 0.0) & (co > 0.0)
    safe_i, safe_o = np.where(up, ci, 1.0), np.where(up, co, 1.0)
    g = 1.0 / ((1.0 + lam(safe_i, alpha)) * (1.0 + lam(safe_o, alpha)))
    f = fresnel_metal((h * wo).sum(axis=-1), eta, k)
    return np.asarray(np.where(up, d(tangent2, alpha) / hz**4 * g * f / (4.0 * safe_o), 0.0))


def half_vector_mean(
    cosine: FloatArray,
    alpha: float,
    parts: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    name: str,
    eta: float = 1.0,
) -> FloatArray:
    """The integral of D G (parts) over half vectors h, for views at these cosines.

    parts: of the cosine between view and half vector, what is mirrored and what is refracted at it;
    eta: index behind over index in front.  The midpoint rule on the quantiles of D cos, and
    Chebyshev polynomials in the view's cosine.
    """
    lam = DISTRIBUTIONS[name][1]
    left = (1.0 - (np.arange(RADII) + 0.5) / RADII)[:, None]
    # 1 minus the quantile is left⁴, so that steps are short where half vectors are level.
    weight, left = 4.0 * left**3, left**4
    tangent2 = alpha**2 * ((1.0 - left) / left if name == "ggx" else -np.log(left))
    hz = 1.0 / np.sqrt(1.0 + tangent2)
    across = np.sqrt(1.0 - hz**2)
    hx = across * np.cos(2.0 * np.pi * (np.arange(TURNS) + 0.5) / TURNS)

    def at(c: float) -> float:
        m = hx * np.sqrt(1.0 - c * c) + hz * c
        up = m > 0.0
        m = np.where(up, m, 1.0)
        mirrored, refracted = parts(m)
        out_mirrored = 2.0 * m * hz - c
        below = np.sqrt(np.maximum(0.0, 1.0 - (1.0 - m * m) / eta**2))
        out_refracted = -((m / eta - below) * hz - c / eta)
        total = sum(
            np.where(up & (z > 0.0), part / (1.0 + lam(np.where(z > 0.0, z, 1.0), alpha)), 0.0)
            for part, z in ((mirrored, out_mirrored), (refracted, out_refracted))
        )
        return float((total * weight * m / (c * hz)).mean() / (1.0 + lam(np.array(c), alpha)))

    low, high = float(np.nanmin(cosine)), float(np.nanmax(cosine))
    nodes = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
    values = [at((low + high) / 2.0 + (high - low) / 2.0 * x) for x in nodes]
    fit = np.polynomial.Chebyshev.fit(nodes, values, 23)
    return np.asarray(fit((cosine - (low + high) / 2.0) / ((high - low) / 2.0)))


RADII, TURNS = 400, 128
"""Steps of `half_vector_mean`: doubled, they change nothing by 1e-5."""
