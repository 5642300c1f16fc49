"""Solvers of F8's polynomials: the renderer's and the textbook's.

Roots come as (n, 4) or (n, 2), real ones in order, inf for missing ones.
"""

from typing import Any

import numpy as np

from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.experiments.stability.harness.rays import Rays
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes.curved import quadratic, torus
from reference_rt.shapes.curved.torus import Tori
from reference_rt.textbook.method import ray_of


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
