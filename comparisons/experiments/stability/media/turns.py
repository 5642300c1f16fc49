"""Phase functions: their values, the directions that they draw, and whether the two agree."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from flint import arb
from scipy import stats

import reference_rt as rt
from comparisons.experiments.stability.harness import chance
from comparisons.experiments.stability.harness.exactly import cross, dot, exactly
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcomes,
    of_errors,
    one_case,
    plain,
    relative,
    together,
    unit_of,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, decades, series
from comparisons.experiments.stability.harness.worlds import grey
from comparisons.geometry.affine import unit_vectors
from comparisons.geometry.frame import round32
from comparisons.media.phases import translate_phase
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.media import AnyPhase
from reference_rt.media import phase as our_phase
from reference_rt.media.phase import Lobes
from reference_rt.media.tables import media_table

TEXTBOOK = "phase.textbook"
"""1 + g² - 2 g cosine as it stands, and the cosine by PBR 4ed, 11.14."""


@entry_kernel
def _values(lobes: Lobes, cosines: Any, out: Any) -> None:
    for i in range(len(cosines)):
        out[i] = our_phase.phase(lobes, 0, cosines[i])


@entry_kernel
def _turned(lobes: Lobes, d: Any, u: Any, out: Any) -> None:
    for i in range(len(u)):
        w = our_phase.turned(lobes, 0, row(d, i), u[i, 0], u[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = w


def _lobes(of: AnyPhase) -> Lobes:
    medium = rt.Homogeneous(sigma_t=grey(1.0), albedo=grey(1.0), phase=of)
    return media_table([medium], [], []).lobes


def _our_directions(of: AnyPhase, d: FloatArray, u: FloatArray) -> FloatArray:
    out = np.empty_like(d)
    _turned(_lobes(of), np.ascontiguousarray(d), np.ascontiguousarray(u), out)
    return out


def _in_mitsuba(of: AnyPhase) -> tuple[Any, Any, Callable[[Any], Any]]:
    """A phase function, its context, and what is known of light that travels along d."""
    import drjit as dr

    mi = mitsuba()

    def arriving(d: Any) -> Any:
        found = dr.zeros(mi.MediumInteraction3f)
        found.wi = -d
        found.sh_frame = mi.Frame3f(found.wi)
        return found

    return mi.load_dict(translate_phase(of)), mi.PhaseFunctionContext(), arriving


def _their_values(of: AnyPhase, cosines: FloatArray) -> FloatArray:
    mi = mitsuba()
    plugin, context, arriving = _in_mitsuba(of)

    def value(c: Any) -> tuple[Any, ...]:
        sine = (1.0 - c * c) ** 0.5
        return (
            plugin.eval_pdf(context, arriving(mi.Vector3f(0, 0, 1)), mi.Vector3f(sine, 0, c))[1],
        )

    return for_rays(value, cosines)[0]


def _their_directions(of: AnyPhase, d: FloatArray, u: FloatArray) -> FloatArray:
    """The number that picks a part of a blend is one of its own, and the others' are the same."""
    mi = mitsuba()
    plugin, context, arriving = _in_mitsuba(of)

    def drawn(along: Any, a: Any, b: Any, part: Any) -> tuple[Any, ...]:
        return (plugin.sample(context, arriving(along), part, mi.Point2f(a, b))[0],)

    part = np.random.default_rng(len(u)).random(len(u))
    return for_rays(drawn, d, u[:, 0], u[:, 1], part)[0]


# ---- values -------------------------------------------------------------------------------------

NARROW = Sweep("1 / (1 - |g|)", (2.0, *decades(1, 8)), (2.0, 1e4, 1e8), 1_000, 20_000)

IN_FLOAT32 = 1e7
"""1 / (1 - |g|) below which float32 holds g."""


def _asymmetry(rng: np.random.Generator, x: float) -> float:
    """g of either sign, near 1 - 1 / x; a number that float32 holds, where it can."""
    g = np.array(1.0 - 1.0 / x)
    return float(round32(g) if x < IN_FLOAT32 else g) * float(rng.choice([-1.0, 1.0]))


def _cosines(rng: np.random.Generator, n: int) -> FloatArray:
    """In turn any, and near 1 and -1, down to a float from them."""
    near = (1.0 - 10.0 ** rng.uniform(-15.0, 0.0, n)) * rng.choice([-1.0, 1.0], n)
    return np.where(np.arange(n) % 2 == 0, near, rng.uniform(-1.0, 1.0, n))


def _textbook(g: float, cosines: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):
        span = 1.0 + g * g - 2.0 * g * cosines
        return np.asarray((1.0 - g * g) / (4.0 * math.pi * span * np.sqrt(span)))


@series(NARROW, unit="of the value")
def phase_values(draw: Draw, x: float) -> Outcomes:
    """Henyey and Greenstein's function at any cosine, and near 1 and -1, against 300 bits."""
    g, cosines = _asymmetry(draw.rng, x), _cosines(draw.rng, draw.cases)
    of, ours = rt.HenyeyGreenstein(g=g), np.empty(draw.cases)
    _values(_lobes(of), cosines, ours)
    found = {OURS: (cosines, ours), TEXTBOOK: (cosines, _textbook(g, cosines))}
    if draw.mitsuba and x < IN_FLOAT32:
        single = round32(cosines)
        found[MITSUBA] = single, _their_values(of, single)

    def formula(c: arb) -> arb:
        a = arb(g)
        span = 1 + a * a - 2 * a * c
        return (1 - a * a) / (4 * arb.pi() * span * span.sqrt())

    outcomes = {}
    for who, (given, value) in found.items():
        exact = exactly(formula, given)
        shown = {"g": g, "cosine": given, "value": plain(exact), "found": plain(value)}
        outcomes[who] = of_errors(relative(value, exact), 16.0 * unit_of(who), shown)
    return outcomes


# ---- directions ---------------------------------------------------------------------------------


def _angles(g: float, u: FloatArray, d: FloatArray, w: FloatArray) -> FloatArray:
    """(n, 2): the angle between d and w, and that whose distribution function is u: with s =
    (1 - g²) / (1 - g + 2 g u), the cosine (1 + g² - s²) / (2 g)."""

    def formula(v: arb, a: list[arb], b: list[arb]) -> tuple[arb, arb]:
        normal, exact = cross(a, b), arb(g)
        turned = arb.atan2(dot(normal, normal).sqrt(), dot(a, b))
        s = (1 - exact**2) / (1 - exact + 2 * exact * v)
        cosine = (1 + exact**2 - s**2) / (2 * exact)
        rest = 1 - cosine**2
        sine = rest.sqrt() if rest > 0 else arb(0)
        return turned, arb.atan2(sine, cosine)

    return exactly(formula, u, d, w)


def _textbooks_directions(g: float, d: FloatArray, u: FloatArray) -> FloatArray:
    """From z on: the frame of d turns both."""
    s = (1.0 - g * g) / (1.0 - g + 2.0 * g * u[:, 0])
    cosine = (1.0 + g * g - s * s) / (2.0 * g)
    sine = np.sqrt(np.maximum(0.0, 1.0 - cosine**2))
    phi = 2.0 * math.pi * u[:, 1]
    x = np.cross(d, np.where(np.abs(d[:, :1]) < 0.5, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(d, x)
    along = (sine * np.cos(phi))[:, None] * x + (sine * np.sin(phi))[:, None] * y
    return np.asarray(along + cosine[:, None] * d)


@series(NARROW, unit="radians")
def turned_light(draw: Draw, x: float) -> Outcomes:
    """Directions that Henyey and Greenstein's function draws for light of any direction: the angle
    between the two against that whose distribution function is the number, in 300 bits."""
    g, n = _asymmetry(draw.rng, x), draw.cases
    d = unit_vectors(draw.rng, n)
    u = round32(draw.rng.random((n, 2)) * (1.0 - 2.0**-24))
    of = rt.HenyeyGreenstein(g=g)
    found = {OURS: _our_directions(of, d, u), TEXTBOOK: _textbooks_directions(g, d, u)}
    if draw.mitsuba and x < IN_FLOAT32:
        found[MITSUBA] = _their_directions(of, d, u)
    outcomes = {}
    for who, w in found.items():
        turned, exact = _angles(g, u[:, 0], round32(d) if who == MITSUBA else d, w).T
        length = np.abs(np.linalg.norm(w, axis=1) - 1.0)
        errors = np.maximum(np.abs(turned - exact), length)
        shown = {"g": g, "number": u[:, 0].copy(), "direction": d, "turned to": w}
        shown |= {"angle": plain(exact), "found": plain(turned)}
        outcomes[who] = of_errors(errors, 16.0 * unit_of(who), shown)
    return outcomes


# ---- densities ----------------------------------------------------------------------------------

CELLS = (32, 8)
"""Of the numbers along the cosine, and around."""


def _below(of: AnyPhase, far: FloatArray) -> FloatArray:
    """The distribution function of the cosine 1 - far: far is |w - d|² / 2, without cancellation
    where light goes straight on."""
    if isinstance(of, rt.BlendPhase):
        first, second = _below(of.first, far), _below(of.second, far)
        return (1.0 - of.weight) * first + of.weight * second
    if isinstance(of, rt.Rayleigh):
        c = 1.0 - far
        return np.asarray((c**3 + 3.0 * c + 4.0) / 8.0)
    g = getattr(of, "g", 0.0)
    if g == 0.0:
        return np.asarray(1.0 - far / 2.0)
    near = 1.0 - g
    with np.errstate(invalid="ignore", divide="ignore"):  # directions that are none
        root = np.sqrt(near * near + 2.0 * g * far)
    return np.asarray(near * (1.0 + g) / (2.0 * g) * (1.0 / root - 1.0 / (1.0 + g)))


def phases_of(x: float) -> dict[str, AnyPhase]:
    """At a point of the sweep."""
    g = 1.0 - 1.0 / x
    forwards, backwards = rt.HenyeyGreenstein(g=g), rt.HenyeyGreenstein(g=-g)
    blend = rt.BlendPhase(first=forwards, second=rt.Rayleigh(), weight=0.3)
    return {"forwards": forwards, "backwards": backwards, "blend with rayleigh": blend}


@series(
    Sweep("1 / (1 - |g|)", (1.0, 2.0, *decades(1, 4)), (1.0, 1e1, 1e4), 20_000, 100_000),
    explained="the range ends at 1e4, and Mitsuba fails within it, at 1,000: its cosines are "
    "differences of numbers that are alike, so that float32 leaves steps in the peak",
)
def phase_densities(draw: Draw, x: float) -> Outcomes:
    """Directions that phase functions draw for light of any direction, chi-square over cells of the
    distribution function of the cosine and of the angle around."""
    found = []
    for name, of in phases_of(x).items():
        n = draw.cases
        d, u = unit_vectors(draw.rng, n), draw.rng.random((n, 2))
        drawn = {OURS: _our_directions(of, d, u)}
        if draw.mitsuba:
            drawn[MITSUBA] = _their_directions(of, d, np.minimum(u, 1.0 - 2.0**-24))
        part = {}
        for who, w in drawn.items():
            p_value = _fit(of, d, w)
            shown = {"phase": name, "g": 1.0 - 1.0 / x, "p-value": p_value}
            part[who] = one_case(not p_value >= chance.LEVEL, None, shown)
        found.append(part)
    return together(found)


def _fit(of: AnyPhase, d: FloatArray, w: FloatArray) -> float:
    """The p-value of directions w that light along d is turned to."""
    x = np.cross(d, np.where(np.abs(d[:, :1]) < 0.5, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(d, x)
    around = np.arctan2((w * y).sum(axis=1), (w * x).sum(axis=1)) / (2.0 * math.pi) + 0.5
    along = np.clip(_below(of, ((w - d) ** 2).sum(axis=1) / 2.0), 0.0, 1.0)
    if not np.isfinite(along).all():
        return 0.0
    counts, _, _ = np.histogram2d(along, around, CELLS, [(0.0, 1.0), (0.0, 1.0)])
    expected = len(w) / counts.size
    value = float(((counts - expected) ** 2).sum() / expected)
    return float(stats.chi2.sf(value, counts.size - 1))
