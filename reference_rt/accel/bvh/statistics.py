"""Statistics of a BVH: its size, its depth and its SAH cost."""

from typing import NamedTuple

import numpy as np

from reference_rt.accel.bvh.nodes import Nodes
from reference_rt.accel.bvh.wide import CHILDREN, NOTHING, Bvh, codes_of
from reference_rt.core.arrays import FloatArray
from reference_rt.jit.simd import VECTOR_WIDTH


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
