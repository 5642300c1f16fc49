"""The BVH that rays traverse, with nodes of up to eight children: its memory layout, how a binary
BVH is collapsed into it, and the size, depth and SAH cost of both.

The cheapest choice of binary nodes that become nodes and leaves (Wald, Benthin & Boulos 2008,
"Getting rid of packets", RT'08), by the dynamic program of Ylitie, Karras & Laine 2017, HPG,
section 3.1.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.accel.bvh.nodes import STACK_SIZE, Nodes, aligned, half_area, on_threads
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.jit.kernel import entry_kernel, kernel, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH

Singles = npt.NDArray[np.float32]
Codes = npt.NDArray[np.int32]

NODE_SINGLES = 64
"""Size of a node in float32 or int32 numbers: four cache lines."""
CHILDREN = 48
"""Offset in a node of the first child's code; before it are the planes of the boxes."""
CENTER = 28
"""The column of `Bvh.frames` with x of a tree's centre; after x, y, z follows the tree's size."""
MOST_REFERENCES = 2**26
"""The most references: leaf codes have no bits for more."""
WIDE_STACK = (VECTOR_WIDTH - 1) * (STACK_SIZE + 1)
"""Stack entries of a traversal: at most seven siblings per level, and no more levels than the
binary BVH has."""

LEAF_SHARE = VECTOR_WIDTH
"""The most references of a leaf."""


class Bvh(NamedTuple):
    """One or several BVHs, one after another, as traversals read them.

    A node is a row of 256 bytes, with three views:
    boxes (n, 64): float32, lower x of VECTOR_WIDTH children, lower y, lower z, upper x, y and z,
    relative to the tree's centre and rounded outwards (boxes only cull, so that half the memory
    suffices); children (64 n,): int32, in each node from CHILDREN on the children's codes;
    frames (n, 32): float64, in a tree's root from CENTER on its centre and its size, the largest
    magnitude of a coordinate.

    The code of a node is its row, that of a leaf is its `leaf_code`.  references (m, 2): kind and
    row of each reference, leaf after leaf;  corners (9 m + 8,): the vertices of leaves with
    triangles only, see `shapes.meshes.watertight.project_leaf`, None without such leaves;
    unbounded: the root of the tree over everything that has no finite box, -1 for none.
    """

    boxes: Singles
    children: Codes
    frames: FloatArray
    references: Codes
    corners: FloatArray | None
    unbounded: int


class Wide(NamedTuple):
    """One wide BVH: boxes (n, 6, VECTOR_WIDTH) in world space, codes (n, VECTOR_WIDTH) of the
    children; lanes without a child hold the empty box and NOTHING."""

    boxes: FloatArray
    codes: IdArray


def root_bounds(bvh: Bvh) -> tuple[FloatArray, FloatArray]:
    """The boxes, lower and upper (VECTOR_WIDTH, 3), of the first tree's children, rounded outwards;
    empty for those that are missing."""
    planes = bvh.boxes[0, :CHILDREN].reshape(2, 3, VECTOR_WIDTH).astype(np.float64)
    centre = bvh.frames[0, CENTER : CENTER + 3]
    return planes[0].T + centre, planes[1].T + centre


NOTHING = -1
"""The code of a leaf without references."""


@kernel
def leaf_code(first: int, size: int, is_triangle_leaf: bool) -> int:
    """The code of a leaf of references first..first + size, at most LEAF_SHARE;  is_triangle_leaf:
    all are triangles, with vertices in `Bvh.corners`."""
    return -1 - (32 * first + 2 * size + int(is_triangle_leaf))


@kernel
def first_of(code: int) -> int:
    """The first reference of a leaf."""
    return (-1 - code) >> 5


@kernel
def size_of(code: int) -> int:
    """How many references a leaf has."""
    return ((-1 - code) >> 1) & 15


@kernel
def is_triangle_leaf(code: int) -> bool:
    """Whether all of a leaf's references are triangles, stored as SoA in `Bvh.corners`."""
    return (-1 - code) & 1 == 1


@kernel
def child_of(bvh: Bvh, node: int, lane: int) -> int:
    """The code of a node's child."""
    code: int = np.int64(bvh.children[node * NODE_SINGLES + CHILDREN + lane])  # type: ignore[assignment]
    return code


def codes_of(bvh: Bvh) -> Codes:
    """The codes of all nodes' children (n, VECTOR_WIDTH)."""
    return bvh.children.reshape(-1, NODE_SINGLES)[:, CHILDREN : CHILDREN + VECTOR_WIDTH]


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


def joined(
    trees: Sequence[Wide],
    kinds: Sequence[npt.NDArray[np.integer]],
    rows: Sequence[IdArray],
) -> Bvh:
    """The `Bvh` of several trees, one after another, given the kinds (m,) and rows (m,) of each
    one's references; without `Bvh.corners`, see `with_corners`.  Raises ValueError for more than
    MOST_REFERENCES."""
    if sum(map(len, rows)) > MOST_REFERENCES:
        raise ValueError(f"over {MOST_REFERENCES:,} primitives; expected fewer")
    frames = aligned(sum(len(tree.codes) for tree in trees), 32)
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
        for begin in range(0, len(tree.codes), _TOGETHER):
            some = tree.boxes[begin : begin + _TOGETHER]
            of_some = boxes[node + begin : node + begin + len(some)]
            of_some[:, : CHILDREN // 2] = _below(some[:, :3], center)
            of_some[:, CHILDREN // 2 : CHILDREN] = -_below(-some[:, 3:], -center)
        codes = np.where(tree.codes < NOTHING, tree.codes - 32 * reference, tree.codes)
        children[here, CHILDREN : CHILDREN + VECTOR_WIDTH] = np.where(
            codes >= 0, codes + node, codes
        )
        node, reference = here.stop, reference + len(of_tree)
    references = np.empty((sum(map(len, rows)), 2), np.int32)
    references[:, 0], references[:, 1] = np.concatenate(kinds), np.concatenate(rows)
    return Bvh(boxes, children.reshape(-1), frames, references, None, -1)


def _below(planes: FloatArray, center: FloatArray) -> Singles:
    """float32 numbers (n, 3 VECTOR_WIDTH), none above its plane (n, 3, VECTOR_WIDTH) minus the
    centre."""
    with np.errstate(over="ignore"):
        exact = np.nextafter(planes - center[None, :, None], -np.inf)
        rounded = exact.astype(np.float32)
    lower = np.nextafter(rounded, np.float32(-np.inf))
    return np.where(rounded > exact, lower, rounded).reshape(len(planes), -1)


def with_corners(bvh: Bvh, points: FloatArray, vertices: IdArray) -> Bvh:
    """With `Bvh.corners` for its leaves of triangles, if it has any; vertices (n, 3): the rows of
    points (m, 3) of the scene's triangles."""
    codes = codes_of(bvh)
    if not ((codes < NOTHING) & ((-1 - codes) & 1 == 1)).any():
        return bvh
    corners = np.zeros(9 * len(bvh.references) + VECTOR_WIDTH)
    blocks = [codes[k : k + _TOGETHER] for k in range(0, len(codes), _TOGETHER)]
    for _ in on_threads(
        lambda block: _copy_corners(block, bvh.references, points, vertices, corners), blocks
    ):
        pass
    return bvh._replace(corners=corners)


_TOGETHER = 1 << 10
"""Nodes whose boxes are rounded together, and whose leaves' corners are copied by one call."""


@entry_kernel
def _copy_corners(
    codes: Codes, references: Codes, points: FloatArray, vertices: IdArray, corners: FloatArray
) -> None:
    for node in range(len(codes)):
        for lane in range(VECTOR_WIDTH):
            code: int = np.int64(codes[node, lane])  # type: ignore[assignment]
            if code < NOTHING and is_triangle_leaf(code):
                first, size = first_of(code), size_of(code)
                for k in range(size):
                    for corner in range(3):
                        point = vertices[references[first + k, 1], corner]
                        for axis in range(3):
                            to = 9 * first + (3 * corner + axis) * size + k
                            corners[to] = points[point, axis]


# ---- collapsing a binary BVH ---------------------------------------------------------------------

TRIANGLE_LEAF_COST, PRIMITIVE_COST = 1.0, 0.5
"""The cost of a leaf of triangles, and of each primitive in any other leaf, in units of the test of
a node's boxes.  Measured: between 0.5 and 2 the first makes no difference on the bunny."""


class _Below(NamedTuple):
    """What is below each of n nodes.  start (n,): the first reference;  size (n,): how many there
    are, MANY for more than LEAF_SHARE;  triangles (n,): whether all are triangles."""

    start: IdArray
    size: npt.NDArray[np.int8]
    triangles: npt.NDArray[np.bool_]


MANY = LEAF_SHARE + 1


@kernel
def _leaf_cost(count: int, triangles: bool) -> float:
    if count > LEAF_SHARE:
        return np.inf
    return TRIANGLE_LEAF_COST if triangles else PRIMITIVE_COST * count


_INNER, _FEWER = -1, -2


@entry_kernel
def _plan(
    nodes: Nodes,
    below: _Below,
    jobs: IntArray,
    costs: FloatArray,
    choice: npt.NDArray[np.int8],
) -> None:
    """Computes the cheapest way to turn each binary node into at most i children of a wide node.

    choice (n, VECTOR_WIDTH + 1): by node and i.  For i = 1: _INNER, or 0 for a leaf; for i > 1: how
    many of the i go to the left child, or _FEWER: i - 1 are as cheap.  jobs (STACK_SIZE, 3), costs
    (STACK_SIZE, 2, VECTOR_WIDTH + 1) are scratch: depth first, the costs of the children of one
    node of each depth are all that is needed, and all nodes' would take 72 bytes each.
    """
    jobs[0, 0], jobs[0, 1], jobs[0, 2] = 0, 0, 0  # the node, 1 behind its children, its side
    depth = 0
    while depth >= 0:
        node, side = jobs[depth, 0], jobs[depth, 2]
        left = nodes.first[node]
        if nodes.size[node] == 0 and jobs[depth, 1] < 2:
            jobs[depth + 1, 0], jobs[depth + 1, 1] = left + jobs[depth, 1], 0
            jobs[depth + 1, 2] = jobs[depth, 1]
            jobs[depth, 1] += 1
            depth += 1
            continue
        cost, of_left, of_right = costs[depth, side], costs[depth + 1, 0], costs[depth + 1, 1]
        depth -= 1
        area = half_area(nodes.boxes[node])
        leaf = area * _leaf_cost(int(below.size[node]), below.triangles[node])
        if nodes.size[node] > 0:
            for i in range(1, VECTOR_WIDTH + 1):
                cost[i] = leaf
                choice[node, i] = 0 if i == 1 else _FEWER
            continue
        for i in range(2, VECTOR_WIDTH + 1):
            cost[i], choice[node, i] = np.inf, 1
            for j in range(1, i):
                both = of_left[j] + of_right[i - j]
                if both < cost[i]:
                    cost[i], choice[node, i] = both, j
        inner = area + cost[VECTOR_WIDTH]
        is_leaf = below.size[node] <= LEAF_SHARE and not inner < leaf
        cost[1] = leaf if is_leaf else inner
        choice[node, 1] = 0 if is_leaf else _INNER
        for i in range(2, VECTOR_WIDTH + 1):
            if cost[i - 1] <= cost[i]:
                cost[i], choice[node, i] = cost[i - 1], _FEWER


@entry_kernel
def _collapse(
    nodes: Nodes,
    below: _Below,
    choice: npt.NDArray[np.int8],
    jobs: IntArray,
    boxes: FloatArray,
    codes: IdArray,
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
                        int(below.start[child]), int(below.size[child]), below.triangles[child]
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
def _count(nodes: Nodes, is_triangle: npt.NDArray[np.bool_], below: _Below) -> None:
    """Fills `below`."""
    start, count, triangles = below.start, below.size, below.triangles
    for k in range(len(nodes.first)):
        node = len(nodes.first) - 1 - k
        first, size = nodes.first[node], nodes.size[node]
        if size == 0:
            start[node] = min(start[first], start[first + 1])
            count[node] = min(MANY, int(count[first]) + int(count[first + 1]))
            triangles[node] = triangles[first] and triangles[first + 1]
        else:
            start[node], count[node], triangles[node] = first, size, True
            for r in range(first, first + size):
                triangles[node] = triangles[node] and is_triangle[r]


def widened(nodes: Nodes, is_triangle: npt.NDArray[np.bool_]) -> Wide:
    """The wide BVH of a binary one over m references; is_triangle (m,)."""
    if nodes.size[0] > 0:
        return _leaf(nodes, is_triangle)
    n = len(nodes.first)
    below = _Below(np.empty(n, np.int32), np.empty(n, np.int8), np.empty(n, np.bool_))
    _count(nodes, is_triangle, below)
    choice = np.empty((n, VECTOR_WIDTH + 1), np.int8)
    jobs, costs = np.empty((STACK_SIZE, 3), np.int64), np.empty((STACK_SIZE, 2, VECTOR_WIDTH + 1))
    _plan(nodes, below, jobs, costs, choice)
    # Every wide node is made of the root, or of one that is an inner node where it is one child.
    most = 1 + int((choice[1:, 1] == _INNER).sum())
    jobs = np.empty((most + 1, 2), np.int64)
    boxes, codes = np.empty((most, 6, VECTOR_WIDTH)), np.empty((most, VECTOR_WIDTH), np.int32)
    made = _collapse(nodes, below, choice, jobs, boxes, codes)
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
    return Wide(boxes, codes.astype(np.int32))


# ---- statistics: size, depth and SAH cost --------------------------------------------------------


class Statistics(NamedTuple):
    """Counts of a BVH.  `depth` is the deepest leaf's, 0 where the root is a leaf.  `sah_cost` is
    the expected number of box and primitive tests of a random line through the root's box: it
    meets a box inside with the probability area / root's area, and tests both children's boxes of
    an inner node and all references of a leaf (Goldsmith & Salmon 1987).  Occlusion is ignored: it
    is a cost of lines, not of rays that stop at the first hit."""

    nodes: int
    leaves: int
    references: int
    depth: int
    mean_leaf: float
    largest_leaf: int
    sah_cost: float


def statistics(nodes: Nodes) -> Statistics:
    """Statistics of the BVH whose root is node 0; others may follow it in the arrays."""
    levels = [np.zeros(1, np.int64)]
    while len(levels[-1]) > 0:
        left = nodes.first[levels[-1][nodes.size[levels[-1]] == 0]]
        levels.append(np.concatenate([left, left + 1]))
    reached = np.concatenate(levels)
    size = nodes.size[reached]
    leaves, references = int((size > 0).sum()), int(size.sum())
    tests = np.where(size > 0, size, 2)
    return Statistics(
        nodes=len(reached),
        leaves=leaves,
        references=references,
        depth=len(levels) - 2,
        mean_leaf=references / leaves,
        largest_leaf=int(size.max()),
        sah_cost=float((tests * _hit_probabilities(nodes.boxes[reached])).sum()),
    )


def of_wide(bvh: Bvh) -> Statistics:
    """Statistics of the wide BVH whose root is node 0; others may follow it in the arrays.  In the
    cost a node's boxes are one test, and so is a leaf of triangles."""
    boxes, codes = [], []
    level = np.zeros(1, np.int64)
    depth = -1
    while len(level) > 0:
        depth += 1
        children = codes_of(bvh)[level].astype(np.int64)
        planes = bvh.boxes[level, :CHILDREN].reshape(-1, 6, VECTOR_WIDTH).transpose(0, 2, 1)
        there = children != NOTHING
        codes.append(children[there])
        boxes.append(planes[there].astype(np.float64))
        level = children[there & (children >= 0)]
    code, box = np.concatenate(codes), np.concatenate(boxes)
    leaf = code < 0
    sizes = ((-1 - code[leaf]) >> 1) & 15
    is_triangle_leaf = (-1 - code[leaf]) & 1 == 1
    root = np.concatenate([boxes[0][:, :3].min(axis=0), boxes[0][:, 3:].max(axis=0)])
    tests = np.ones(len(code) + 1)
    tests[1:][leaf] = np.where(is_triangle_leaf, 1, sizes)
    return Statistics(
        nodes=1 + int((~leaf).sum()),
        leaves=int(leaf.sum()),
        references=int(sizes.sum()),
        depth=depth + 1,
        mean_leaf=float(sizes.mean()),
        largest_leaf=int(sizes.max()),
        sah_cost=float((tests * _hit_probabilities(np.vstack([root, box]))).sum()),
    )


def _hit_probabilities(boxes: FloatArray) -> FloatArray:
    """Each box's area over the first's, the probability that a random line through the first meets
    it; 1 for all where the first has no area (all on a line)."""
    # In units of the root, and halved first: areas of finite boxes neither over- nor underflow.
    extent = 0.5 * boxes[:, 3:] - 0.5 * boxes[:, :3]
    longest = extent[0].max()
    if longest > 0.0:
        x, y, z = (extent / longest).T
        area = x * y + y * z + z * x
        if area[0] > 0.0:
            return np.asarray(area / area[0])
    return np.ones(len(boxes))
