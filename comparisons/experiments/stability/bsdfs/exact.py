"""The laws of smooth and rough boundaries in 300 bits: what floats are measured against."""

from typing import NamedTuple

import numpy as np
from flint import arb, ctx

from comparisons.experiments.stability.harness.outcomes import FloatArray

BITS = 300
"""Squares of slopes at an alpha of 1e-4 and of cosines of 1e-12 leave 190 of them."""


class Boundary(NamedTuple):
    """R, T (n,): reflectance and transmittance."""

    reflectance: FloatArray
    transmittance: FloatArray


def _exact_fresnel(cosine: arb, n: arb) -> tuple[float, float]:
    """With c outside and g = n times the cosine inside, g² = c² + n² - 1; cosine < 0 inside."""
    k = n * n - 1
    if cosine > 0:
        c2 = cosine * cosine
        g2 = c2 + k
    else:
        g2 = n * n * cosine * cosine
        c2 = g2 - k
    if not (c2 > 0 and g2 > 0):
        return 1.0, 0.0
    c, g = c2.sqrt(), g2.sqrt()
    s, p = (c - g) / (c + g), (n * n * c - g) / (n * n * c + g)
    t_s, t_p = 4 * c * g / (c + g) ** 2, 4 * n * n * c * g / (n * n * c + g) ** 2
    return float((s * s + p * p) / 2), float((t_s + t_p) / 2)


def fresnel(cosines: FloatArray, n: FloatArray) -> Boundary:
    """Of the exact numbers that these floats are; n: index inside over outside."""
    with ctx.workprec(BITS):
        found = [
            _exact_fresnel(arb(c), arb(i))
            for c, i in zip(cosines.tolist(), n.tolist(), strict=True)
        ]
    return Boundary(*np.array(found).T)


def fresnel_near(cosines: FloatArray, n: FloatArray, u: float, of_index: float) -> Boundary:
    """How far R and T move when cosines do by `u` relatively, and indices by `of_index`."""
    here = fresnel(cosines, n)
    moves = [(u, 0.0), (-u, 0.0)] + ([(0.0, of_index), (0.0, -of_index)] if of_index else [])
    moved = [fresnel(cosines * (1.0 + a), n * (1.0 + b)) for a, b in moves]
    return Boundary(
        np.max([np.abs(m.reflectance - here.reflectance) for m in moved], axis=0),
        np.max([np.abs(m.transmittance - here.transmittance) for m in moved], axis=0),
    )


class Normals(NamedTuple):
    """density (n,): D at the half vector;  slope2 (n,): of its slope over alpha, squared."""

    density: FloatArray
    slope2: FloatArray


def density_between(kind: str, alpha: float, wo: FloatArray, wi: FloatArray) -> Normals:
    """D at wo + wi made unit, of the very numbers; see `microfacet.density` for the formulae."""
    found = []
    with ctx.workprec(BITS):
        a = arb(alpha)
        for o, i in zip(wo.tolist(), wi.tolist(), strict=True):
            x, y, z = (arb(p) + arb(q) for p, q in zip(o, i, strict=True))
            length2 = x * x + y * y + z * z
            slope2 = (x * x + y * y) / (a * a * z * z)
            cos4 = (z * z / length2) ** 2
            if kind == "ggx":
                d = 1 / (arb.pi() * a * a * cos4 * (1 + slope2) ** 2)
            else:
                d = (-slope2).exp() / (arb.pi() * a * a * cos4)
            found.append((float(d), float(slope2)))
    return Normals(*np.array(found).T)


def masking(kind: str, alpha: float, v: FloatArray) -> FloatArray:
    """Smith's G1 of the very numbers."""
    found = []
    with ctx.workprec(BITS):
        for x, y, z in v.tolist():
            s = arb(alpha) * (arb(x) * arb(x) + arb(y) * arb(y)).sqrt()
            if not s > 0:
                found.append(1.0)
                continue
            a = arb(z) / s
            if kind == "ggx":
                rest = ((1 + 1 / (a * a)).sqrt() - 1) / 2
            else:
                tail = (-a * a).exp() / (2 * a * arb.pi().sqrt())
                rest = tail - a.erfc() / 2
            found.append(float(1 / (1 + rest)))
    return np.array(found)
