"""The hierarchy that rays go through: nodes of up to eight children, made from a binary one.

A node's eight boxes are met or missed at once (`reference_rt.traversal`), and so are the triangles
of a leaf (`shapes.watertight.maybe_met`): half as many steps as in the binary tree, and measured on
the Stanford bunny twice as many rays.  Which binary nodes become nodes is the cheapest of all
choices (Wald, Benthin & Boulos 2008, "Getting rid of packets", RT'08; the dynamic program is
Ylitie, Karras & Laine's 2017, HPG, section 3.1).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.bvh.nodes import STACK_SIZE, Nodes, half_area
from reference_rt.kernel import entry_kernel, kernel, local_integers
from reference_rt.lanes import LANES
from reference_rt.shapes.shape import FloatArray, IntArray

Singles = npt.NDArray[np.float32]
Codes = npt.NDArray[np.int32]

CHILDREN = 48
"""The column of `Bvh.children` with the first child's code; the planes of boxes stand before it."""
CENTER = 28
"""The column of `Bvh.frames` with a tree's centre; its size follows."""
MOST_REFERENCES = 2**26
"""More do not fit into the codes of leaves."""
WIDE_STACK = (LANES - 1) * (STACK_SIZE + 1)
"""A node has at least one binary node's depth, and leaves seven siblings at most."""

LEAF_SHARE = LANES
"""Most references of a leaf."""
PACKET_COST, PRIMITIVE_COST = 1.0, 0.5
"""What a leaf of triangles costs, and one primitive of another leaf, in tests of a node's boxes.
Measured: between 0.5 and 2 the first makes no difference on the bunny."""


class Bvh(NamedTuple):
    """One hierarchy or several one after another, as a traversal takes them.

    A node is a row of 256 bytes, seen as
    boxes (n, 64): float32, lower x of LANES children, lower y, lower z, upper x, y and z, relative
    to the tree's centre and rounded outwards: boxes only cull, and so half the memory will do;
    children (n, 64): int32, from CHILDREN on the children's codes;
    frames (n, 32): float64, of a tree's root from CENTER on the centre and the largest coordinate.

    The code of a node is its row, that of a leaf `leaf_code`.  references (m, 2): kind and row of
    what each is, leaf after leaf;  corners (9 m + 8,): of leaves of triangles alone the vertices,
    see `shapes.watertight.maybe_met`, None where there is no such leaf;  unbounded: the node of
    what has no finite box, -1 for none.
    """

    boxes: Singles
    children: Codes
    frames: FloatArray
    references: Codes
    corners: FloatArray | None
    unbounded: int


class Wide(NamedTuple):
    """One hierarchy: boxes (n, 6, LANES) in world coordinates, codes (n, LANES)."""

    boxes: FloatArray
    codes: IntArray


NOTHING = -1
"""The code of a leaf without references."""


@kernel
def leaf_code(first: int, size: int, is_packet: bool) -> int:
    """The code of a leaf of references first..first + size, at most LEAF_SHARE;  is_packet: they
    are triangles, whose vertices lie in `Bvh.corners`."""
    return -1 - (32 * first + 2 * size + int(is_packet))


@kernel
def first_of(code: int) -> int:
    """The first reference of a leaf."""
    return (-1 - code) >> 5


@kernel
def size_of(code: int) -> int:
    """How many references a leaf has."""
    return ((-1 - code) >> 1) & 15


@kernel
def is_packet(code: int) -> bool:
    """Whether a leaf's references are triangles, side by side in `Bvh.corners`."""
    return (-1 - code) & 1 == 1


@kernel
def child_of(bvh: Bvh, node: int, lane: int) -> int:
    """The code of a node's child."""
    code: int = np.int64(bvh.children[node, CHILDREN + lane])  # type: ignore[assignment]
    return code


@kernel
def kind_of(bvh: Bvh, reference: int) -> int:
    """The kind of a reference."""
    kind: int = np.int64(bvh.references[reference, 0])  # type: ignore[assignment]
    return kind


@kernel
def row_of(bvh: Bvh, reference: int) -> int:
    """The row of a reference in the table of its kind."""
    row: int = np.int64(bvh.references[reference, 1])  # type: ignore[assignment]
    return row


@kernel
def _leaf_cost(count: int, triangles: int) -> float:
    if count > LEAF_SHARE:
        return np.inf
    return PACKET_COST if triangles == count else PRIMITIVE_COST * count


_INNER, _FEWER = -1, -2


@entry_kernel
def _plan(
    nodes: Nodes,
    count: IntArray,
    triangles: IntArray,
    cost: FloatArray,
    choice: npt.NDArray[np.int8],
) -> None:
    """The cheapest way to turn each binary node into at most i of a wide node's children.

    choice (n, LANES + 1): for i = 1 _INNER or 0, a leaf; for more: how many of the i the left
    child gets, or _FEWER: i - 1 are as good.  count, triangles (n,): references below each node.
    """
    n = len(nodes.first)
    for k in range(n):
        node = n - 1 - k  # children first
        area = half_area(nodes.boxes[node])
        leaf = area * _leaf_cost(count[node], triangles[node])
        if nodes.size[node] > 0:
            for i in range(1, LANES + 1):
                cost[node, i] = leaf
                choice[node, i] = 0 if i == 1 else _FEWER
            continue
        left = nodes.first[node]
        for i in range(2, LANES + 1):
            cost[node, i], choice[node, i] = np.inf, 1
            for j in range(1, i):
                both = cost[left, j] + cost[left + 1, i - j]
                if both < cost[node, i]:
                    cost[node, i], choice[node, i] = both, j
        inner = area + cost[node, LANES]
        is_leaf = count[node] <= LEAF_SHARE and not inner < leaf
        cost[node, 1] = leaf if is_leaf else inner
        choice[node, 1] = 0 if is_leaf else _INNER
        for i in range(2, LANES + 1):
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
    """Fill the wide nodes as `_plan` chose; returns how many.  The root must not be a leaf."""
    opening, shares = local_integers(2 * STACK_SIZE), local_integers(2 * STACK_SIZE)
    made, waiting = 1, 1
    jobs[0, 0], jobs[0, 1] = 0, 0
    while waiting > 0:
        waiting -= 1
        node, row = jobs[waiting, 0], jobs[waiting, 1]
        # The root of a wide node is opened in any case.
        opening[0], shares[0] = node, LANES
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
    """The first reference below each node, how many there are, and how many triangles."""
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
    """The wide hierarchy of a binary one over m references, of which some are triangles (m,)."""
    if nodes.size[0] > 0:
        return _leaf(nodes, is_triangle)
    n = len(nodes.first)
    start, count, triangles = np.empty((3, n), np.int64)
    _count(nodes, is_triangle, start, count, triangles)
    choice = np.empty((n, LANES + 1), np.int8)
    _plan(nodes, count, triangles, np.empty((n, LANES + 1)), choice)
    # Every wide node takes up at least one inner node.
    most = int((nodes.size == 0).sum())
    boxes, codes = _empty(most)
    made = _collapse(
        nodes, start, count, triangles, choice, np.empty((most + 1, 2), np.int64), boxes, codes
    )
    return Wide(boxes[:made].copy(), codes[:made].copy())


def _empty(n: int) -> tuple[FloatArray, IntArray]:
    boxes = np.empty((n, 6, LANES))
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    return boxes, np.full((n, LANES), NOTHING)


def _leaf(nodes: Nodes, is_triangle: npt.NDArray[np.bool_]) -> Wide:
    """A tree that is one leaf of any size: as many leaves in one box as it takes, and as many nodes
    over these."""
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
        parents = -(-len(level) // LANES)
        padded = np.full(parents * LANES, NOTHING)
        padded[: len(level)] = level
        rows.extend(padded.reshape(parents, LANES))
        if parents == 1:
            break
        level = np.arange(len(rows) - parents, len(rows))
    codes = np.array(rows)[::-1]
    codes = np.where(codes >= 0, len(codes) - 1 - codes, codes)
    boxes, _ = _empty(len(codes))
    boxes = np.where((codes != NOTHING)[:, None], nodes.boxes[0][None, :, None], boxes)
    return Wide(boxes, codes)


def joined(
    trees: Sequence[Wide],
    kinds: Sequence[IntArray],
    rows: Sequence[IntArray],
    vertices: FloatArray | None,
) -> Bvh:
    """The trees one after another, with their references' kinds (m,) and rows (m,); vertices (n, 9)
    of the scene's triangles."""
    if sum(map(len, rows)) > MOST_REFERENCES:
        raise ValueError(f"over {MOST_REFERENCES:,} primitives; expected fewer")
    frames = _aligned(sum(len(tree.codes) for tree in trees))
    boxes, children = frames.view(np.float32), frames.view(np.int32)
    node, reference = 0, 0
    for tree, of_tree in zip(trees, rows, strict=True):
        here = slice(node, node + len(tree.codes))
        # Unused lanes hold nothing.
        lower, upper = tree.boxes[0, :3].min(axis=1), tree.boxes[0, 3:].max(axis=1)
        center = np.zeros(3)
        if np.isfinite(lower).all() and np.isfinite(upper).all():
            center = 0.5 * lower + 0.5 * upper
            frames[node, CENTER + 3] = max(np.abs(lower).max(), np.abs(upper).max())
        frames[node, CENTER : CENTER + 3] = center
        boxes[here, : CHILDREN // 2] = _below(tree.boxes[:, :3], center)
        boxes[here, CHILDREN // 2 : CHILDREN] = -_below(-tree.boxes[:, 3:], -center)
        codes = np.where(tree.codes < NOTHING, tree.codes - 32 * reference, tree.codes)
        children[here, CHILDREN : CHILDREN + LANES] = np.where(codes >= 0, codes + node, codes)
        node, reference = here.stop, reference + len(of_tree)
    codes = children[:, CHILDREN : CHILDREN + LANES].astype(np.int64)
    references = np.column_stack([np.concatenate(kinds), np.concatenate(rows)]).astype(np.int32)
    corners = None if vertices is None else _packets(vertices, codes, references[:, 1])
    return Bvh(boxes, children, frames, references, corners, -1)


def _aligned(n: int) -> FloatArray:
    """(n, 32) zeros, each row four whole cache lines."""
    memory = np.zeros((n + 1) * 32)
    skipped = (-memory.ctypes.data % 64) // 8
    return memory[skipped : skipped + 32 * n].reshape(n, 32)


def _below(planes: FloatArray, center: FloatArray) -> Singles:
    """float32 numbers (n, 3 LANES) that are nowhere above planes (n, 3, LANES) less the centre."""
    with np.errstate(over="ignore"):
        exact = np.nextafter(planes - center[None, :, None], -np.inf)
        rounded = exact.astype(np.float32)
    lower = np.nextafter(rounded, np.float32(-np.inf))
    return np.where(rounded > exact, lower, rounded).reshape(len(planes), -1)


def _packets(vertices: FloatArray, codes: IntArray, rows: Codes) -> FloatArray | None:
    """`Bvh.corners` of the leaves among codes, whose references name these rows (m,) of vertices
    (n, 9)."""
    leaves = codes[(codes < NOTHING) & ((-1 - codes) & 1 == 1)]
    if len(leaves) == 0:
        return None
    first, size = (-1 - leaves) >> 5, ((-1 - leaves) >> 1) & 15
    corners = np.zeros(9 * len(rows) + LANES)
    for s in range(1, LEAF_SHARE + 1):
        at = first[size == s][:, None]
        lanes = vertices[rows[at + np.arange(s)]].transpose(0, 2, 1)
        corners[9 * at + np.arange(9 * s)] = lanes.reshape(len(at), 9 * s)
    return corners
