"""Bounding volume hierarchy over any mix of shapes: surface area heuristic, conservative slabs."""

from typing import NamedTuple

import numpy as np

from reference_rt.kernel import entry_kernel, kernel, local_floats
from reference_rt.ray import UNIT_ROUNDOFF
from reference_rt.shapes.shape import FloatArray, IntArray

BINS = 16
LEAF_SIZE = 4
"""Most primitives of a leaf: more are always split, fewer where the heuristic says so."""
SAH_DEPTH = 40
"""Below this depth nodes are halved by count: no input makes a tree deeper than the stack."""
STACK_SIZE = 72
"""SAH_DEPTH + log2 of more primitives than memory holds (2^32)."""

FAR_SLACK = 1.0 + 2.0 * (3.0 * UNIT_ROUNDOFF) / (1.0 - 3.0 * UNIT_ROUNDOFF)
"""(plane - o) * (1/d) rounds three times: a far distance stretched by twice gamma_3 cannot make a
ray miss a box that it meets (Ize 2013, "Robust BVH Ray Traversal", JCGT 2(2))."""


class Bvh(NamedTuple):
    """boxes (n, 6): lower and upper corners;  first (n,): left child, its sibling follows, or the
    leaf's first reference;  size (n,): references of a leaf, 0 for an inner node;  kind, row
    (m,): the references, leaf after leaf.  Node 0 is the root."""

    boxes: FloatArray
    first: IntArray
    size: IntArray
    kind: IntArray
    row: IntArray


@kernel
def _grow(boxes: FloatArray, node: int, lower: FloatArray, upper: FloatArray, i: int) -> None:
    for k in range(3):
        boxes[node, k] = min(boxes[node, k], lower[i, k])
        boxes[node, 3 + k] = max(boxes[node, 3 + k], upper[i, k])


@kernel
def _merge(into: FloatArray, box: FloatArray) -> None:
    for k in range(3):
        into[k] = min(into[k], box[k])
        into[3 + k] = max(into[3 + k], box[3 + k])


@kernel
def _clear(box: FloatArray) -> None:
    for k in range(3):
        box[k] = np.inf
        box[3 + k] = -np.inf


@kernel
def half_area(box: FloatArray) -> float:
    """Half the surface area of a box (6,), 0 for an empty one."""
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    if x < 0.0:
        return 0.0
    return float(x * y + y * z + z * x)


@kernel
def _bin_of(center: float, start: float, scale: float) -> int:
    return min(BINS - 1, int((center - start) * scale))


@kernel
def _best_split(
    lower: FloatArray,
    upper: FloatArray,
    order: IntArray,
    begin: int,
    end: int,
    centers: FloatArray,
    bins: FloatArray,
    counts: IntArray,
    costs: FloatArray,
    side: FloatArray,
) -> tuple[float, int, int]:
    """(cost, axis, bin) of the cheapest of 3 x (BINS - 1) planes; axis -1 where none separates."""
    best, best_axis, best_bin = np.inf, -1, -1
    for axis in range(3):
        extent = centers[3 + axis] - centers[axis]
        scale = BINS / extent if extent > 0.0 else 0.0
        if not (scale > 0.0 and scale < np.inf):
            continue
        for b in range(BINS):
            counts[b] = 0
            _clear(bins[b])
        for k in range(begin, end):
            i = order[k]
            b = _bin_of(0.5 * lower[i, axis] + 0.5 * upper[i, axis], centers[axis], scale)
            counts[b] += 1
            _grow(bins, b, lower, upper, i)
        _clear(side)
        n = 0
        for b in range(BINS - 1, 0, -1):
            n += counts[b]
            _merge(side, bins[b])
            costs[b] = n * half_area(side)
        _clear(side)
        n = 0
        for b in range(BINS - 1):
            n += counts[b]
            _merge(side, bins[b])
            cost = n * half_area(side) + costs[b + 1]
            if n > 0 and n < end - begin and cost < best:
                best, best_axis, best_bin = cost, axis, b
    return best, best_axis, best_bin


@kernel
def _partition(
    lower: FloatArray,
    upper: FloatArray,
    order: IntArray,
    begin: int,
    end: int,
    centers: FloatArray,
    axis: int,
    split: int,
) -> int:
    """Reorder so that bins up to `split` come first; the index of the first of the others."""
    scale = BINS / (centers[3 + axis] - centers[axis])
    i, j = begin, end - 1
    while i <= j:
        p = order[i]
        center = 0.5 * lower[p, axis] + 0.5 * upper[p, axis]
        if _bin_of(center, centers[axis], scale) <= split:
            i += 1
        else:
            order[i] = order[j]
            order[j] = p
            j -= 1
    return i


@entry_kernel
def _build(
    lower: FloatArray,
    upper: FloatArray,
    order: IntArray,
    boxes: FloatArray,
    first: IntArray,
    size: IntArray,
    stack: IntArray,
    bins: FloatArray,
    counts: IntArray,
) -> int:
    """Fill nodes from the bounds of n primitives; returns how many.  `order` becomes leaf order."""
    costs, side, centers = local_floats(BINS), local_floats(6), local_floats(6)
    nodes, top = 1, 1
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, 0, order.shape[0], 0
    while top > 0:
        top -= 1
        node, begin, end, depth = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        _clear(boxes[node])
        _clear(centers)
        for k in range(begin, end):
            i = order[k]
            _grow(boxes, node, lower, upper, i)
            for a in range(3):
                center = 0.5 * lower[i, a] + 0.5 * upper[i, a]
                centers[a] = min(centers[a], center)
                centers[3 + a] = max(centers[3 + a], center)
        n = end - begin
        cost, axis, split = np.inf, -1, -1
        if n > 1 and depth < SAH_DEPTH:
            cost, axis, split = _best_split(
                lower, upper, order, begin, end, centers, bins, counts, costs, side
            )
        # One box test costs about what one primitive does.
        area = half_area(boxes[node])
        if n <= LEAF_SIZE and (axis < 0 or cost + area >= n * area):
            first[node], size[node] = begin, n
            continue
        middle = (begin + end) // 2
        if axis >= 0:
            middle = _partition(lower, upper, order, begin, end, centers, axis, split)
        first[node], size[node] = nodes, 0
        stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = nodes, begin, middle, depth + 1
        top += 1
        stack[top, 0], stack[top, 1] = nodes + 1, middle
        stack[top, 2], stack[top, 3] = end, depth + 1
        top += 1
        nodes += 2
    return nodes


def build(lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Boxes, first and size of the nodes (see `Bvh`), and the primitives' leaf order, from the
    bounds (n, 3), (n, 3) of n >= 1 primitives.  Binned surface area heuristic (Wald 2007)."""
    n = len(lower)
    order = np.arange(n)
    boxes = np.empty((2 * n, 6))
    first, size = np.empty(2 * n, np.int64), np.zeros(2 * n, np.int64)
    stack = np.empty((STACK_SIZE, 4), np.int64)
    bins, counts = np.empty((BINS, 6)), np.empty(BINS, np.int64)
    nodes = _build(lower, upper, order, boxes, first, size, stack, bins, counts)
    return boxes[:nodes].copy(), first[:nodes].copy(), size[:nodes].copy(), order
