"""Bounding volume hierarchies (BVHs) over any mix of primitives: how they are built and stored.

Builders see only the primitives' bounding boxes (spatial splits also triangles' vertices).  `build`
makes a binary BVH, `Nodes` in world space, by one of four methods: `top_down.py`'s median
splits and SAH, the latter with `bins.py` and `spatial.py`, or a single leaf.  `widened` makes it a
BVH of eight children a node, `Wide`; `joined` and `with_corners` put several into one `Bvh`, the
arrays that traversals read (all in `wide.py`).  `statistics` measures a BVH.

Builders' indices are int32, and what one step leaves is freed before the next: of a large mesh the
64 bytes of a reference's box, `room_for`, are most of what a build takes.

To add a method: a function build_...(boxes (n, 6)) -> (Nodes, references), deterministic, no deeper
than STACK_SIZE allows, leaves of at most LEAF_SIZE; a name in `Method` and a branch in `build`; the
method's name in the field of the scene, and in METHODS of the tests.
"""

from typing import Literal

import numpy as np

from reference_rt.accel.bvh import top_down
from reference_rt.accel.bvh.nodes import (
    FAR_SLACK,
    LEAF_SIZE,
    REF_FLOATS,
    STACK_SIZE,
    Nodes,
    aligned,
    half_area,
)
from reference_rt.accel.bvh.wide import (
    CENTER,
    CHILDREN,
    NODE_SINGLES,
    NOTHING,
    WIDE_STACK,
    Bvh,
    Statistics,
    Wide,
    child_of,
    first_of,
    is_triangle_leaf,
    joined,
    kind_of,
    of_wide,
    row_of,
    size_of,
    statistics,
    widened,
    with_corners,
)
from reference_rt.core.arrays import FloatArray, IdArray

__all__ = [
    "CENTER",
    "CHILDREN",
    "FAR_SLACK",
    "LEAF_SIZE",
    "NODE_SINGLES",
    "NOTHING",
    "STACK_SIZE",
    "WIDE_STACK",
    "Bvh",
    "Method",
    "Nodes",
    "Statistics",
    "Wide",
    "build",
    "build_over",
    "child_of",
    "first_of",
    "half_area",
    "is_triangle_leaf",
    "joined",
    "kind_of",
    "of_wide",
    "room_for",
    "row_of",
    "size_of",
    "statistics",
    "widened",
    "with_corners",
]

Method = Literal["sah", "median", "spatial", "none"]


def build(
    lower: FloatArray, upper: FloatArray, method: Method = "sah", corners: FloatArray | None = None
) -> tuple[Nodes, IdArray]:
    """`build_over` primitives with finite bounds lower (n, 3), upper (n, 3)."""
    boxes = room_for(len(lower))
    boxes[:-1, :3], boxes[:-1, 3:6] = lower, upper
    return build_over(boxes, method, corners)


def room_for(n: int) -> FloatArray:
    """Room for the boxes of n primitives, as `build_over` takes them: (n + 1, REF_FLOATS)."""
    return aligned(n + 1, REF_FLOATS)


def build_over(
    primitives: FloatArray, method: Method = "sah", corners: FloatArray | None = None
) -> tuple[Nodes, IdArray]:
    """A binary BVH over n >= 1 primitives with finite boxes: of `room_for` them, the lower corners
    in columns 0 to 2 and the upper ones in 3 to 5; the rows may be reordered.

    Returns the nodes and the references (m,): indices of primitives, leaf after leaf.

    - "sah": binned surface area heuristic.  Each primitive is in one leaf.
    - "median": halved at the median of the sorted centres, along the axis of their largest extent.
    - "spatial": surface area heuristic with spatial splits: a primitive may be cut at a plane and
      is then in several leaves, with a box around each part; n <= m <= 2 n.  `corners` (n, 9) holds
      triangles' vertices, for exact cuts, and rows of NaN for other primitives, whose boxes are
      cut.
    - "none": one leaf with everything.
    """
    n = len(primitives) - 1
    # With sizes near the largest float, areas and extents overflow: a worse tree, not a wrong one.
    with np.errstate(over="ignore", invalid="ignore"):
        if method == "none":
            lower, upper = primitives[:n, :3], primitives[:n, 3:6]
            box = np.concatenate([lower.min(axis=0), upper.max(axis=0)])
            leaf = Nodes(box[None], np.zeros(1, np.int32), np.full(1, n, np.int32))
            return leaf, np.arange(n, dtype=np.int32)
        if method == "median":
            return top_down.build_median(primitives[:n])
        if method == "sah":
            return top_down.build_sah(primitives, None)
        if corners is None:
            corners = np.full((n, 9), np.nan)
        return top_down.build_sah(primitives, np.ascontiguousarray(corners))
