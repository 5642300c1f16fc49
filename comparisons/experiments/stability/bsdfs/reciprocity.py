"""Reciprocity: pairs of directions, both ways."""

import math

import numpy as np

from comparisons.experiments.stability.harness.bsdfs import (
    ALPHA,
    EVEN,
    ROUGH,
    Bsdf,
    Ours,
    contestants,
    index_of,
    towards,
)
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcomes,
    of_errors,
    plain,
    together,
    unit_of,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, decades, series
from reference_rt.materials import Material, RoughDielectric

ALLOWED = 9007.0
"""Units of roundoff: 1e-12 in float64."""

CASES = 2_000, 100_000

LEAST = {OURS: 1e-290, MITSUBA: 1e-30}


def asymmetry(bsdf: Bsdf, n: float, wo: FloatArray, wi: FloatArray, least: float) -> FloatArray:
    """|f(a, b) eta_b² - f(b, a) eta_a²| over the larger, of the worst channel, (m,)."""
    there = bsdf.evaluate(wo, wi) / np.abs(wi[:, 2:])
    back = bsdf.evaluate(wi, wo) / np.abs(wo[:, 2:])
    there = there * np.where(wi[:, 2:] < 0.0, n * n, 1.0)
    back = back * np.where(wo[:, 2:] < 0.0, n * n, 1.0)
    size = np.maximum(np.abs(there), np.abs(back))
    with np.errstate(invalid="ignore"):  # inf - inf: a failure, below
        off = np.abs(there - back)
    found = np.where(size >= least, off / np.maximum(size, least), 0.0)
    found[~np.isfinite(there) | ~np.isfinite(back)] = np.inf
    return np.asarray(found.max(axis=1))


def _compared(
    material: Material, name: str, draw: Draw, wo: FloatArray, wi: FloatArray
) -> Outcomes:
    found, n = {}, index_of(material)
    for who, bsdf in contestants(material, draw):
        errors = asymmetry(bsdf, n, wo, wi, LEAST[who])
        shown = {"material": name, "wo": wo, "wi": wi, "asymmetry": plain(errors)}
        found[who] = of_errors(errors, ALLOWED * unit_of(who), shown)
    return found


def _cosines(rng: np.random.Generator, n: int, least: float) -> FloatArray:
    return np.asarray(10.0 ** rng.uniform(math.log10(least), 0.0, n))


def _sides(material: Material, rng: np.random.Generator, n: int) -> FloatArray:
    return rng.choice([-1.0, 1.0], n) if material.transmits else np.ones(n)


def grazing_pairs(
    material: Material, rng: np.random.Generator, n: int, x: float
) -> tuple[FloatArray, FloatArray]:
    """One direction at a cosine of 1 / x to 2 / x, the other anywhere down to it: in a third any
    azimuth, in a third nearly the opposite one, in a third nearly the same."""
    phi = rng.uniform(0.0, 2.0 * math.pi, n)
    near = 10.0 ** rng.uniform(-8.0, 0.0, n) * rng.choice([-1.0, 1.0], n)
    turn = np.choose(np.arange(n) % 3, [rng.uniform(0.0, 2.0 * math.pi, n), math.pi + near, near])
    low = np.minimum(1.0, rng.uniform(1.0, 2.0, n) / x)
    wo = towards(low * _sides(material, rng, n), phi)
    wi = towards(_cosines(rng, n, 1.0 / x) * _sides(material, rng, n), phi + turn)
    swap = (np.arange(n) // 3 % 2 == 0)[:, None]
    return np.where(swap, wo, wi), np.where(swap, wi, wo)


def drawn_pairs(
    material: Material, rng: np.random.Generator, n: int
) -> tuple[FloatArray, FloatArray]:
    """Where the material scatters to, of a direction anywhere, a third of them grazing."""
    cosine = np.where(np.arange(n) % 3 == 0, _cosines(rng, n, 1e-6), rng.uniform(0.0, 1.0, n))
    wo = towards(np.maximum(cosine, 1e-6) * _sides(material, rng, n), rng.uniform(0.0, 6.28, n))
    drawn = Ours.of(material).sample(wo, rng.uniform(0.0, 1.0, (n, 3)))
    there = (drawn.pdf > 0.0) & ~drawn.is_delta & (np.abs(drawn.wi[:, 2]) > 1e-12)
    return wo[there], drawn.wi[there]


@series(Sweep("1 / cosine", decades(0, 12), (1.0, 1e3, 1e6, 1e12), *CASES), unit="of the value")
def grazing(draw: Draw, x: float) -> Outcomes:
    """f(a, b) against f(b, a) of a dozen materials, one direction at this cosine, the other
    anywhere down to it, opposite and alongside too."""
    found = []
    materials = [(f"{name}, alpha 0.3", make(0.3)) for name, make in ROUGH.items()]
    for name, material in [*materials, *EVEN.items()]:
        wo, wi = grazing_pairs(material, draw.rng, draw.cases, x)
        found.append(_compared(material, name, draw, wo, wi))
    return together(found)


@series(
    ALPHA(*CASES),
    unit="of the value",
    explained="the range ends at alpha 1e-4, and Mitsuba fails within it: in 8 of 19,784 pairs at "
    "alpha 1/30, 1,079 of 19,862 at 1e-4, where one is all of the value off",
)
def roughness(draw: Draw, x: float) -> Outcomes:
    """f(a, b) against f(b, a) of rough materials, b drawn by the material for a."""
    found = []
    for name, make in ROUGH.items():
        material = make(1.0 / x)
        wo, wi = drawn_pairs(material, draw.rng, draw.cases)
        found.append(_compared(material, name, draw, wo, wi))
    return together(found)


def glass(index: float, alpha: float, distribution: str) -> Material:
    described = {"interior_ior": index, "alpha": alpha, "distribution": distribution}
    return RoughDielectric.model_validate({"type": "rough_dielectric", **described})


def indices_beside_1(x: float) -> tuple[float, ...]:
    """Indices 1 + 1 / x and, below 1, 1 - 1 / x or, for large ones, the inverse."""
    return 1.0 + 1.0 / x, 1.0 - 1.0 / x if x > 2.0 else 1.0 / (1.0 + 1.0 / x)


def in_float32(index: float) -> bool:
    """Whether Mitsuba can tell it from 1."""
    return float(np.float32(index)) != 1.0


@series(
    Sweep("1 / |index - 1|", (1.0 / 3.0, 2.0, *decades(1, 8)), (1.0 / 3.0, 1e2, 1e5, 1e8), *CASES),
    unit="of the value",
)
def matched_indices(draw: Draw, x: float) -> Outcomes:
    """f(a, b) against f(b, a) of rough glass of alpha 0.1 whose index is nearly that outside."""
    found = []
    for index in indices_beside_1(x):
        # Theirs is computed with a rounded index: the law holds with that one too.
        seen = draw._replace(mitsuba=draw.mitsuba and in_float32(index))
        for distribution in ("ggx", "beckmann"):
            material = glass(index, 0.1, distribution)
            wo, wi = drawn_pairs(material, draw.rng, draw.cases)
            name = f"{distribution} glass of index {index:.10g}, alpha 0.1"
            found.append(_compared(material, name, seen, wo, wi))
    return together(found)
