"""The BVH that rays traverse: its memory layout, nodes of up to eight children.

A node's eight boxes are tested at once (`reference_rt.accel.single_ray`), and so are the triangles
of a leaf (`shapes.meshes.watertight.project_leaf`): half as many steps as in a binary tree, and
twice as many rays per second (measured on the Stanford bunny).  `widening` makes it from a binary
one.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.accel.bvh.nodes import STACK_SIZE
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import kernel
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
    codes: IntArray


NOTHING = -1
"""The code of a leaf without references."""


@kernel
def leaf_code(first: int, size: int, is_triangle_leaf: bool) -> int:
    """The code of a leaf of references first..first + size, at most LEAF_SHARE;  is_packet: all are
    triangles, with vertices in `Bvh.corners`."""
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
    kinds: Sequence[IntArray],
    rows: Sequence[IntArray],
    vertices: FloatArray | None,
) -> Bvh:
    """The `Bvh` of several trees, one after another, given the kinds (m,) and rows (m,) of each
    one's references, and the vertices (n, 9) of the scene's triangles.  Raises ValueError for more
    than MOST_REFERENCES."""
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
        children[here, CHILDREN : CHILDREN + VECTOR_WIDTH] = np.where(
            codes >= 0, codes + node, codes
        )
        node, reference = here.stop, reference + len(of_tree)
    codes = children[:, CHILDREN : CHILDREN + VECTOR_WIDTH].astype(np.int64)
    references = np.empty((sum(map(len, rows)), 2), np.int32)
    references[:, 0], references[:, 1] = np.concatenate(kinds), np.concatenate(rows)
    corners = None if vertices is None else _corners_of(vertices, codes, references[:, 1])
    return Bvh(boxes, children.reshape(-1), frames, references, corners, -1)


def _aligned(n: int) -> FloatArray:
    """(n, 32) zeros, aligned so that each row is four whole cache lines."""
    memory = np.zeros((n + 1) * 32)
    skipped = (-memory.ctypes.data % 64) // 8
    return memory[skipped : skipped + 32 * n].reshape(n, 32)


def _below(planes: FloatArray, center: FloatArray) -> Singles:
    """float32 numbers (n, 3 VECTOR_WIDTH), none above its plane (n, 3, VECTOR_WIDTH) minus the
    centre."""
    with np.errstate(over="ignore"):
        exact = np.nextafter(planes - center[None, :, None], -np.inf)
        rounded = exact.astype(np.float32)
    lower = np.nextafter(rounded, np.float32(-np.inf))
    return np.where(rounded > exact, lower, rounded).reshape(len(planes), -1)


def _corners_of(vertices: FloatArray, codes: IntArray, rows: Codes) -> FloatArray | None:
    """`Bvh.corners` for the triangle leaves among codes; rows (m,): each reference's row of
    vertices (n, 9)."""
    leaves = codes[(codes < NOTHING) & ((-1 - codes) & 1 == 1)]
    if len(leaves) == 0:
        return None
    first, size = (-1 - leaves) >> 5, ((-1 - leaves) >> 1) & 15
    corners = np.zeros(9 * len(rows) + VECTOR_WIDTH)
    for s in range(1, LEAF_SHARE + 1):
        leaves = first[size == s][:, None]
        for begin in range(0, len(leaves), _TOGETHER):
            at = leaves[begin : begin + _TOGETHER]
            lanes = vertices[rows[at + np.arange(s)]].transpose(0, 2, 1)
            corners[9 * at + np.arange(9 * s)] = lanes.reshape(len(at), 9 * s)
    return corners


_TOGETHER = 1 << 16
"""Leaves whose corners are copied together: more only take more memory."""
