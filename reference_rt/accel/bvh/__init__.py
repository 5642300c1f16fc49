"""Bounding volume hierarchies over any mix of primitives, from their boxes alone.

`build` makes one by any of four methods, each in its file; `statistics` says how good it is.  What
follows a ray through it is `reference_rt.accel.geometry`, which takes it `widened`.
"""

from typing import Literal

import numpy as np

from reference_rt.accel.bvh import median, sah
from reference_rt.accel.bvh.nodes import FAR_SLACK, LEAF_SIZE, STACK_SIZE, Nodes, half_area
from reference_rt.accel.bvh.statistics import Statistics, of_wide, statistics
from reference_rt.accel.bvh.wide import (
    CENTER,
    CHILDREN,
    NODE_SINGLES,
    NOTHING,
    WIDE_STACK,
    Bvh,
    Wide,
    child_of,
    first_of,
    is_packet,
    joined,
    kind_of,
    row_of,
    size_of,
)
from reference_rt.accel.bvh.widening import widened
from reference_rt.core.arrays import FloatArray, IntArray

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
    "child_of",
    "first_of",
    "half_area",
    "is_packet",
    "joined",
    "kind_of",
    "of_wide",
    "row_of",
    "size_of",
    "statistics",
    "widened",
]

Method = Literal["sah", "median", "spatial", "none"]


def build(
    lower: FloatArray,
    upper: FloatArray,
    method: Method = "sah",
    corners: FloatArray | None = None,
) -> tuple[Nodes, IntArray]:
    """A hierarchy over n >= 1 primitives with finite bounds (n, 3), (n, 3).

    Returns the nodes and the references (m,): numbers of primitives, leaf after leaf.

    - "sah": binned surface area heuristic.  Each primitive is in one leaf.
    - "median": halved at the median of the sorted centres, along the axis on which they are
      furthest apart.
    - "spatial": surface area heuristic that may also cut primitives at a plane, if one is then in
      several leaves, with a box around its part: n <= m <= 2 n.  `corners` (n, 9) holds triangles'
      vertices, which are cut exactly, and rows of NaN for what is no triangle: its box is cut.
    - "none": one leaf with everything.
    """
    primitives = np.concatenate([lower, upper], axis=1)
    # Sizes near the largest float: areas and extents that overflow make a worse tree, no wrong one.
    with np.errstate(over="ignore", invalid="ignore"):
        if method == "none":
            box = np.concatenate([lower.min(axis=0), upper.max(axis=0)])
            n = len(lower)
            return Nodes(box[None], np.zeros(1, np.int64), np.full(1, n)), np.arange(n)
        if method == "median":
            return median.build(primitives)
        if method == "sah":
            return sah.build(primitives, None)
        if corners is None:
            corners = np.full((len(lower), 9), np.nan)
        return sah.build(primitives, np.ascontiguousarray(corners))
