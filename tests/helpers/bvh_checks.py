"""Triangles to build hierarchies over, and checks that hold for every tree."""

import numpy as np

from reference_rt.accel import bvh

METHODS = ("sah", "median", "spatial", "none")
BUILDERS = METHODS[:3]


def bounds(corners):
    v = corners.reshape(-1, 3, 3)
    return v.min(axis=1), v.max(axis=1)


def small_triangles(n, size=0.05, seed=0):
    rng = np.random.default_rng(seed)
    return (rng.uniform(-1, 1, (n, 1, 3)) + size * rng.normal(size=(n, 3, 3))).reshape(n, 9)


def slivers(n, spread, seed=0):
    """Long thin triangles along a diagonal, side by side: a box of one holds much of the others."""
    rng = np.random.default_rng(seed)
    along = np.ones(3) + spread * rng.normal(size=(n, 1, 3))
    ends = along * np.array([-1.0, 1.0, 1.0])[:, None]
    corners = rng.uniform(-0.3, 0.3, (n, 1, 3)) + ends + 0.01 * rng.normal(size=(n, 3, 3))
    return corners.reshape(n, 9)


def strips(n, seed=0):
    """A turned square of long triangles side by side: the boxes overlap, the triangles do not."""
    a, z = np.linspace(-1, 1, n + 1), np.zeros(n)
    corners = [[a[:-1], z - 1, z], [a[1:], z - 1, z], [a[1:], z + 1, z]]
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return (np.array(corners).transpose(2, 0, 1) @ turn.T).reshape(n, 9)


def build(corners, method):
    return bvh.build(*bounds(corners), method, corners)


def leaf_of_reference(nodes):
    """The leaf (m,) of each reference; that leaves take all of them up, in turn, is checked."""
    leaves = np.flatnonzero(nodes.size > 0)
    leaves = leaves[np.argsort(nodes.first[leaves])]
    sizes = nodes.size[leaves]
    assert np.array_equal(nodes.first[leaves], np.cumsum(sizes) - sizes)
    return np.repeat(leaves, sizes)


def depth_of(nodes):
    """The deepest leaf's, the root's being 0.  Parents come before their children."""
    depth = np.zeros(len(nodes.first), int)
    for node in np.flatnonzero(nodes.size == 0):
        depth[nodes.first[node] : nodes.first[node] + 2] = depth[node] + 1
    return depth.max()


def check(lower, upper, nodes, references, method):
    """All that holds of any tree over boxes."""
    n, inner = len(lower), np.flatnonzero(nodes.size == 0)
    left = nodes.first[inner]
    assert (left > inner).all()
    children = np.concatenate([left, left + 1])
    assert sorted(children) == list(range(1, len(nodes.first)))
    leaf = leaf_of_reference(nodes)
    assert len(leaf) == len(references)
    if method == "spatial":
        assert set(references) == set(range(n))
        assert len(references) <= 2 * n
        pairs = set(zip(leaf.tolist(), references.tolist(), strict=True))
        assert len(pairs) == len(references)
    else:
        assert sorted(references) == list(range(n))
    if method == "none":
        assert nodes.size.tolist() == [n]
    else:
        assert nodes.size.max() <= bvh.LEAF_SIZE
    depth = depth_of(nodes)
    assert depth <= bvh.STACK_SIZE - 2
    assert depth == bvh.statistics(nodes).depth
    low, high = nodes.boxes[:, :3], nodes.boxes[:, 3:]
    assert (low <= high).all()
    # Inner boxes are those of their children, leaves' of their primitives, but for what was cut.
    children_low = np.minimum(low[left], low[left + 1])
    children_high = np.maximum(high[left], high[left + 1])
    assert (low[inner] <= children_low).all()
    assert (high[inner] >= children_high).all()
    around_low, around_high = np.full_like(low, np.inf), np.full_like(high, -np.inf)
    np.minimum.at(around_low, leaf, lower[references])
    np.maximum.at(around_high, leaf, upper[references])
    leaves = np.flatnonzero(nodes.size > 0)
    if method == "spatial":
        assert (low[leaves] >= around_low[leaves]).all()
        assert (high[leaves] <= around_high[leaves]).all()
    else:
        assert np.array_equal(low[inner], children_low)
        assert np.array_equal(high[inner], children_high)
        assert np.array_equal(low[leaves], around_low[leaves])
        assert np.array_equal(high[leaves], around_high[leaves])


def covered(nodes, references, points, n):
    """For points (m, 3) of each of n primitives (n, k, 3): is each in a leaf that names it?"""
    inside = np.zeros(points.shape[:2], bool)
    box = nodes.boxes[leaf_of_reference(nodes)][:, None]
    mine = points[references]
    here = ((box[..., :3] <= mine) & (mine <= box[..., 3:])).all(axis=-1)
    np.logical_or.at(inside, references, here)
    return inside
