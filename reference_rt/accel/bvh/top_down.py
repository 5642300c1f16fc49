"""The two top-down builders: median splits and the SAH.

`build_median` halves nodes at the median of the sorted centres, along the centres' longest axis.
The SAH builder splits each node at the cheapest of many planes (Wald 2007, "On fast construction of
SAH-based bounding volume hierarchies", RT'07), with or without spatial splits.
"""

import numpy as np

from reference_rt.accel.bvh import spatial
from reference_rt.accel.bvh.bins import (
    Bins,
    Split,
    bin_of,
    bins_per_unit,
    new_bins,
    no_split,
    object_split,
)
from reference_rt.accel.bvh.nodes import (
    LEAF_SIZE,
    SAH_DEPTH,
    STACK_SIZE,
    Nodes,
    center,
    clear,
    fit,
    half_area,
    merge,
    new_nodes,
    push,
    swap,
    trimmed,
)
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import entry_kernel, kernel, local_floats


@entry_kernel
def _halve_all(
    centers: FloatArray,
    ordered: IntArray,
    goes_left: IntArray,
    waiting: IntArray,
    jobs: IntArray,
    nodes: Nodes,
) -> int:
    """Fills `first` and `size` of the nodes; returns their number.  Row a of `ordered` (3, n) holds
    the primitives sorted by their centres along axis a, and stays sorted within each node: its ends
    give the extent of the node's centres, its middle is their median, nothing is sorted again."""
    count, top = 1, push(jobs, 0, 0, 0, len(centers))
    while top > 0:
        top -= 1
        node, begin, end = jobs[top, 0], jobs[top, 1], jobs[top, 2]
        if end - begin <= LEAF_SIZE:
            nodes.first[node], nodes.size[node] = begin, end - begin
            continue
        axis, longest = 0, -1.0
        for a in range(3):
            extent = centers[ordered[a, end - 1], a] - centers[ordered[a, begin], a]
            if extent > longest:
                axis, longest = a, extent
        middle = (begin + end) // 2
        for k in range(begin, end):
            goes_left[ordered[axis, k]] = k < middle
        for a in range(3):
            left, right = begin, 0
            for k in range(begin, end):
                i = ordered[a, k]
                if goes_left[i] > 0:
                    ordered[a, left] = i
                    left += 1
                else:
                    waiting[right] = i
                    right += 1
            for k in range(right):
                ordered[a, middle + k] = waiting[k]
        nodes.first[node], nodes.size[node] = count, 0
        top = push(jobs, top, count + 1, middle, end)
        top = push(jobs, top, count, begin, middle)
        count += 2
    return count


def build_median(primitives: FloatArray) -> tuple[Nodes, IntArray]:
    """Nodes and references for primitives with boxes (n, 6), in O(n log n) for any input.  Of equal
    centres that of the primitive with the lower index counts as smaller."""
    n = len(primitives)
    centers = 0.5 * primitives[:, :3] + 0.5 * primitives[:, 3:]
    ordered = np.ascontiguousarray(np.argsort(centers, axis=0, kind="stable").T)
    goes_left, waiting = np.empty(n, np.int64), np.empty(n, np.int64)
    jobs, nodes = np.empty((STACK_SIZE, 3), np.int64), new_nodes(n)
    count = _halve_all(centers, ordered, goes_left, waiting, jobs, nodes)
    nodes, references = trimmed(nodes, count), ordered[0].copy()
    fit(nodes, references, primitives)
    return nodes, references


INNER_COST = 2.0
"""The cost of an inner node in units of a primitive test: two box tests, each about as expensive as
one.  Measured: with 1, which makes 1.5 to 2 times as many nodes, rays at a bunny and at random
triangles are no faster."""


@kernel
def _bound(refs: FloatArray, begin: int, end: int, box: FloatArray, centers: FloatArray) -> None:
    """Computes the bounds of references, and those of their centres."""
    clear(box)
    clear(centers)
    for k in range(begin, end):
        ref = refs[k]
        merge(box, ref)
        for a in range(3):
            c = center(ref, a)
            centers[a] = min(centers[a], c)
            centers[3 + a] = max(centers[3 + a], c)


@kernel
def _partition(
    refs: FloatArray, ids: IntArray, begin: int, end: int, centers: FloatArray, split: Split
) -> int:
    """Reorders references, the right child's first; the index of the left child's first one."""
    a = split.axis
    low, scale = centers[a], bins_per_unit(centers[a], centers[3 + a])
    i, j = begin, end - 1
    while i <= j:
        if bin_of(center(refs[i], a), low, scale) > split.bin:
            i += 1
        elif bin_of(center(refs[j], a), low, scale) <= split.bin:
            j -= 1
        else:
            swap(refs, ids, i, j)
            i += 1
            j -= 1
    return i


@entry_kernel
def _split_all(
    n: int,
    refs: FloatArray,
    ids: IntArray,
    corners: FloatArray | None,
    jobs: IntArray,
    bins: Bins,
    parts: spatial.Parts,
    nodes: Nodes,
    references: IntArray,
) -> tuple[int, int]:
    """Fills nodes and references; returns how many of each.

    refs (m, 6), ids (m,): boxes and primitives of n references, with room for more.  They are a
    stack: the current node has the last ones; its left child's are moved to the end and processed
    first, and a leaf pops its own.
    """
    side, centers = local_floats(6), local_floats(6)
    end, budget = n, len(ids) - n
    count, used, top = 1, 0, push(jobs, 0, 0, n, 0)
    while top > 0:
        top -= 1
        node, size, depth = jobs[top, 0], jobs[top, 1], jobs[top, 2]
        begin = end - size
        box = nodes.boxes[node]
        _bound(refs, begin, end, box, centers)
        split, plane = no_split(), no_split()
        if size > 1 and depth < SAH_DEPTH:
            split = object_split(refs, begin, end, centers, bins, side)
            if corners is not None:
                root = nodes.boxes[0]
                if budget > 0 and spatial.is_worth_a_try(
                    refs, begin, end, centers, split, root, parts
                ):
                    # The node's share of the room that is left, rounded up.
                    spare = (budget * size + end - 1) // end
                    plane = spatial.best_cut(corners, refs, ids, begin, end, spare, box, bins, side)
        area = half_area(box)
        if size <= LEAF_SIZE:
            # Not `>=`: with areas that overflow (NaN) the comparison is false, and a leaf is made.
            if not min(split.cost, plane.cost) + INNER_COST * area < size * area:
                nodes.first[node], nodes.size[node] = used, size
                for k in range(begin, end):
                    references[used] = ids[k]
                    used += 1
                end = begin
                continue
        middle = begin
        if corners is not None:
            if plane.cost < split.cost:
                middle, new_end = spatial.cut_all(corners, refs, ids, begin, end, box, plane, parts)
                budget -= new_end - end
                end = new_end
        if split.axis >= 0 and not begin < middle < end:
            middle = _partition(refs, ids, begin, end, centers, split)
        if not begin < middle < end:
            middle = (begin + end) // 2
        nodes.first[node], nodes.size[node] = count, 0
        top = push(jobs, top, count + 1, middle - begin, depth + 1)
        top = push(jobs, top, count, end - middle, depth + 1)
        count += 2
    return count, used


def build_sah(primitives: FloatArray, corners: FloatArray | None) -> tuple[Nodes, IntArray]:
    """Nodes and references for primitives with boxes (n, 6), which are reordered.  With corners (n,
    9), see `reference_rt.accel.bvh.build`, spatial splits may cut them, into at most
    spatial.MOST_REFERENCES n references."""
    n = m = len(primitives)
    refs = primitives
    if corners is not None:
        m = spatial.MOST_REFERENCES * n
        refs = np.empty((m, 6))
        refs[:n] = primitives
    ids = np.arange(m)
    nodes, references = new_nodes(m), np.empty(m, np.int64)
    jobs = np.empty((STACK_SIZE, 3), np.int64)
    count, used = _split_all(
        n, refs, ids, corners, jobs, new_bins(), spatial.new_parts(), nodes, references
    )
    return trimmed(nodes, count), references[:used]
