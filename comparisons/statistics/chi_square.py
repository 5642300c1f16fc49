"""Samples against the density they are said to have: Pearson's chi-square test over cells that
follow the density, whose probabilities are integrals by adaptive quadrature.

    fit = chi_square(density, directions)     # a p-value, and what the density integrates to
    assert min(p_values) > sidak(len(p_values))
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import special

from reference_rt.core.arrays import FloatArray, IntArray

Density = Callable[[FloatArray], FloatArray]
"""(n, k) points, for directions k = 3, to (n,) densities per unit of the chart's area."""

FAMILY = 1e-6
"""The probability that a test of many cases fails although all is well."""


class Chart(NamedTuple):
    """A rectangle that is mapped to what samples are points of, area to area (for directions solid
    angle).

    low, high: its corners;  points: (n, 2) coordinates to (n, k) points;  coordinates: back.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    points: Callable[[FloatArray], FloatArray]
    coordinates: Callable[[FloatArray], FloatArray]


def _directions(z_phi: FloatArray) -> FloatArray:
    z, phi = z_phi.T
    r = np.sqrt((1.0 - z) * (1.0 + z))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)


def _z_phi(v: FloatArray) -> FloatArray:
    return np.stack([v[:, 2], np.arctan2(v[:, 1], v[:, 0]) % (2.0 * math.pi)], axis=1)


SPHERE = Chart((-1.0, 0.0), (1.0, 2.0 * math.pi), _directions, _z_phi)
"""All directions, by (cos theta, phi): area is solid angle (Archimedes)."""

UNIT_SQUARE = Chart((0.0, 0.0), (1.0, 1.0), lambda x: x, lambda x: x)


class Fit(NamedTuple):
    """p_value: the probability of a worse fit than this, if the density is that of the samples;
    integral: of the density;  cells: how many were compared;  outside: samples of density 0, one of
    which makes p_value 0."""

    p_value: float
    integral: float
    cells: int
    outside: int


def chi_square(
    density: Density,
    samples: FloatArray,
    chart: Chart = SPHERE,
    cells: int = 128,
    tolerance: float = 1e-7,
    points: int = 8,
) -> Fit:
    """Whether samples (n, k) have this density.  Rows of NaN are samples that failed: where there
    are some the density integrates to less than 1.

    The first tenth of the samples only tells where to look closely, with the density itself; the
    others are counted in cells of about 1/`cells` of the probability each.  Boxes of the quadrature
    are right to about `tolerance`; what it can overlook is where so little of the density is that
    no sample fell on it, the share of a few samples, which chi-square cannot see either.

    points: of the quadrature, along either side of a box.
    Raises ArithmeticError for a density that does not settle, or is not finite.
    """
    pilots, n = len(samples) // 10, len(samples)
    is_kept = np.asarray(np.isfinite(samples).all(axis=1))
    kept = samples[is_kept]
    outside = int(np.count_nonzero(_finite(density, kept) <= 0.0))
    rule = gauss_legendre(points)
    probability, count = _cells(
        density, chart, 1.0 / cells, tolerance, kept, int(is_kept[:pilots].sum()), rule
    )
    integral = float(probability.sum())
    # What is missing to 1 belongs to the failed.
    expected = (n - pilots) * np.append(probability, 1.0 - integral)
    observed = np.append(count, n - pilots - count.sum())
    expected, observed = _pooled(expected, observed)
    statistic = float(((observed - expected) ** 2 / expected).sum())
    p_value = float(special.chdtrc(len(expected) - 1, statistic)) if outside == 0 else 0.0
    return Fit(p_value, integral, len(expected), outside)


def integrate(
    function: Density, hints: FloatArray, chart: Chart = SPHERE, tolerance: float = 1e-7
) -> float:
    """The integral of a function that is at least 0, by the same quadrature: right to a few times
    `tolerance` where it is smooth, and the share of a few hints where it is not.  hints (n, k):
    points that are dense where it is peaked.  Raises ArithmeticError, as `chi_square`."""
    rule = gauss_legendre(8)
    return float(_cells(function, chart, math.inf, tolerance, hints, 0, rule)[0].sum())


def sidak(cases: int, family: float = FAMILY) -> float:
    """The p-value below which the least of `cases` independent ones fails (Šidák 1967)."""
    return -math.expm1(math.log1p(-family) / cases)


def _pooled(expected: FloatArray, observed: IntArray) -> tuple[FloatArray, IntArray]:
    """Cells that expect fewer than 5 samples as one; with the next one where that is too few."""
    order = np.argsort(expected)
    expected, observed = np.maximum(expected[order], 0.0), observed[order]
    first = max(1, int(np.searchsorted(np.cumsum(expected), 5.0)) + 1)
    first = max(first, int(np.searchsorted(expected, 5.0)))
    return (
        np.concatenate([[expected[:first].sum()], expected[first:]]),
        np.concatenate([[observed[:first].sum()], observed[first:]]),
    )


class Rule(NamedTuple):
    """A quadrature of the unit square: nodes (n, 2) and weights (n,)."""

    nodes: FloatArray
    weights: FloatArray


def gauss_legendre(points: int) -> Rule:
    """points x points nodes: exact for polynomials of degrees up to 2 points - 1."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    grid = np.stack(np.meshgrid(0.5 + 0.5 * nodes, 0.5 + 0.5 * nodes, indexing="ij"), axis=-1)
    return Rule(grid.reshape(-1, 2), 0.25 * np.outer(weights, weights).reshape(-1))


_SLENDER = 8.0

_MOST_BOXES = 1 << 14
"""Boxes at once, some 0.5 GB: smooth densities take 300, and those with an edge 1,300 (measured).
One that is another each time it is asked halves all boxes for ever."""

_START = (8, 16)
"""Rectangles to begin with: an even number, so that the equator is an edge."""


def _finite(density: Density, points: FloatArray) -> FloatArray:
    """The density.  Raises ArithmeticError where it is not finite."""
    values = density(points)
    wrong = ~np.isfinite(values)
    if wrong.any():
        first, at = values[wrong][0], points[wrong][0].round(4).tolist()
        raise ArithmeticError(f"the density is {first} at {at}; expected finite numbers")
    return values


def _quadrature(
    density: Density, chart: Chart, boxes: FloatArray, rule: Rule
) -> tuple[FloatArray, FloatArray]:
    """Over boxes (n, 2, 2): corner, size.  The integrals, and the greatest values met."""
    at = boxes[:, None, 0] + rule.nodes * boxes[:, None, 1]
    values = _finite(density, chart.points(at.reshape(-1, 2))).reshape(len(boxes), -1)
    return boxes[:, 1].prod(axis=1) * (values @ rule.weights), values.max(axis=1)


def _half(boxes: FloatArray, axis: IntArray, side: int) -> FloatArray:
    half = boxes.copy()
    rows = np.arange(len(boxes))
    half[rows, 1, axis] *= 0.5
    half[rows, 0, axis] += side * half[rows, 1, axis]
    return half


def _sides(chart: Chart, boxes: FloatArray) -> FloatArray:
    """(2, n): how far the mid-points of opposite edges are apart, along either coordinate."""
    mid = boxes[:, 0] + 0.5 * boxes[:, 1]
    lengths = []
    for axis in (0, 1):
        a, b = mid.copy(), mid.copy()
        a[:, axis] = boxes[:, 0, axis]
        b[:, axis] += 0.5 * boxes[:, 1, axis]
        lengths.append(np.linalg.norm(chart.points(a) - chart.points(b), axis=1))
    return np.array(lengths)


def _start(chart: Chart) -> FloatArray:
    """The boxes to begin with."""
    low, high = np.array(chart.low), np.array(chart.high)
    size = (high - low) / _START
    steps = np.stack(np.meshgrid(*map(np.arange, _START), indexing="ij"), axis=-1).reshape(-1, 2)
    return np.stack(np.broadcast_arrays(low + steps * size, size), axis=1)


def _cells(
    density: Density, chart: Chart, share: float, tolerance: float, samples: FloatArray,
    pilots: int, rule: Rule,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Cells with at most about `share` of the density and of the pilots, the first of the samples,
    each: their integrals, and how many of the other samples are in each.

    Boxes are halved, across the side along which halving changes the integral more, until they are
    small enough to be cells; then, within their cell, until halving changes less than the
    tolerance, and no sample tells of a peak between the points of the quadrature.  Slender ones
    are halved across: of a peak each sliver would hold too little for a sample to tell.
    """
    boxes = _start(chart)
    cell = np.full(len(boxes), -1)  # of each box
    where = chart.coordinates(samples)
    steps = (where - chart.low) / boxes[0, 1]
    start = np.clip(steps.astype(int), 0, np.array(_START) - 1)
    box = start[:, 0] * _START[1] + start[:, 1]  # of each sample, -1 in boxes that are done
    height = _finite(density, samples)
    is_pilot = np.arange(len(samples)) < pilots
    sums, counts = np.zeros(0), np.zeros(0, int)
    for _ in range(100):
        if len(boxes) == 0:
            return sums, counts
        if len(boxes) > _MOST_BOXES:
            break
        # The box itself, and its halves across either axis, in one call of the density.
        axes = (np.full(len(boxes), axis) for axis in (0, 0, 1, 1))
        parts = [_half(boxes, axis, k % 2) for k, axis in enumerate(axes)]
        values, tops = _quadrature(density, chart, np.concatenate([boxes, *parts]), rule)
        whole, halved = values[: len(boxes)], values[len(boxes) :].reshape(2, 2, -1)
        highest = tops[len(boxes) :].reshape(2, 2, -1)
        change = np.abs(halved.sum(axis=1) - whole)
        sides = _sides(chart, boxes)
        is_compact = sides.max(axis=0) <= _SLENDER * sides.min(axis=0)
        by_change = is_compact & (change.max(axis=0) > tolerance)
        axis = np.where(by_change, change.argmax(axis=0), sides.argmax(axis=0))
        value = np.where(axis == 0, *halved.sum(axis=1))

        active = np.flatnonzero(box >= 0)
        own, n = box[active], len(boxes)
        seen = np.bincount(own[is_pilot[active]], minlength=n) / max(1, pilots)
        is_new = (cell < 0) & (np.maximum(value, seen) <= share)
        cell[is_new] = len(sums) + np.arange(np.count_nonzero(is_new))
        sums = np.append(sums, np.zeros(np.count_nonzero(is_new)))
        others = np.bincount(own[~is_pilot[active]], minlength=n)
        counts = np.append(counts, others[is_new])

        peak = np.zeros(n)
        np.maximum.at(peak, own, height[active])
        area = boxes[:, 1].prod(axis=1)
        is_missed = (peak > 2.0 * highest.max(axis=(0, 1))) & (peak * area > tolerance)
        is_done = (cell >= 0) & (change.max(axis=0) <= tolerance) & ~is_missed
        np.add.at(sums, cell[is_done], value[is_done])

        rest = ~is_done
        number = np.where(rest, np.cumsum(rest) - 1, -1)
        boxes, axis, cell = boxes[rest], axis[rest], np.tile(cell[rest], 2)
        box[active] = number[own]
        active = active[number[own] >= 0]
        own = box[active]
        upper = _half(boxes, axis, 1)
        is_upper = where[active, axis[own]] >= upper[own, 0, axis[own]]
        box[active] += len(boxes) * is_upper
        boxes = np.concatenate([_half(boxes, axis, 0), upper])
    raise ArithmeticError("the density does not settle: is it bounded, and the same each time?")
