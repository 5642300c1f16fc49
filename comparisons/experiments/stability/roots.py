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
`far`, where it begins at the ray's origin.  Mitsuba has no torus and no quartic."""

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import flint
import numpy as np

from comparisons.experiments.stability.harness.core import (
    OURS,
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
    Sweep,
    U,
    decades,
    outcome,
)
from comparisons.experiments.stability.harness.steps import Rays
from comparisons.geometry.affine import across, unit_vectors
from comparisons.geometry.exact.dyadic import CERTAIN, BoolArray, Dyadic
from comparisons.shapes.torus import torus_quartic
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes.curved import quadratic, torus
from reference_rt.shapes.curved.torus import Tori
from reference_rt.textbook.method import ray_of

# ---- certified roots, and the bound that their condition sets: what F8 judges roots by -----------


ROUNDINGS = 16.0
"""u times the sum of the terms' sizes, by which rounding may move a polynomial at a point: its
coefficients are made by some ten operations each, and it is evaluated by four more."""

APART = 0.25
"""Of the distance to the next root, real or not: where the bound is more, they may be one."""


class Certified(NamedTuple):
    """Roots of n polynomials of degree k.

    z (n, k): complex, real ones exactly so;  bound (n, k): how far rounding may move each,
    ROUNDINGS u (sum of terms) / |derivative|;  open (n,): somewhere it is more than APART of the
    distance to the next.
    """

    z: Any
    bound: FloatArray
    open: BoolArray

    def real(self) -> tuple[FloatArray, FloatArray]:
        """Real roots in order, inf for missing ones, and their bounds (n, k)."""
        s = np.where(self.z.imag == 0.0, self.z.real, np.inf)
        order = np.argsort(s, axis=1)
        return np.take_along_axis(s, order, 1), np.take_along_axis(self.bound, order, 1)


def certified(z: Any, terms: FloatArray, derivative: FloatArray) -> Certified:
    """`terms`, `derivative` (n, k): their sizes at the roots."""
    with np.errstate(all="ignore"):
        bound = ROUNDINGS * U * terms / derivative
    apart = np.abs(z[:, :, None] - z[:, None, :])
    apart[:, np.arange(z.shape[1]), np.arange(z.shape[1])] = np.inf
    return Certified(z, bound, ~np.all(bound <= APART * apart.min(axis=2), axis=1))


def of_tori(rays: Rays, begin: FloatArray) -> Certified:
    """In lengths from o + begin d, a point near the torus: F = (|p|² + R² - r²)² - 4 R² rho² along
    the line.  Its terms are at most (|p|² + R² + r²)² + 4 R² |p|²."""
    o, d = Dyadic.of(rays.o) + Dyadic.of(begin[:, None]) * Dyadic.of(rays.d), Dyadic.of(rays.d)
    speed = rays.speed()
    z = np.array([_roots(row) for row in torus_quartic(rays.row, o, d).tolist()])
    z = z * speed[:, None]
    near = o.floats() - rays.row["center"]
    unit = rays.d / speed[:, None]
    at = near[:, None, :] + z[:, :, None] * unit[:, None, :]
    p2 = np.sum(np.abs(at) ** 2, axis=2)
    major, minor = (rays.row[name][:, None] for name in ("major", "minor"))
    terms = (p2 + major**2 + minor**2) ** 2 + 4.0 * major**2 * p2
    others = z[:, :, None] - z[:, None, :] + np.eye(4)
    return certified(z, terms, np.abs(np.prod(others, axis=2)))


def _roots(coefficients: list[int]) -> list[complex]:
    """All four, certified by FLINT, the constant term first."""
    precision = flint.ctx.prec
    flint.ctx.prec = CERTAIN + 32
    try:
        found = flint.fmpz_poly(coefficients).complex_roots()
        return [complex(z.real.mid(), z.imag.mid()) for z, times in found for _ in range(times)]
    finally:
        flint.ctx.prec = precision


def of_quadratics(coefficients: FloatArray) -> Certified:
    """Of a x² + b x + c (n, 3), a not 0: from the discriminant in exact integers."""
    a, b, c = (Dyadic.of(coefficients[:, k]) for k in range(3))
    exact = b * b - Dyadic.of(4.0) * a * c
    root = np.sqrt(exact.floats().astype(np.complex128))
    a_float, b_float, c_float = coefficients.T
    q = -0.5 * (b_float + np.where(b_float >= 0.0, root, -root))
    z = np.column_stack([q / a_float, c_float / q])
    size = np.abs(z)
    absolute = np.abs(coefficients)
    terms = (absolute[:, :1] * size + absolute[:, 1:2]) * size + absolute[:, 2:]
    return certified(z, terms, np.abs(root)[:, None])


def judge(
    found: FloatArray,
    truth: Certified,
    slack: FloatArray | float,
    columns: Mapping[str, Any],
) -> Outcome:
    """Roots `found` (n, k) as `Certified.real` has them; `slack` (n, 1): besides the bound.

    Wrong are a root too few or too many, and one off by more.  columns: of the examples.
    """
    real, bound = truth.real()
    found = np.sort(np.where(np.isnan(found), np.inf, found), axis=1)
    both = np.isfinite(real) & np.isfinite(found)
    share = np.zeros(real.shape)
    off = np.abs(np.where(both, found, 0.0) - np.where(both, real, 0.0))
    share[both] = (off / (bound + slack))[both]
    as_many = np.all(np.isfinite(real) == np.isfinite(found), axis=1)
    counted = both & (as_many & ~truth.open)[:, None]
    worst = float(share[counted].max()) if counted.any() else None
    shown = {**columns, "expected": real, "found": found}
    return outcome(~as_many | np.any(share > 1.0, axis=1), shown, truth.open, worst)


# ---- solvers of F8's polynomials: the renderer's and the textbook's ------------------------------
#
# Roots come as (n, 4) or (n, 2), real ones in order, inf for missing ones.


def numpy_roots(coefficients: FloatArray) -> FloatArray:
    """The companion matrix's eigenvalues, of polynomials (n, k) whose highest power comes first.

    LAPACK gives conjugate pairs, and real ones with an imaginary part of exactly 0.
    """
    degree = coefficients.shape[1] - 1
    found = np.full((len(coefficients), degree), np.inf)
    for i, polynomial in enumerate(coefficients):
        z = np.roots(polynomial)
        real = np.sort(z.real[z.imag == 0.0])
        found[i, : len(real)] = real
    return found


def ferrari(coefficients: FloatArray) -> FloatArray:
    """Quartics (n, 5), the highest power first, in closed form (Ferrari 1545).

    Without the cubic term, y⁴ + p y² + q y + r = (y² + w y + v) (y² - w y + u), where w² is the
    largest root of a cubic, by Cardano or, where it has three, by cosines.
    """
    b, c, d, e = (coefficients[:, k] / coefficients[:, 0] for k in range(1, 5))
    p = c - 3.0 * b * b / 8.0
    q = d - b * c / 2.0 + b * b * b / 8.0
    r = e - b * d / 4.0 + b * b * c / 16.0 - 3.0 * b * b * b * b / 256.0
    with np.errstate(all="ignore"):
        # Without q it is a quadratic in y², and there is nothing to split by.
        w2 = np.where(q == 0.0, 0.0, _largest_root(2.0 * p, p * p - 4.0 * r, -q * q))
        w = np.sqrt(np.maximum(w2, 0.0))
        odd = np.where(w > 0.0, q / w, np.sqrt(p * p - 4.0 * r))
        one = np.ones(len(w))
        halves = (w, 0.5 * (p + w2 - odd)), (-w, 0.5 * (p + w2 + odd))
        y = np.concatenate([formula(np.column_stack([one, *half])) for half in halves], axis=1)
        return np.sort(np.where(np.isfinite(y), y - b[:, None] / 4.0, np.inf), axis=1)


def _largest_root(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Of z³ + a z² + b z + c."""
    big_q = (a * a - 3.0 * b) / 9.0
    big_r = (2.0 * a * a * a - 9.0 * a * b + 27.0 * c) / 54.0
    q3 = big_q * big_q * big_q
    angle = np.arccos(np.clip(big_r / np.sqrt(q3), -1.0, 1.0))
    by_cosine = -2.0 * np.sqrt(big_q) * np.cos((angle + 2.0 * np.pi) / 3.0)
    one = -np.sign(big_r) * np.cbrt(np.abs(big_r) + np.sqrt(np.maximum(big_r**2 - q3, 0.0)))
    by_root = one + np.where(one != 0.0, big_q / one, 0.0)
    return np.asarray(np.where(big_r**2 < q3, by_cosine, by_root) - a / 3.0)


def formula(coefficients: FloatArray) -> FloatArray:
    """(-b ± sqrt(b² - 4 a c)) / 2 a of quadratics (n, 3)."""
    a, b, c = coefficients.T
    with np.errstate(all="ignore"):
        discriminant = b * b - 4.0 * a * c
        root = np.where(discriminant >= 0.0, np.sqrt(np.maximum(discriminant, 0.0)), np.inf)
        found = np.column_stack([(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)])
    return np.sort(np.where(np.isfinite(found), found, np.inf), axis=1)


def torus_kernel(rays: Rays) -> FloatArray:
    """All t at which the renderer sees each line meet its torus."""
    out = np.empty((len(rays.o), 4))
    table = Tori(**{name: np.ascontiguousarray(column) for name, column in rays.row.items()})
    with np.errstate(all="ignore"):
        _spans(table, rays.o, rays.d, out)
    return out


@entry_kernel
def _spans(tori: Any, o: FloatArray, d: FloatArray, out: FloatArray) -> None:
    for i in range(len(o)):
        s = torus.spans(tori, i, ray_of(o, d, i))
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = s.t0, s.t1, s.t2, s.t3


def quadric_kernel(coefficients: FloatArray) -> FloatArray:
    """Roots of quadratics (n, 3) as the renderer finds those of a quadric along a line: a x² + b x
    + c along the x axis."""
    forms = np.zeros((len(coefficients), 10))
    forms[:, [0, 6, 9]] = coefficients
    out = np.empty((len(forms), 2))
    with np.errstate(all="ignore"):
        _our_roots(forms, out)
    return np.sort(np.where(np.isfinite(out), out, np.inf), axis=1)


@entry_kernel
def _our_roots(forms: FloatArray, out: FloatArray) -> None:
    ray = Ray(Vec3(0.0, 0.0, 0.0), Vec3(1.0, 0.0, 0.0), np.inf)
    for i in range(len(forms)):
        found = quadratic.roots(forms[i], ray)
        out[i, 0], out[i, 1] = found.t0, found.t1


# ---- the series ----------------------------------------------------------------------------------


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


def _compete(rays: Rays, from_afar: bool) -> Mapping[str, Outcome]:
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


def _double(draw: Draw, x: float) -> Mapping[str, Outcome]:
    rng, minor = draw.rng, _tubes(draw)
    phi, around = rng.uniform(0.0, 2.0 * np.pi, (2, draw.cases))
    q, normal, _ = _on_tube(phi, around, minor)
    passed = q + normal * (_gaps(draw, x) * minor)[:, None]
    far = rng.uniform(0.0, 4.0, draw.cases)
    return _compete(_tori(rng, minor, passed, across(rng, normal), far), False)


def _several(draw: Draw, x: float) -> Mapping[str, Outcome]:
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


def _far(draw: Draw, x: float) -> Mapping[str, Outcome]:
    rng, n, minor = draw.rng, draw.cases, _tubes(draw)
    phi, around = rng.uniform(0.0, 2.0 * np.pi, (2, n))
    q, _, _ = _on_tube(phi, around, minor * rng.uniform(0.0, 1.0, n))
    far = x * 10.0 ** rng.uniform(np.log10(2.0), 1.0, n)
    return _compete(_tori(rng, minor, q, unit_vectors(rng, n), far), True)


def _of_quadratics(coefficients: FloatArray) -> Mapping[str, Outcome]:
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


def _near_double(draw: Draw, x: float) -> Mapping[str, Outcome]:
    rng, n = draw.rng, draw.cases
    a, middle = rng.uniform(0.5, 1.0, (2, n)) * rng.choice([-1.0, 1.0], (2, n))
    b = -2.0 * a * middle
    return _of_quadratics(np.column_stack([a, b, 0.25 * b * b / a * (1.0 + _gaps(draw, x))]))


def _unlike(draw: Draw, x: float) -> Mapping[str, Outcome]:
    rng, n = draw.rng, draw.cases
    a, one = rng.uniform(0.5, 1.0, (2, n)) * rng.choice([-1.0, 1.0], (2, n))
    other = one * rng.choice([-1.0, 1.0], n) / (x * rng.uniform(1.5, 10.0, n))
    return _of_quadratics(np.column_stack([a, -a * (one + other), a * one * other]))


CLOSE, CLOSE_QUICK = decades(0, 16), (1.0, 1e4, 1e8, 1e12, 1e16)

_series = partial(Series, unit="of the bound by condition")

FAMILY = Family(
    "F8",
    "roots of polynomials",
    "No root missed, none too many, each within 16 u (sum of the terms' sizes) / |derivative|.",
    (
        _series(
            "double",
            Sweep(
                "1 / distance of the line from a double root, in tubes' radii",
                CLOSE,
                CLOSE_QUICK,
                300,
                6000,
            ),
            "Lines that pass a torus' surface at 1 / x to 0.1 / x, along it. Wrong is a root too"
            " few or too many, or off by more than its condition allows.",
            _double,
        ),
        _series(
            "several",
            Sweep(
                "1 / distance of the line from a triple or quadruple root, in tubes' radii",
                CLOSE,
                CLOSE_QUICK,
                200,
                2000,
            ),
            "Lines near those along a torus' asymptotic directions, and along its top circle.",
            _several,
        ),
        _series(
            "far",
            Sweep("distance / size", decades(0, 12), (1.0, 1e4, 1e8, 1e12), 200, 2000),
            "Lines through a torus from 2 to 10 times this far away; the textbook's coefficients"
            " are those seen from the origin.",
            _far,
        ),
        _series(
            "near_double",
            Sweep("b² / |b² - 4 a c|", CLOSE, CLOSE_QUICK, 1000, 6000),
            "Quadratics with both roots, real or complex, about ±0.5 to ±2.",
            _near_double,
        ),
        _series(
            "unlike",
            Sweep("ratio of the roots", CLOSE, CLOSE_QUICK, 1000, 6000),
            "Quadratics with two real roots, one of them small: -b cancels sqrt(b² - 4 a c).",
            _unlike,
        ),
    ),
    anchors="The textbook's closed forms and companion matrices are the anchors themselves; no"
    " renderer's tests were found that certify roots.",
)
