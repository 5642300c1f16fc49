"""Values of formulae against those in 300 bits."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from comparisons.experiments.stability.bsdfs.exact import density_between, fresnel, fresnel_near
from comparisons.experiments.stability.bsdfs.exact import masking as exact_masking
from comparisons.experiments.stability.bsdfs.reciprocity import in_float32, indices_beside_1
from comparisons.experiments.stability.harness.bsdfs import ALPHA, towards
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcome,
    Outcomes,
    hexed,
    of_errors,
    plain,
    relative,
    together,
    unit_of,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, decades, series
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.materials.microfacet import fresnel as our_fresnel
from reference_rt.materials.microfacet import ggx_and_smith
from reference_rt.materials.microfacet.ggx_and_smith import BECKMANN, GGX, Microfacets

SAFETY = 64.0
"""Roundings allowed: Fresnel's R takes 24 at most, the squares of sums of squares of D 20."""

KINDS = {"ggx": GGX, "beckmann": BECKMANN}


@entry_kernel
def _fresnel(cosines: Any, n: Any, out: Any) -> None:
    for i in range(len(cosines)):
        found = our_fresnel.fresnel(cosines[i], n[i])
        out[i, 0], out[i, 1] = found.reflectance, found.transmittance


@entry_kernel
def _normals(m: Microfacets, wo: Any, wi: Any, out: Any) -> None:
    for i in range(len(wo)):
        half = ggx_and_smith.half_vector(row(wo, i), row(wi, i))
        out[i, 0] = ggx_and_smith.density(m, half.h)
        out[i, 1] = ggx_and_smith.g1(m, row(wo, i))


def _ours(cosines: FloatArray, n: FloatArray) -> FloatArray:
    out = np.empty((len(cosines), 2))
    _fresnel(cosines, n, out)
    return out


def _theirs(cosines: FloatArray, n: FloatArray) -> FloatArray:
    """R and, as Mitsuba's materials have it, 1 - R."""
    mi = mitsuba()
    found = for_rays(lambda c, i: (mi.fresnel(c, i)[0], 1.0 - mi.fresnel(c, i)[0]), cosines, n)
    return np.stack(found, axis=1)


def _textbook(cosines: FloatArray, n: FloatArray) -> FloatArray:
    """Snell's law by 1 - sin², amplitudes as differences, what passes as 1 - R."""
    eta = np.where(cosines > 0.0, n, 1.0 / n)
    c = np.abs(cosines)
    with np.errstate(invalid="ignore"):
        t = np.sqrt(1.0 - (1.0 - c * c) / (eta * eta))
        s, p = (c - eta * t) / (c + eta * t), (eta * c - t) / (eta * c + t)
        r = np.where(np.isnan(t), 1.0, 0.5 * (s * s + p * p))
    return np.stack([r, 1.0 - r], axis=1)


TEXTBOOK = "fresnel.difference"


def _boundary(draw: Draw, cosines: FloatArray, n: FloatArray, mitsuba_too: bool) -> Outcomes:
    """R and T of floats that float32 holds, where it can: one case each."""
    methods: dict[str, Callable[[FloatArray, FloatArray], FloatArray]]
    methods = {OURS: _ours, TEXTBOOK: _textbook}
    if draw.mitsuba and mitsuba_too:
        methods[MITSUBA] = _theirs
    exact = fresnel(cosines, n)
    found: dict[str, Outcome] = {}
    for who, method in methods.items():
        unit = unit_of(who)
        near = fresnel_near(cosines, n, 4.0 * unit, 0.0)
        values = method(cosines, n)
        parts = []
        for k, name in enumerate(("reflectance", "transmittance")):
            truth = np.asarray(exact[k])
            # Below 1e-36 float32 has no digits left.
            size = np.maximum(truth, 1e-36 if who == MITSUBA else 1e-290)
            allowed = SAFETY * unit + near[k] / size
            errors = np.abs(values[:, k] - truth) / size
            shown = {
                "cosine": cosines,
                "index": n,
                name: plain(truth),
                "found": plain(values[:, k]),
            }
            parts.append({who: of_errors(errors / allowed, 1.0, shown)})
        found |= together(parts)
    return found


def _signed(rng: np.random.Generator, n: int, least: float) -> FloatArray:
    """Cosines to `least`, from both sides, that float32 holds."""
    size = 10.0 ** rng.uniform(math.log10(least), 0.0, n)
    return round32(size * rng.choice([-1.0, 1.0], n))


@series(
    Sweep(
        "1 / |index - 1|",
        (1.0 / 3.0, 2.0, *decades(1, 12)),
        (1.0 / 3.0, 1e2, 1e5, 1e8),
        *(1_000, 20_000),
    ),
    "fresnel, matched indices",
    unit="of what is allowed",
)
def fresnel_matched_indices(draw: Draw, x: float) -> Outcomes:
    """R and T of a boundary from both sides, cosines down to 1e-12, against 300 bits."""
    parts = []
    for index in indices_beside_1(x):
        rounded = float(np.float32(index))
        n = rounded if in_float32(index) else index
        cosines = _signed(draw.rng, draw.cases, 1e-12)
        parts.append(_boundary(draw, cosines, np.full(draw.cases, n), in_float32(index)))
    return together(parts)


@series(
    Sweep("1 / relative distance from it", decades(0, 15), (1e1, 1e5, 1e10, 1e15), 1_000, 20_000),
    "fresnel, critical angle",
    unit="of what is allowed",
)
def fresnel_critical_angle(draw: Draw, x: float) -> Outcomes:
    """R and T beside the critical angle of indices from 1.01 to 4 and their inverses, against 300
    bits."""
    n = round32(draw.rng.uniform(1.01, 4.0, draw.cases))
    outside = draw.rng.random(draw.cases) < 0.5
    n = np.where(outside, round32(1.0 / n), n)
    critical = np.sqrt(np.abs(n - 1.0) * (n + 1.0)) / np.where(outside, 1.0, n)
    off = draw.rng.uniform(1.0, 2.0, draw.cases) / x * draw.rng.choice([-1.0, 1.0, 1.0], draw.cases)
    cosines = np.minimum(critical * (1.0 + off), 1.0) * np.where(outside, 1.0, -1.0)
    if 1.0 / x > 2.0**-22:
        cosines = round32(cosines)
    return _boundary(draw, cosines, n, 1.0 / x > 2.0**-22)


def _cosine_form(alpha: float, wo: FloatArray, wi: FloatArray) -> FloatArray:
    """GGX by the half vector's cosine alone, as it is often written."""
    h = wo + wi
    z = h[:, 2] / np.linalg.norm(h, axis=1)
    a2 = alpha * alpha
    bottom = (z * z) * (a2 - 1.0) + 1.0
    with np.errstate(divide="ignore"):
        return np.asarray(a2 / (math.pi * bottom * bottom))


def _mitsuba_normals(kind: str, alpha: float) -> Any:
    mi = mitsuba()
    names = {"ggx": mi.MicrofacetType.GGX, "beckmann": mi.MicrofacetType.Beckmann}
    return mi.MicrofacetDistribution(names[kind], alpha, True)


@series(
    ALPHA(1_000, 20_000),
    unit="of the value",
    explained="64 u of the value are allowed, in each one's own u: 3.8e-6 for Mitsuba, which is "
    "off by 5.1e-7 to 8.3e-7, no more at small alpha than at large",
)
def distribution_of_normals(draw: Draw, x: float) -> Outcomes:
    """D between two directions that a facet of slope within some alpha mirrors, cosines down to
    1e-6, against 300 bits."""
    import drjit as dr

    parts, alpha = [], float(np.float32(1.0 / x))
    n = draw.cases
    for kind, code in KINDS.items():
        cosine = 10.0 ** draw.rng.uniform(-6.0, 0.0, n)
        wo = towards(cosine, draw.rng.uniform(0.0, 2.0 * math.pi, n))
        slopes = draw.rng.normal(size=(n, 2)) * 1.5 * alpha
        h = np.stack([slopes[:, 0], slopes[:, 1], np.ones(n)], axis=1)
        h /= np.linalg.norm(h, axis=1, keepdims=True)
        wi = 2.0 * (wo * h).sum(axis=1, keepdims=True) * h - wo
        wo, wi = round32(wo), round32(wi)
        kept = (wi[:, 2] > 0.0) & (wo[:, 2] > 0.0)
        wo, wi = np.ascontiguousarray(wo[kept]), np.ascontiguousarray(wi[kept])
        exact = density_between(kind, alpha, wo, wi)
        out = np.empty((len(wo), 2))
        _normals(Microfacets(code, alpha, alpha), wo, wi, out)
        values = {OURS: out[:, 0]}
        if kind == "ggx":
            values["ggx.cosine"] = _cosine_form(alpha, wo, wi)
        if draw.mitsuba:
            d = _mitsuba_normals(kind, alpha)
            found = for_rays(lambda o, i, d=d: (d.eval(dr.normalize(o + i)),), wo, wi)
            values[MITSUBA] = found[0]
        for who, value in values.items():
            # Beckmann's exponent is rounded relatively; GGX is a square of sums.
            condition = 1.0 + (exact.slope2 if kind == "beckmann" else 0.0)
            seen = exact.density > (1e-19 if who == MITSUBA else 1e-280)
            errors = np.where(seen, relative(value, exact.density), 0.0) / condition
            shown = {"distribution": kind, "alpha": hexed(alpha), "wo": wo, "wi": wi}
            shown |= {"D": plain(exact.density), "found": plain(value)}
            parts.append({who: of_errors(errors, SAFETY * unit_of(who), shown)})
    return together(parts)


@series(Sweep("1 / cosine", decades(0, 12), (1.0, 1e3, 1e6, 1e12), 300, 5_000), unit="of the value")
def masking(draw: Draw, x: float) -> Outcomes:
    """G1 of GGX and Beckmann, alpha 1e-4, 0.1 and 1, against 300 bits."""
    parts, n = [], draw.cases
    for kind, code in KINDS.items():
        for alpha in (1e-4, 0.1, 1.0):
            alpha = float(np.float32(alpha))
            cosine = np.minimum(1.0, draw.rng.uniform(1.0, 2.0, n) / x)
            v = round32(towards(cosine, draw.rng.uniform(0.0, 2.0 * math.pi, n)))
            exact = exact_masking(kind, alpha, v)
            out = np.empty((n, 2))
            _normals(Microfacets(code, alpha, alpha), v, v, out)
            values = {OURS: out[:, 1]}
            if draw.mitsuba:
                d = _mitsuba_normals(kind, alpha)
                up = np.tile([0.0, 0.0, 1.0], (n, 1))
                values[MITSUBA] = for_rays(lambda o, h, d=d: (d.smith_g1(o, h),), v, up)[0]
            for who, value in values.items():
                shown = {"distribution": kind, "alpha": hexed(alpha), "direction": v}
                shown |= {"G1": plain(exact), "found": plain(value)}
                errors = relative(value, exact)
                parts.append({who: of_errors(errors, SAFETY * unit_of(who), shown)})
    return together(parts)
