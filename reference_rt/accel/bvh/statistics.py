"""How good a hierarchy is: its size, its depth, and what a ray costs in it."""

from typing import NamedTuple

import numpy as np

from reference_rt.accel.bvh.nodes import Nodes
from reference_rt.accel.bvh.wide import CHILDREN, NOTHING, Bvh, codes_of
from reference_rt.core.arrays import FloatArray
from reference_rt.jit.simd import LANES


class Statistics(NamedTuple):
    """Counts of a hierarchy.  `depth` is the deepest leaf's, 0 where the root is one.  `sah_cost`
    is how many box and primitive tests a random line through the root's box expects: it meets a
    convex box inside with a chance of the ratio of their areas, tests both boxes of an inner node's
    children and everything in a leaf (Goldsmith & Salmon 1987).  Things that hide others are left
    out: a bound for lines, not the time of a ray that stops at the first hit."""

    nodes: int
    leaves: int
    references: int
    depth: int
    mean_leaf: float
    largest_leaf: int
    sah_cost: float


def statistics(nodes: Nodes) -> Statistics:
    """Counts, depth and cost of the hierarchy whose root is node 0, where others may follow."""
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
        sah_cost=float((tests * _chances(nodes.boxes[reached])).sum()),
    )


def of_wide(bvh: Bvh) -> Statistics:
    """The same of the wide hierarchy whose root is node 0, where others may follow: its nodes' and
    leaves' counts, and for the cost a node's boxes or a leaf of triangles as one test each."""
    boxes, codes = [], []
    level = np.zeros(1, np.int64)
    depth = -1
    while len(level) > 0:
        depth += 1
        children = codes_of(bvh)[level].astype(np.int64)
        planes = bvh.boxes[level, :CHILDREN].reshape(-1, 6, LANES).transpose(0, 2, 1)
        there = children != NOTHING
        codes.append(children[there])
        boxes.append(planes[there].astype(np.float64))
        level = children[there & (children >= 0)]
    code, box = np.concatenate(codes), np.concatenate(boxes)
    leaf = code < 0
    sizes = ((-1 - code[leaf]) >> 1) & 15
    is_packet = (-1 - code[leaf]) & 1 == 1
    root = np.concatenate([boxes[0][:, :3].min(axis=0), boxes[0][:, 3:].max(axis=0)])
    tests = np.ones(len(code) + 1)
    tests[1:][leaf] = np.where(is_packet, 1, sizes)
    return Statistics(
        nodes=1 + int((~leaf).sum()),
        leaves=int(leaf.sum()),
        references=int(sizes.sum()),
        depth=depth + 1,
        mean_leaf=float(sizes.mean()),
        largest_leaf=int(sizes.max()),
        sah_cost=float((tests * _chances(np.vstack([root, box]))).sum()),
    )


def _chances(boxes: FloatArray) -> FloatArray:
    """Area of each box over the first's; 1 for all where that has none (all on a line)."""
    # In units of the root, and halved first: areas of finite boxes neither over- nor underflow.
    extent = 0.5 * boxes[:, 3:] - 0.5 * boxes[:, :3]
    longest = extent[0].max()
    if longest > 0.0:
        x, y, z = (extent / longest).T
        area = x * y + y * z + z * x
        if area[0] > 0.0:
            return np.asarray(area / area[0])
    return np.ones(len(boxes))
