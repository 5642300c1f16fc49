"""F8: roots of polynomials: the quartic of tori, the quadratics of quadrics.

Law.  As many real roots as there are, each off by at most 16 u (sum of the terms' sizes) /
|derivative| there, what rounding the coefficients and evaluating makes of it, beside 16 u (|t| |d|
+ D) of a ray's own t.  Undecidable, and left open, are cases with two roots, real or complex, less
than four such bounds apart: rounded coefficients may join or part them.

Range.  Lines 1 to 1e-16 sizes from a double root; from one where three or four roots come together
(along an asymptotic direction of a torus; along its top circle, in that plane); tori 1e0 to 1e12
sizes away; quadratics 1 to 1e-16 of b² from a double root; quadratics whose roots' ratio is 1e0 to
1e16.  Tubes from 0.05 to 0.95 of the ring's radius.

Counts.  1e5 in `double`, 3e4 in `several` and `far`, 1e5 a series of quadratics.

Passes.  No root missed, none too many, none off by more.  FLINT certifies all four complex roots
of quartics in exact integers; the discriminant of quadratics is exact.

Contestants.  Ours is what the renderer has: for tori Newton's steps and halving on the
distance between the quartic's turning points, for quadrics q / a and c / q of q = -(b ± sqrt(D)).
"numpy.roots" is the companion matrix, "ferrari" the closed form, "quadratic.formula" (-b ± sqrt(D))
/ 2 a.  They get the coefficients in floats, of a line that begins next to the torus, but in
`far`, where it begins at the ray's origin.  Mitsuba has no torus and no quartic.

`certified` has the truth, `solvers` the contestants."""

from functools import partial

import numpy as np

from comparisons.experiments.stability.harness.outcomes import OURS, FloatArray, Outcomes, U
from comparisons.experiments.stability.harness.rays import Rays
from comparisons.experiments.stability.harness.series import Draw, Family, Sweep, decades, series
from comparisons.experiments.stability.roots.certified import judge, of_quadratics, of_tori
from comparisons.experiments.stability.roots.solvers import (
    ferrari,
    formula,
    numpy_roots,
    quadric_kernel,
    torus_kernel,
)
from comparisons.geometry.affine import across, unit_vectors
from comparisons.geometry.exact.dyadic import Dyadic

FAMILY = Family(
    "F8",
    "roots of polynomials",
    "No root missed, none too many, each within 16 u (sum of the terms' sizes) / |derivative|.",
    "The textbook's closed forms and companion matrices are the anchors themselves; no renderer's"
    " tests were found that certify roots.",
)

CLOSE, CLOSE_QUICK = decades(0, 16), (1.0, 1e4, 1e8, 1e12, 1e16)

_series = partial(series, unit="of the bound by condition")

SLACK = 16.0
"""u (|t| |d| + D) that t |d| of a ray may be off by besides."""


def _tori(
    rng: np.random.Generator, minor: FloatArray, passed: FloatArray, d: FloatArray, far: FloatArray
) -> Rays:
    """Rays along unit d from `far` (n,) before points `passed` (n, 3), seen from the middles of
    tori about z of major radius 1, which are placed afterwards, so that this holds exactly."""
    n = len(minor)
    o = rng.uniform(-1.0, 1.0, (n, 3)) + passed - d * far[:, None]
    foot = Dyadic.of(o) + Dyadic.of(d) * Dyadic.of(far[:, None])
    unit = np.tile(np.eye(3).reshape(1, 9), (n, 1))
    none = np.zeros(n, np.int64)
    row = {
        "major": np.ones(n),
        "minor": minor,
        "center": foot.floats() - passed,
        "to_local": unit,
        "edges": unit,
        **dict.fromkeys(("owner", "material", "light", "face"), none),
    }
    return Rays("tori", row, 1.0 + minor, o, d)


def _on_tube(
    phi: FloatArray, around: FloatArray, minor: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(points, normals, unit vectors around the axis) of tori."""
    zero, one = np.zeros(len(phi)), np.ones(len(phi))
    out = np.column_stack([np.cos(phi), np.sin(phi), zero])
    n = out * np.cos(around)[:, None] + np.column_stack([zero, zero, np.sin(around)])
    along = np.column_stack([-out[:, 1], out[:, 0], zero])
    return out + n * minor[:, None], n, along * one[:, None]


def _coefficients(rays: Rays, begin: FloatArray) -> FloatArray:
    """The quartic's (n, 5), the highest power first, along the unit direction, as floats make it
    from the point o + begin d: (|p|² + R² - r²)² - 4 R² rho² (e.g. Cychosz & Waggenspack 1992)."""
    o, d = Dyadic.of(rays.o) + Dyadic.of(begin[:, None]) * Dyadic.of(rays.d), rays.d
    p = (o - Dyadic.of(rays.row["center"])).floats()
    d = d / rays.speed()[:, None]
    major, minor = rays.row["major"], rays.row["minor"]
    b = np.sum(p * d, axis=1)
    gamma = np.sum(p * p, axis=1) + major**2 - minor**2
    flat_p, flat_d = p[:, :2], d[:, :2]
    four = 4.0 * major**2
    return np.column_stack(
        [
            np.ones(len(b)),
            4.0 * b,
            2.0 * gamma + 4.0 * b * b - four * np.sum(flat_d * flat_d, axis=1),
            4.0 * b * gamma - 2.0 * four * np.sum(flat_p * flat_d, axis=1),
            gamma * gamma - four * np.sum(flat_p * flat_p, axis=1),
        ]
    )


def _compete(rays: Rays, from_afar: bool) -> Outcomes:
    speed = rays.speed()
    to_center = rays.row["center"] - rays.o
    begin = np.sum(to_center * rays.d, axis=1) / (speed * speed)
    truth = of_tori(rays, begin)
    reach = np.linalg.norm(to_center, axis=1)
    slack = SLACK * U * (np.abs(begin) * speed + reach)[:, None]
    polynomials = _coefficients(rays, 0.0 * begin if from_afar else begin)
    shift = (begin * speed if from_afar else 0.0 * begin)[:, None]

    parts = {name: rays.row[name] for name in ("center", "major", "minor")}
    named = {"o": rays.o, "d": rays.d, "begin": begin} | parts
    columns = {name: np.reshape(column, (len(begin), -1)) for name, column in named.items()}
    return {
        OURS: judge((torus_kernel(rays) - begin[:, None]) * speed[:, None], truth, slack, columns),
        "numpy.roots": judge(numpy_roots(polynomials) - shift, truth, slack, columns),
        "ferrari": judge(ferrari(polynomials) - shift, truth, slack, columns),
    }


def _tubes(draw: Draw) -> FloatArray:
    return np.asarray(draw.rng.uniform(0.05, 0.95, draw.cases))


def _gaps(draw: Draw, x: float) -> FloatArray:
    """1 to 10 times nearer than 1 / x, on either side."""
    n = draw.cases
    return np.asarray(draw.rng.choice([-1.0, 1.0], n) * 10.0 ** -draw.rng.uniform(0, 1, n) / x)


@_series(
    Sweep(
        "1 / distance of the line from a double root, in tubes' radii",
        *(CLOSE, CLOSE_QUICK, 300, 6000),
    )
)
def double(draw: Draw, x: float) -> Outcomes:
    """Lines that pass a torus' surface at 1 / x to 0.1 / x, along it. Wrong is a root too few or
    too many, or off by more than its condition allows."""
    rng, minor = draw.rng, _tubes(draw)
    phi, around = rng.uniform(0.0, 2.0 * np.pi, (2, draw.cases))
    q, normal, _ = _on_tube(phi, around, minor)
    passed = q + normal * (_gaps(draw, x) * minor)[:, None]
    far = rng.uniform(0.0, 4.0, draw.cases)
    return _compete(_tori(rng, minor, passed, across(rng, normal), far), False)


@_series(
    Sweep(
        "1 / distance of the line from a triple or quadruple root, in tubes' radii",
        *(CLOSE, CLOSE_QUICK, 200, 2000),
    )
)
def several(draw: Draw, x: float) -> Outcomes:
    """Lines near those along a torus' asymptotic directions, and along its top circle."""
    rng, n, minor = draw.rng, draw.cases, _tubes(draw)
    phi = rng.uniform(0.0, 2.0 * np.pi, n)
    on_top = rng.random(n) < 0.5
    inner = np.pi + rng.uniform(-0.45, 0.45, n) * np.pi
    around = np.where(on_top, 0.5 * np.pi, inner)
    q, normal, along = _on_tube(phi, around, minor)
    # Curvatures 1 / r around the tube and cos / (R + r cos) along it: where they cancel, three
    # roots come together; at the top, where the second is 0, four.
    flat = np.where(on_top, 0.0, np.cos(around) / (1.0 + minor * np.cos(around)))
    angle = np.arctan(np.sqrt(np.maximum(-flat * minor, 0.0)))
    up = np.cross(normal, along)
    d = along * np.cos(angle)[:, None] + up * np.sin(angle)[:, None]
    passed = q + unit_vectors(rng, n) * (np.abs(_gaps(draw, x)) * minor)[:, None]
    far = rng.uniform(0.0, 4.0, n)
    return _compete(_tori(rng, minor, passed, d, far), False)


@_series(Sweep("distance / size", decades(0, 12), (1.0, 1e4, 1e8, 1e12), 200, 2000))
def far(draw: Draw, x: float) -> Outcomes:
    """Lines through a torus from 2 to 10 times this far away; the textbook's coefficients are
    those seen from the origin."""
    rng, n, minor = draw.rng, draw.cases, _tubes(draw)
    phi, around = rng.uniform(0.0, 2.0 * np.pi, (2, n))
    q, _, _ = _on_tube(phi, around, minor * rng.uniform(0.0, 1.0, n))
    far = x * 10.0 ** rng.uniform(np.log10(2.0), 1.0, n)
    return _compete(_tori(rng, minor, q, unit_vectors(rng, n), far), True)


def _of_quadratics(coefficients: FloatArray) -> Outcomes:
    truth = of_quadratics(coefficients)
    columns = {"coefficients": coefficients}
    contestants = {
        OURS: quadric_kernel,
        "numpy.roots": numpy_roots,
        "quadratic.formula": formula,
    }
    return {
        name: judge(solve(coefficients), truth, 0.0, columns) for name, solve in contestants.items()
    }


@_series(Sweep("b² / |b² - 4 a c|", CLOSE, CLOSE_QUICK, 1000, 6000), "near_double")
def near_double(draw: Draw, x: float) -> Outcomes:
    """Quadratics with both roots, real or complex, about ±0.5 to ±2."""
    rng, n = draw.rng, draw.cases
    a, middle = rng.uniform(0.5, 1.0, (2, n)) * rng.choice([-1.0, 1.0], (2, n))
    b = -2.0 * a * middle
    return _of_quadratics(np.column_stack([a, b, 0.25 * b * b / a * (1.0 + _gaps(draw, x))]))


@_series(Sweep("ratio of the roots", CLOSE, CLOSE_QUICK, 1000, 6000))
def unlike(draw: Draw, x: float) -> Outcomes:
    """Quadratics with two real roots, one of them small: -b cancels sqrt(b² - 4 a c)."""
    rng, n = draw.rng, draw.cases
    a, one = rng.uniform(0.5, 1.0, (2, n)) * rng.choice([-1.0, 1.0], (2, n))
    other = one * rng.choice([-1.0, 1.0], n) / (x * rng.uniform(1.5, 10.0, n))
    return _of_quadratics(np.column_stack([a, -a * (one + other), a * one * other]))
