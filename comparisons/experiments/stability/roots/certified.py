"""Certified roots, and the bound that their condition sets: what F8 judges roots by."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import flint
import numpy as np

from comparisons.experiments.stability.harness.outcomes import FloatArray, Outcome, U, outcome
from comparisons.experiments.stability.harness.rays import Rays
from comparisons.geometry.exact.dyadic import CERTAIN, BoolArray, Dyadic
from comparisons.shapes.torus import torus_quartic

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
