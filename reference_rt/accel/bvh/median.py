"""Median splits: nodes are halved at the median of the sorted centres, along the centres' longest
axis."""

import numpy as np

from reference_rt.accel.bvh.nodes import LEAF_SIZE, STACK_SIZE, Nodes, fit, new_nodes, push, trimmed
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import entry_kernel


@entry_kernel
def _split_all(
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


def build(primitives: FloatArray) -> tuple[Nodes, IntArray]:
    """Nodes and references for primitives with boxes (n, 6), in O(n log n) for any input.  Of equal
    centres that of the primitive with the lower index counts as smaller."""
    n = len(primitives)
    centers = 0.5 * primitives[:, :3] + 0.5 * primitives[:, 3:]
    ordered = np.ascontiguousarray(np.argsort(centers, axis=0, kind="stable").T)
    goes_left, waiting = np.empty(n, np.int64), np.empty(n, np.int64)
    jobs, nodes = np.empty((STACK_SIZE, 3), np.int64), new_nodes(n)
    count = _split_all(centers, ordered, goes_left, waiting, jobs, nodes)
    nodes, references = trimmed(nodes, count), ordered[0].copy()
    fit(nodes, references, primitives)
    return nodes, references
