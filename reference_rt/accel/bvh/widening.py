"""Collapses a binary BVH into a wide one: chooses which binary nodes become nodes and leaves.

The cheapest of all choices (Wald, Benthin & Boulos 2008, "Getting rid of packets", RT'08), by the
dynamic program of Ylitie, Karras & Laine 2017, HPG, section 3.1.
"""

import numpy as np
import numpy.typing as npt

from reference_rt.accel.bvh.nodes import STACK_SIZE, Nodes, half_area
from reference_rt.accel.bvh.wide import LEAF_SHARE, NOTHING, Wide, leaf_code
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import entry_kernel, kernel, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH

TRIANGLE_LEAF_COST, PRIMITIVE_COST = 1.0, 0.5
"""The cost of a leaf of triangles, and of each primitive in any other leaf, in units of the test of
a node's boxes.  Measured: between 0.5 and 2 the first makes no difference on the bunny."""


@kernel
def _leaf_cost(count: int, triangles: int) -> float:
    if count > LEAF_SHARE:
        return np.inf
    return TRIANGLE_LEAF_COST if triangles == count else PRIMITIVE_COST * count


_INNER, _FEWER = -1, -2


@entry_kernel
def _plan(
    nodes: Nodes,
    count: IntArray,
    triangles: IntArray,
    cost: FloatArray,
    choice: npt.NDArray[np.int8],
) -> None:
    """Computes the cheapest way to turn each binary node into at most i children of a wide node.

    cost, choice (n, VECTOR_WIDTH + 1): by node and i.  choice for i = 1: _INNER, or 0 for a leaf;
    for i > 1: how many of the i go to the left child, or _FEWER: i - 1 are as cheap.  count,
    triangles (n,): references below each node, and how many of these are triangles.
    """
    n = len(nodes.first)
    for k in range(n):
        node = n - 1 - k  # children first
        area = half_area(nodes.boxes[node])
        leaf = area * _leaf_cost(count[node], triangles[node])
        if nodes.size[node] > 0:
            for i in range(1, VECTOR_WIDTH + 1):
                cost[node, i] = leaf
                choice[node, i] = 0 if i == 1 else _FEWER
            continue
        left = nodes.first[node]
        for i in range(2, VECTOR_WIDTH + 1):
            cost[node, i], choice[node, i] = np.inf, 1
            for j in range(1, i):
                both = cost[left, j] + cost[left + 1, i - j]
                if both < cost[node, i]:
                    cost[node, i], choice[node, i] = both, j
        inner = area + cost[node, VECTOR_WIDTH]
        is_leaf = count[node] <= LEAF_SHARE and not inner < leaf
        cost[node, 1] = leaf if is_leaf else inner
        choice[node, 1] = 0 if is_leaf else _INNER
        for i in range(2, VECTOR_WIDTH + 1):
            if cost[node, i - 1] <= cost[node, i]:
                cost[node, i], choice[node, i] = cost[node, i - 1], _FEWER


@entry_kernel
def _collapse(
    nodes: Nodes,
    start: IntArray,
    count: IntArray,
    triangles: IntArray,
    choice: npt.NDArray[np.int8],
    jobs: IntArray,
    boxes: FloatArray,
    codes: IntArray,
) -> int:
    """Fills the wide nodes as `_plan` chose; returns their number.  The root must not be a leaf."""
    opening, shares = local_integers(2 * STACK_SIZE), local_integers(2 * STACK_SIZE)
    made, waiting = 1, 1
    jobs[0, 0], jobs[0, 1] = 0, 0
    while waiting > 0:
        waiting -= 1
        node, row = jobs[waiting, 0], jobs[waiting, 1]
        for k in range(VECTOR_WIDTH):
            codes[row, k] = NOTHING
            for j in range(3):
                boxes[row, j, k], boxes[row, 3 + j, k] = np.inf, -np.inf
        # The binary node that a wide node is made of is always opened.
        opening[0], shares[0] = node, VECTOR_WIDTH
        top, lane, whole = 1, 0, True
        while top > 0:
            top -= 1
            child, share = opening[top], shares[top]
            while share > 1 and choice[child, share] == _FEWER and not (whole and share == 2):
                share -= 1
            if share == 1:
                for k in range(6):
                    boxes[row, k, lane] = nodes.boxes[child, k]
                if choice[child, 1] == _INNER:
                    codes[row, lane] = made
                    jobs[waiting, 0], jobs[waiting, 1] = child, made
                    made += 1
                    waiting += 1
                else:
                    codes[row, lane] = leaf_code(
                        start[child], count[child], triangles[child] == count[child]
                    )
                lane += 1
                continue
            whole = False
            left, mine = nodes.first[child], max(int(choice[child, share]), 1)
            opening[top], shares[top] = left + 1, share - mine
            opening[top + 1], shares[top + 1] = left, mine
            top += 2
    return made


@entry_kernel
def _count(
    nodes: Nodes,
    is_triangle: npt.NDArray[np.bool_],
    start: IntArray,
    count: IntArray,
    triangles: IntArray,
) -> None:
    """Fills start, count, triangles (n,): the first reference below each node, how many there are,
    and how many of them are triangles."""
    for k in range(len(nodes.first)):
        node = len(nodes.first) - 1 - k
        first, size = nodes.first[node], nodes.size[node]
        if size == 0:
            start[node] = min(start[first], start[first + 1])
            count[node] = count[first] + count[first + 1]
            triangles[node] = triangles[first] + triangles[first + 1]
        else:
            start[node], count[node], triangles[node] = first, size, 0
            for r in range(first, first + size):
                triangles[node] += is_triangle[r]


def widened(nodes: Nodes, is_triangle: npt.NDArray[np.bool_]) -> Wide:
    """The wide BVH of a binary one over m references; is_triangle (m,)."""
    if nodes.size[0] > 0:
        return _leaf(nodes, is_triangle)
    n = len(nodes.first)
    start, count, triangles = np.empty((3, n), np.int64)
    _count(nodes, is_triangle, start, count, triangles)
    choice = np.empty((n, VECTOR_WIDTH + 1), np.int8)
    _plan(nodes, count, triangles, np.empty((n, VECTOR_WIDTH + 1)), choice)
    # Every wide node takes up at least one inner node.
    most = int((nodes.size == 0).sum())
    jobs = np.empty((most + 1, 2), np.int64)
    boxes, codes = np.empty((most, 6, VECTOR_WIDTH)), np.empty((most, VECTOR_WIDTH), np.int64)
    made = _collapse(nodes, start, count, triangles, choice, jobs, boxes, codes)
    return Wide(boxes[:made], codes[:made])  # the rest was never written, and takes no memory


def _leaf(nodes: Nodes, is_triangle: npt.NDArray[np.bool_]) -> Wide:
    """The wide BVH of a tree that is one leaf of any size: leaves of LEAF_SHARE references, all in
    the same box, and as many levels of nodes above them as it takes."""
    begins = np.arange(0, int(nodes.size[0]), LEAF_SHARE)
    ends = np.minimum(begins + LEAF_SHARE, nodes.size[0])
    level = np.array(
        [
            leaf_code(int(b), int(e - b), bool(is_triangle[b:e].all()))
            for b, e in zip(begins, ends, strict=True)
        ]
    )
    rows: list[IntArray] = []
    # From the leaves up; the root comes last here and first in the result.
    while True:
        parents = -(-len(level) // VECTOR_WIDTH)
        padded = np.full(parents * VECTOR_WIDTH, NOTHING)
        padded[: len(level)] = level
        rows.extend(padded.reshape(parents, VECTOR_WIDTH))
        if parents == 1:
            break
        level = np.arange(len(rows) - parents, len(rows))
    codes = np.array(rows)[::-1]
    codes = np.where(codes >= 0, len(codes) - 1 - codes, codes)
    empty = np.repeat([np.inf, -np.inf], 3)[None, :, None]
    boxes = np.where((codes != NOTHING)[:, None], nodes.boxes[0][None, :, None], empty)
    return Wide(boxes, codes)
