"""Chi-square tests of samples against their stated density, at any roughness.

The chart is that of half vectors: with t = 1 - 1 / sqrt(1 + s²), s the slope over alpha, and phi,
the lobes of all roughnesses look alike, and fixed cells hold them; visible normals of GGX, of
a density of s / (1 + s²)² at most, are bounded there up to t = 1.

A direction wi mirrored about h has dwi = 4 (wo·h) dh;  one refracted
dwi = (wo·h + eta wi·h)² / (eta² |wi·h|) dh, eta the index on wi's side over wo's (Walter et al.
2007, eq. 14 and 17).
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from comparisons.experiments.stability.harness.bsdfs import Bsdf
from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.geometry.exact.crossings import IntArray

CELLS = 16
"""Along t and along phi."""

RULES = (10, 7)
"""Nodes along either side of a cell; where the two differ, the finer is not to be relied on."""


Density = Callable[[FloatArray, FloatArray], FloatArray]


class Fit(NamedTuple):
    """p_value: of the samples, given the stated density;  integral: of the density over
    reflected and refracted directions;  doubt: by how much two rules differ in it."""

    p_value: float
    integral: float
    doubt: float


def _nodes(rule: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """t, phi (CELLS² rule²,) and weights (rule²,) of Gauss and Legendre's rule in each cell."""
    nodes, weights = np.polynomial.legendre.leggauss(rule)
    x, w = 0.5 * (nodes + 1.0), 0.5 * weights
    edge = np.arange(CELLS)
    along = (edge[:, None] + x) / CELLS
    n = len(x)
    t = np.broadcast_to(along[:, None, :, None], (CELLS, CELLS, n, n))
    phi = 2.0 * math.pi * np.broadcast_to(along[None, :, None, :], (CELLS, CELLS, n, n))
    area = 2.0 * math.pi / CELLS**2
    return t.reshape(-1), phi.reshape(-1), np.outer(w, w).reshape(-1) * area


def _normals(t: FloatArray, phi: FloatArray, alpha: float) -> tuple[FloatArray, FloatArray]:
    """h (n, 3) and dh / (dt dphi): dh = cos³ dslopes, dslopes = alpha² / (1 - t)³ dt dphi."""
    s = alpha * np.sqrt(t * (2.0 - t)) / (1.0 - t)
    z = 1.0 / np.sqrt(1.0 + s * s)
    h = np.stack([s * z * np.cos(phi), s * z * np.sin(phi), z], axis=1)
    return h, z**3 * alpha**2 / (1.0 - t) ** 3


def _directions(
    wo: FloatArray, h: FloatArray, eta: float, through: bool
) -> tuple[FloatArray, FloatArray]:
    """wi (n, 3) and dwi / dh; 0 where there is none.  wo above."""
    cos_o = h @ wo
    if not through:
        return 2.0 * cos_o[:, None] * h - wo, 4.0 * np.maximum(cos_o, 0.0)
    cos2_t = 1.0 - (1.0 - cos_o * cos_o) / eta**2
    cos_t = np.sqrt(np.maximum(cos2_t, 0.0))
    wi = h * (cos_o / eta - cos_t)[:, None] - wo / eta
    refracts = (cos_o > 0.0) & (cos2_t > 0.0)
    spread = (cos_o - eta * cos_t) ** 2 / (eta**2 * np.where(refracts, cos_t, 1.0))
    return wi, np.where(refracts, spread, 0.0)


def _cell_of(wo: FloatArray, wi: FloatArray, alpha: float, eta: float) -> IntArray:
    """The numbers of the cells of directions on one side."""
    h = wo + eta * wi
    h *= np.copysign(1.0, h[:, 2:])
    x, y = h[:, 0] / (alpha * h[:, 2]), h[:, 1] / (alpha * h[:, 2])
    s2 = x * x + y * y
    turn = np.arctan2(y, x) / (2.0 * math.pi) % 1.0
    row = np.minimum(((1.0 - 1.0 / np.sqrt(1.0 + s2)) * CELLS).astype(int), CELLS - 1)
    column = np.minimum((turn * CELLS).astype(int), CELLS - 1)
    return np.asarray(row * CELLS + column)


class _Chart(NamedTuple):
    """there (m,): which nodes of the cells have a direction on that side;  wo, wi (k, 3): that, and
    where the light comes from;  measure (k,): dwi / (dt dphi);  weights (rule²,): of a cell's."""

    there: npt.NDArray[np.bool_]
    wo: FloatArray
    wi: FloatArray
    measure: FloatArray
    weights: FloatArray


@lru_cache(maxsize=32)  # for materials and contestants in turn
def _chart(wo: tuple[float, ...], alpha: float, eta: float, through: bool, rule: int) -> _Chart:
    t, phi, weights = _nodes(rule)
    h, measure = _normals(t, phi, alpha)
    wi, spread = _directions(np.array(wo), h, eta, through)
    there = (spread > 0.0) & ((wi[:, 2] < 0.0) == through)
    wi = np.ascontiguousarray(wi[there])
    return _Chart(there, np.tile(wo, (len(wi), 1)), wi, (spread * measure)[there], weights)


def _cells(
    function: Density, wo: FloatArray, alpha: float, eta: float, through: bool, rule: int
) -> FloatArray:
    """The integral of a function of directions, of one side, in each cell: (CELLS²,)."""
    chart = _chart(tuple(wo.tolist()), alpha, eta, through, rule)
    values = np.zeros(len(chart.there))
    if len(chart.wi):
        values[chart.there] = function(chart.wo, chart.wi) * chart.measure
    return np.asarray(values.reshape(CELLS**2, -1) @ chart.weights)


def integral(bsdf: Bsdf, wo: FloatArray, alpha: float, eta: float) -> tuple[float, float]:
    """Share of a white sky that is scattered, in power and in the brightest channel, by f cos
    alone, and how far two rules differ."""
    total, doubt = 0.0, 0.0
    for through in (False, True) if eta != 1.0 else (False,):
        scale = eta * eta if through else 1.0

        def power(o: FloatArray, i: FloatArray, scale: float = scale) -> FloatArray:
            return np.asarray(bsdf.evaluate(o, i).max(axis=1) * scale)

        fine, coarse = (_cells(power, wo, alpha, eta, through, rule) for rule in RULES)
        total += float(fine.sum())
        doubt += float(np.abs(fine - coarse).sum())
    return total, doubt


def fit(bsdf: Bsdf, wo: FloatArray, alpha: float, eta: float, u: FloatArray) -> Fit:
    """Of samples for one direction wo (3,) above, with numbers u (n, 3)."""
    n = len(u)
    drawn = bsdf.sample(np.tile(wo, (n, 1)), u)
    # Mitsuba leaves the density of what it refuses; the weight is 0.
    kept = (drawn.pdf > 0.0) & (drawn.weight.max(axis=1) > 0.0) & ~drawn.is_delta
    fine, coarse, count = [], [], []
    for through in (False, True) if eta != 1.0 else (False,):
        fine.append(_cells(bsdf.pdf, wo, alpha, eta, through, RULES[0]))
        coarse.append(_cells(bsdf.pdf, wo, alpha, eta, through, RULES[1]))
        mine = kept & ((drawn.wi[:, 2] < 0.0) == through)
        index = _cell_of(wo, drawn.wi[mine], alpha, eta if through else 1.0)
        count.append(np.bincount(index, minlength=CELLS**2))
    expected, other = np.concatenate(fine), np.concatenate(coarse)
    if not np.isfinite(expected).all():
        return Fit(0.0, math.inf, math.inf)
    p_value = _p_value(n * expected, n * other, np.concatenate(count), n)
    return Fit(p_value, float(expected.sum()), float(np.abs(expected - other).sum()))


def _p_value(expected: FloatArray, other: FloatArray, observed: IntArray, n: int) -> float:
    """Pearson's test.  One cell holds the samples that failed and those of cells that expect fewer
    than 20, or that the rules differ in by a tenth of the noise: where the horizon or the critical
    angle cuts them."""
    large = (expected >= 20.0) & (np.abs(expected - other) <= 0.1 * np.sqrt(expected))
    if not large.any():
        return 1.0
    e = np.append(expected[large], n - expected[large].sum())
    o = np.append(observed[large], n - observed[large].sum())
    if e[-1] < 20.0:
        e, o = np.append(e[:-2], e[-2] + max(e[-1], 0.0)), np.append(o[:-2], o[-2] + o[-1])
    statistic = float(((o - e) ** 2 / e).sum())
    return float(stats.chi2.sf(statistic, len(e) - 1))
