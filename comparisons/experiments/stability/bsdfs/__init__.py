"""F11: reciprocity, sampling and the digits of materials at their extremes.

Law.
- reciprocity (`samples`): |f(a, b) - f(b, a)| <= 1e-12 of the larger; through a boundary of what
  carries power, f(a, b) eta_b² = f(b, a) eta_a², eta the index on a direction's side.  1e-12 is
  9007 u, u = 2^-53; Mitsuba, in float32, is given 9007 of its own u = 2^-24 (5.4e-4).  Values below
  1e-290 (1e-30) count as 0: they have lost digits to the end of the exponent.
- consistency (`samples`): the weight that `sample` returns times its density is `evaluate` at the
  direction drawn, and the density is `pdf`, to 32 u times the condition 14 / (|h| min(alpha, cos,
  g)) of a half vector h: what rounding a direction to floats changes D, the cosines and Fresnel's
  root by.
- bounds: everything is finite; no sample of a metal or a glass weighs more than 1 in power.
- densities: samples have the stated density (chi-square, at the level of `harness.worlds`), and it
  integrates to at most 1, up to what two rules of quadrature differ by;
- digits: Fresnel's R and T, the distribution D and the masking G1 are the exact
  formulae of the very floats, evaluated in 300 bits, to 64 u of their value, plus what moving the
  cosine by 4 u moves them (as at the critical angle); of Beckmann's D times 1 + slope², as its
  exponent is rounded.  Mitsuba gets the same in its own u, and numbers that float32 holds.

Range.  Cosines to 1e-12, alpha 1e-4 to 1, indices 1 ± 1e-8 to 4, the critical angle to 1e-15 of it.
Mitsuba takes no part where its float32 cannot tell the index from 1.

Counts.  1e5 pairs of directions a material and point in the full run.

Passes.  No failure; each chi-square test has a false alarm of at most 1e-8."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from flint import arb, ctx

from comparisons.experiments.stability.bsdfs.samples import (
    CONSISTENCY,
    DENSITY,
    GRAZING,
    MATCHED,
    ROUGHNESS,
    in_float32,
    matched,
)
from comparisons.experiments.stability.harness.bsdfs import ALPHA, towards
from comparisons.experiments.stability.harness.core import (
    MITSUBA,
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
    Sweep,
    decades,
    hexed,
    of_errors,
    plain,
    relative,
    together,
    unit_of,
)
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.materials.microfacet import fresnel as our_fresnel
from reference_rt.materials.microfacet import ggx_and_smith
from reference_rt.materials.microfacet.ggx_and_smith import BECKMANN, GGX, Microfacets

# ---- the laws of smooth and rough boundaries in 300 bits: what floats are measured against -------


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


def _boundary(
    draw: Draw, cosines: FloatArray, n: FloatArray, mitsuba_too: bool
) -> dict[str, Outcome]:
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


def _index(draw: Draw, x: float) -> dict[str, Outcome]:
    parts = []
    for index in matched(x):
        rounded = float(np.float32(index))
        n = rounded if in_float32(index) else index
        cosines = _signed(draw.rng, draw.cases, 1e-12)
        parts.append(_boundary(draw, cosines, np.full(draw.cases, n), in_float32(index)))
    return together(parts)


def _edge(draw: Draw, x: float) -> dict[str, Outcome]:
    """Off the critical angle by 1 / x to 2 / x of its cosine, passing or not."""
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


def _densities(draw: Draw, x: float) -> dict[str, Outcome]:
    """Between directions of which one is the other mirrored by a facet of slope up to 4 alpha."""
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


def _masking(draw: Draw, x: float) -> dict[str, Outcome]:
    parts, n = [], draw.cases
    for kind, code in KINDS.items():
        for alpha in (1e-4, 0.1, 1.0):
            alpha = float(np.float32(alpha))
            cosine = np.minimum(1.0, draw.rng.uniform(1.0, 2.0, n) / x)
            v = round32(towards(cosine, draw.rng.uniform(0.0, 2.0 * math.pi, n)))
            exact = masking(kind, alpha, v)
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


INDEX = Series(
    "fresnel, matched indices",
    Sweep(
        "1 / |index - 1|",
        (1.0 / 3.0, 2.0, *decades(1, 12)),
        (1.0 / 3.0, 1e2, 1e5, 1e8),
        1_000,
        20_000,
    ),
    "R and T of a boundary from both sides, cosines down to 1e-12, against 300 bits.",
    _index,
    unit="of what is allowed",
)
EDGE = Series(
    "fresnel, critical angle",
    Sweep("1 / relative distance from it", decades(0, 15), (1e1, 1e5, 1e10, 1e15), 1_000, 20_000),
    "R and T beside the critical angle of indices from 1.01 to 4 and their inverses, against 300 "
    "bits.",
    _edge,
    unit="of what is allowed",
)
NORMALS = Series(
    "distribution of normals",
    ALPHA(1_000, 20_000),
    "D between two directions that a facet of slope within some alpha mirrors, cosines down to "
    "1e-6, against 300 bits.",
    _densities,
    unit="of the value",
    explained="64 u of the value are allowed, in each one's own u: 3.8e-6 for Mitsuba, which is "
    "off by 5.1e-7 to 8.3e-7, no more at small alpha than at large",
)
MASKING = Series(
    "masking",
    Sweep("1 / cosine", decades(0, 12), (1.0, 1e3, 1e6, 1e12), 300, 5_000),
    "G1 of GGX and Beckmann, alpha 1e-4, 0.1 and 1, against 300 bits.",
    _masking,
    unit="of the value",
)


# ---- the series ----------------------------------------------------------------------------------


FAMILY = Family(
    id="F11",
    name="reciprocity and sampling of materials",
    law="light goes either way alike, samples have the density that is said, and the formulae keep "
    "their digits at grazing angles, in narrow lobes and at matched indices",
    anchors="Nori: 15 cases of chi-square; pbrt: its reciprocity test of hair is switched off",
    series=(GRAZING, ROUGHNESS, MATCHED, CONSISTENCY, DENSITY, INDEX, EDGE, NORMALS, MASKING),
)
