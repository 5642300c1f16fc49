"""Builds a light tree: top down, by the binned surface area orientation heuristic (Conty Estevez &
Kulla 2018, section 4.3)."""

import math

import numpy as np

from reference_rt.accel.bvh.bins import BINS, Split, bin_of, bins_per_unit, no_split
from reference_rt.accel.bvh.nodes import center
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.lights.selection.bounds import (
    COLUMNS,
    LightBounds,
    as_rows,
    cost,
    load,
    nothing,
    store,
    union,
)
from reference_rt.lights.selection.tree import SLACK, LightTree

MOST_DEPTH = 28
"""Nodes at this depth and below are halved by count: with 2^32 lights the leaves are then at depth
60 at most, so that trails fit into an integer and the jobs into their stack."""


def build(bounds: LightBounds, lights: IntArray, count: int) -> LightTree:
    """The tree over n lights with these bounds;  lights (n,): their numbers among the scene's
    `count` lights.  Raises ValueError."""
    n = len(lights)
    strength = bounds.lambertian + bounds.even
    if n == 0 or not np.all((strength > 0.0) & (strength < np.inf)):
        raise ValueError("a light tree over lights without power; expected ones that shine")
    rows = as_rows(bounds)
    rows[:, -2:] /= strength.max()  # sums of extremes would overflow
    if not np.isfinite(rows).all():
        raise ValueError("a light tree over lights that are not finite; expected finite ones")
    m = 2 * n - 1
    order, child, trail = np.arange(n), np.full(m, -1), np.zeros(m, np.int64)
    nodes, first = np.empty((m, COLUMNS)), np.full(m, -1)
    jobs, bins, costs = np.empty((64, 4), np.int64), np.empty((BINS, COLUMNS)), np.empty(BINS)
    _split_all(rows, order, jobs, bins, costs, nodes, child, trail, first)
    light = np.where(first >= 0, lights[order[first]], -1)
    leaf, trails = np.full(count, -1), np.zeros(count, np.int64)
    leaves = np.flatnonzero(first >= 0)
    leaf[light[leaves]], trails[light[leaves]] = leaves, trail[leaves]
    return _tabulate(nodes, child, light, leaf, trails)


def _tabulate(
    nodes: FloatArray, child: IntArray, light: IntArray, leaf: IntArray, trail: IntArray
) -> LightTree:
    lower, upper = nodes[:, :3], nodes[:, 3:6]
    middle = 0.5 * lower + 0.5 * upper
    radius = np.linalg.norm(0.5 * upper - 0.5 * lower, axis=1) * (1.0 + SLACK)
    # The middle rounds, and so may a box's corners: four roundings of coordinates each.
    radius += 4.0 * math.sqrt(3.0) * UNIT_ROUNDOFF * np.abs(nodes[:, :6]).max(axis=1)
    spread = np.minimum(nodes[:, 9] + SLACK, math.pi)
    angles = np.column_stack([np.cos(spread), np.sin(spread), np.cos(nodes[:, 10])])
    packed = np.concatenate([middle, radius[:, None], nodes[:, 6:9], angles, nodes[:, 11:]], axis=1)
    return LightTree(packed, child, light, leaf, trail)


@entry_kernel
def _split_all(
    rows: FloatArray,
    order: IntArray,
    jobs: IntArray,
    bins: FloatArray,
    costs: FloatArray,
    nodes: FloatArray,
    child: IntArray,
    trail: IntArray,
    first: IntArray,
) -> None:
    """Fills the nodes, in the order of `LightTree`: their bounds, children and trails, and for a
    leaf its index in `order`."""
    count, top = 1, _push(jobs, 0, 0, 0, len(order), 0)
    while top > 0:
        top -= 1
        node, begin, end, depth = jobs[top, 0], jobs[top, 1], jobs[top, 2], jobs[top, 3]
        if end - begin == 1:
            first[node] = begin
            continue
        middle = (begin + end) // 2
        if depth < MOST_DEPTH:
            middle = _cut(rows, order, begin, end, bins, costs)
        child[node] = count
        trail[count], trail[count + 1] = trail[node], trail[node] | (1 << depth)
        top = _push(jobs, top, count + 1, middle, end, depth + 1)
        top = _push(jobs, top, count, begin, middle, depth + 1)
        count += 2
    for i in range(count - 1, -1, -1):  # children come after their parents
        if first[i] >= 0:
            store(nodes, i, load(rows, order[first[i]]))
        else:
            store(nodes, i, union(load(nodes, child[i]), load(nodes, child[i] + 1)))


@kernel
def _push(jobs: IntArray, top: int, node: int, begin: int, end: int, depth: int) -> int:
    """Pushes a job; returns the new height of the stack."""
    job = jobs[top]
    job[0], job[1], job[2], job[3] = node, begin, end, depth
    return top + 1


@kernel
def _cut(
    rows: FloatArray, order: IntArray, begin: int, end: int, bins: FloatArray, costs: FloatArray
) -> int:
    """Partitions order[begin:end] and returns where the second part begins."""
    best, best_low, best_scale = no_split(), 0.0, 0.0
    for axis in range(3):
        low, high = math.inf, -math.inf
        for k in range(begin, end):
            c = center(rows[order[k]], axis)
            low, high = min(low, c), max(high, c)
        scale = bins_per_unit(low, high)
        if scale > 0.0:
            split = _best_of_axis(rows, order, begin, end, axis, low, scale, bins, costs)
            if split.cost < best.cost:
                best, best_low, best_scale = split, low, scale
    if best.axis < 0:
        return (begin + end) // 2
    i, j = begin, end - 1
    while i <= j:
        if bin_of(center(rows[order[i]], best.axis), best_low, best_scale) <= best.bin:
            i += 1
        else:
            order[i], order[j] = order[j], order[i]
            j -= 1
    return i if begin < i < end else (begin + end) // 2


@kernel
def _best_of_axis(
    rows: FloatArray,
    order: IntArray,
    begin: int,
    end: int,
    axis: int,
    low: float,
    scale: float,
    bins: FloatArray,
    costs: FloatArray,
) -> Split:
    """The cheapest plane between bins."""
    for b in range(BINS):
        store(bins, b, nothing())
    for k in range(begin, end):
        b = bin_of(center(rows[order[k]], axis), low, scale)
        store(bins, b, union(load(bins, b), load(rows, order[k])))
    beyond = nothing()
    for b in range(BINS - 1, 0, -1):
        beyond = union(load(bins, b), beyond)
        costs[b] = cost(beyond)
    best, before = no_split(), nothing()
    for b in range(BINS - 1):
        before = union(before, load(bins, b))
        if before.spread >= 0.0:
            total = cost(before) + costs[b + 1]
            if total < best.cost:
                best = Split(total, axis, b)
    return best
