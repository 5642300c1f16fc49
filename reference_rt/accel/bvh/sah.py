"""The surface area heuristic: top down, always the cheapest of many planes (Wald 2007, "On fast
construction of SAH-based bounding volume hierarchies", RT'07), with spatial splits or without."""

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
    half_area,
    merge,
    new_nodes,
    push,
    swap,
    trimmed,
)
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import entry_kernel, kernel, local_floats

INNER_COST = 2.0
"""What an inner node costs, in tests of primitives: it tests two boxes, each in about the time of
one.  Measured: rays at a bunny and at random triangles are no faster with 1, which makes half as
many nodes again, or twice as many."""


@kernel
def _bound(refs: FloatArray, begin: int, end: int, box: FloatArray, centers: FloatArray) -> None:
    """The box of references, and that of their centres."""
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
    """Put the right child's references first; the index of the first of the left child's."""
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
    """Fill nodes and references; returns how many of each.

    refs (m, 6), ids (m,): boxes and numbers of n references, with room for more.  They are a stack:
    the node in hand has the last ones, its left child's come to lie last and are done first, and a
    leaf takes its own away.
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
                    # Its share of the room that is left, rounded up.
                    spare = (budget * size + end - 1) // end
                    plane = spatial.best_cut(corners, refs, ids, begin, end, spare, box, bins, side)
        area = half_area(box)
        if size <= LEAF_SIZE:
            # Not the reverse: areas that overflow compare as false.
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


def build(primitives: FloatArray, corners: FloatArray | None) -> tuple[Nodes, IntArray]:
    """Nodes and references of primitives with boxes (n, 6); with corners (n, 9), see
    `reference_rt.accel.bvh.build`, they may be cut, into spatial.MOST_REFERENCES n references at
    most."""
    n = len(primitives)
    m = n if corners is None else spatial.MOST_REFERENCES * n
    refs, ids = np.empty((m, 6)), np.arange(m)
    refs[:n] = primitives
    nodes, references = new_nodes(m), np.empty(m, np.int64)
    jobs = np.empty((STACK_SIZE, 3), np.int64)
    count, used = _split_all(
        n, refs, ids, corners, jobs, new_bins(), spatial.new_parts(), nodes, references
    )
    return trimmed(nodes, count), references[:used].copy()
