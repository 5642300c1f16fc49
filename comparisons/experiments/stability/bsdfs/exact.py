"""The laws of smooth and rough boundaries in 300 bits: what floats are measured against."""

from typing import NamedTuple

import numpy as np
from flint import arb

from comparisons.experiments.stability.harness.exactly import exactly
from comparisons.experiments.stability.harness.outcomes import FloatArray


class Boundary(NamedTuple):
    """R, T (n,): reflectance and transmittance."""

    reflectance: FloatArray
    transmittance: FloatArray


def _fresnel(cosine: arb, n: arb) -> tuple[arb, arb]:
    """With c outside and g = n times the cosine inside, g² = c² + n² - 1; cosine < 0 inside."""
    k = n * n - 1
    if cosine > 0:
        c2 = cosine * cosine
        g2 = c2 + k
    else:
        g2 = n * n * cosine * cosine
        c2 = g2 - k
    if not (c2 > 0 and g2 > 0):
        return arb(1), arb(0)
    c, g = c2.sqrt(), g2.sqrt()
    s, p = (c - g) / (c + g), (n * n * c - g) / (n * n * c + g)
    t_s, t_p = 4 * c * g / (c + g) ** 2, 4 * n * n * c * g / (n * n * c + g) ** 2
    return (s * s + p * p) / 2, (t_s + t_p) / 2


def fresnel(cosines: FloatArray, n: FloatArray) -> Boundary:
    """Of the exact numbers that these floats are; n: index inside over outside."""
    return Boundary(*exactly(_fresnel, cosines, n).T)


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

    def formula(o: list[arb], i: list[arb]) -> tuple[arb, arb]:
        a = arb(alpha)
        x, y, z = (p + q for p, q in zip(o, i, strict=True))
        length2 = x * x + y * y + z * z
        slope2 = (x * x + y * y) / (a * a * z * z)
        cos4 = (z * z / length2) ** 2
        if kind == "ggx":
            return 1 / (arb.pi() * a * a * cos4 * (1 + slope2) ** 2), slope2
        return (-slope2).exp() / (arb.pi() * a * a * cos4), slope2

    return Normals(*exactly(formula, wo, wi).T)


def masking(kind: str, alpha: float, v: FloatArray) -> FloatArray:
    """Smith's G1 of the very numbers."""

    def formula(direction: list[arb]) -> arb:
        x, y, z = direction
        s = arb(alpha) * (x * x + y * y).sqrt()
        if not s > 0:
            return arb(1)
        a = z / s
        if kind == "ggx":
            return 1 / (1 + ((1 + 1 / (a * a)).sqrt() - 1) / 2)
        tail = (-a * a).exp() / (2 * a * arb.pi().sqrt())
        return 1 / (1 + (tail - a.erfc() / 2))

    return exactly(formula, v)
