"""The two top-down builders: median splits and the SAH.

`build_median` halves nodes at the median of the sorted centres, along the centres' longest axis.
The SAH builder splits each node at the cheapest of many planes (Wald 2007, "On fast construction of
SAH-based bounding volume hierarchies", RT'07), with or without spatial splits.
"""

from typing import Any, NamedTuple

import numpy as np

from reference_rt.accel.bvh import spatial
from reference_rt.accel.bvh.bins import (
    Bins,
    Split,
    bin_of,
    bins_per_unit,
    grow_bounds,
    new_bins,
    no_split,
    object_split,
)
from reference_rt.accel.bvh.nodes import (
    LEAF_SIZE,
    REF_FLOATS,
    SAH_DEPTH,
    STACK_SIZE,
    Nodes,
    aligned,
    assign,
    center,
    fit,
    half_area,
    new_nodes,
    on_threads,
    push,
    swap,
    trimmed,
)
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.jit.kernel import entry_kernel, kernel, local_floats
from reference_rt.jit.simd import VECTOR_WIDTH


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


def build_median(primitives: FloatArray) -> tuple[Nodes, IdArray]:
    """Nodes and references for primitives with boxes (n, 6), in O(n log n) for any input.  Of equal
    centres that of the primitive with the lower index counts as smaller."""
    n = len(primitives)
    centers = 0.5 * primitives[:, :3] + 0.5 * primitives[:, 3:6]
    ordered = np.ascontiguousarray(np.argsort(centers, axis=0, kind="stable").T)
    goes_left, waiting = np.empty(n, np.int64), np.empty(n, np.int64)
    jobs, nodes = np.empty((STACK_SIZE, 3), np.int64), new_nodes(n)
    count = _halve_all(centers, ordered, goes_left, waiting, jobs, nodes)
    nodes, references = trimmed(nodes, count), ordered[0].astype(np.int32)
    fit(nodes, references, primitives)
    return nodes, references


INNER_COST = 2.0
"""The cost of an inner node in units of a primitive test: two box tests, each about as expensive as
one.  Measured: with 1, which makes 1.5 to 2 times as many nodes, rays at a bunny and at random
triangles are no faster."""


@kernel
def _partition(
    refs: FloatArray, ids: IdArray, begin: int, end: int, bounds: FloatArray, split: Split
) -> int:
    """Reorders references, the right child's first; the index of the left child's first one.  It
    exchanges each of them, whether or not it has to, because branches would be mispredicted."""
    a = split.axis
    low, high = bounds[VECTOR_WIDTH + a], bounds[2 * VECTOR_WIDTH + a]
    scale, middle = bins_per_unit(low, high), begin
    for k in range(begin, end):
        is_right = bin_of(center(refs[k], a), low, scale) > split.bin
        swap(refs, ids, middle, k)
        middle += is_right
    return middle


class _Task(NamedTuple):
    """A subtree to build, over a node's references begin ... end;  `limit`: nodes of at most this
    many are left to others."""

    begin: int
    end: int
    depth: int
    limit: int


@entry_kernel
def _split_all(
    task: _Task,
    refs: FloatArray,
    ids: IdArray,
    corners: FloatArray | None,
    jobs: IntArray,
    bins: Bins,
    parts: spatial.Parts,
    nodes: Nodes,
    references: IdArray,
    left_out: IntArray,
) -> tuple[int, int, int]:
    """Fills nodes and references; returns how many nodes there are, where its references end, and
    how many nodes are left to others: their numbers, begins, ends and depths are in `left_out`.

    refs (m + 1, REF_FLOATS), ids (m,): boxes and primitives of n references, with room for more.
    They are a stack: the current node has the last ones; its left child's are moved to the end and
    processed first, and a leaf pops its own.
    """
    side, bounds = local_floats(VECTOR_WIDTH), local_floats(3 * VECTOR_WIDTH)
    end, budget = task.end, len(ids) - task.end
    used = 0 if corners is not None else budget
    count, top, left = 1, push(jobs, 0, 0, task.end - task.begin, task.depth), 0
    while top > 0:
        top -= 1
        node, size, depth = jobs[top, 0], jobs[top, 1], jobs[top, 2]
        begin = end - size
        if size <= task.limit:
            left_out[left, 0], left_out[left, 1] = node, begin
            left_out[left, 2], left_out[left, 3] = end, depth
            left, used, end = left + 1, used + size, begin
            continue
        for k in range(3):
            bounds[k], bounds[3 + k] = np.inf, -np.inf
        for k in range(VECTOR_WIDTH):
            bounds[VECTOR_WIDTH + k], bounds[2 * VECTOR_WIDTH + k] = np.inf, -np.inf
        for k in range(begin, end):
            grow_bounds(refs, REF_FLOATS * k, bounds)
        box = nodes.boxes[node]
        assign(box, bounds)
        split, plane = no_split(), no_split()
        # Two references are never worth a split, but their centres are those of one.
        if size > 2 and depth < SAH_DEPTH:
            split = object_split(refs, begin, end, bounds[VECTOR_WIDTH:], bins, side)
            if corners is not None:
                root = nodes.boxes[0]
                if budget > 0 and spatial.is_worth_a_try(
                    refs, begin, end, bounds[VECTOR_WIDTH:], split, root, parts
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
            middle = _partition(refs, ids, begin, end, bounds, split)
        if not begin < middle < end:
            middle = (begin + end) // 2
        nodes.first[node], nodes.size[node] = count, 0
        top = push(jobs, top, count + 1, middle - begin, depth + 1)
        top = push(jobs, top, count, end - middle, depth + 1)
        count += 2
    return count, used, left


APART = 1 << 14
"""Nodes of more references are split one by one, and those of fewer with all that is below them,
on threads: the same tree whatever the number of threads."""


def build_sah(primitives: FloatArray, corners: FloatArray | None) -> tuple[Nodes, IdArray]:
    """Nodes and references for primitives (n + 1, REF_FLOATS), n boxes and a row of any numbers,
    which are reordered.  With corners (n, 9), see `reference_rt.accel.bvh.build`, spatial splits
    may cut them, into at most spatial.MOST_REFERENCES n references."""
    n = m = len(primitives) - 1
    refs = primitives
    if corners is not None:
        m = spatial.MOST_REFERENCES * n
        refs = aligned(m + 1, REF_FLOATS)
        refs[:n] = primitives[:n]
    ids, references = np.arange(m, dtype=np.int32), np.empty(m, np.int32)

    def build(task: _Task, nodes: Nodes) -> tuple[Nodes, int, IntArray]:
        jobs, left_out = np.empty((STACK_SIZE, 3), np.int64), np.empty((2, 4), np.int64)
        scratch = jobs, new_bins(), spatial.new_parts()
        count, used, left = _split_all(
            task, refs, ids, corners, *scratch, nodes, references, left_out
        )
        return trimmed(nodes, count), used, left_out[:left]

    if corners is not None or n <= APART:
        nodes, used, _ = build(_Task(0, n, 0, 0), new_nodes(m))
        return nodes, references[:used]

    def part(row: IntArray) -> tuple[Nodes, int, IntArray]:
        _, begin, end, depth = row.tolist()
        if end - begin > APART:
            return build(_Task(begin, end, depth, end - begin - 1), new_nodes(2))
        return build(_Task(begin, end, depth, 0), new_nodes(end - begin))

    whole = new_nodes(n)
    count, rows = 1, [np.array([0, 0, n, 0])]
    while rows:
        parts, tasks, rows = on_threads(part, rows), rows, []
        for task, (nodes, _, left_out) in zip(tasks, parts, strict=True):
            # Where its root is, and what to add to the numbers of its other nodes.
            root, more = int(task[0]), count - 1
            nodes.first[nodes.size == 0] += more
            columns: Any = zip(whole, nodes, strict=True)
            for column, of_part in columns:
                column[root], column[count : more + len(of_part)] = of_part[0], of_part[1:]
            left_out[:, 0] += more
            rows += [*left_out]
            count += len(nodes.first) - 1
    return trimmed(whole, count), references
