"""The wide BVH: everything of the binary one is in it, in boxes that contain it."""

import numpy as np
import pytest
from bvh_checks import METHODS, bounds, build, slivers, small_triangles

from reference_rt.accel import bvh
from reference_rt.accel.bvh import wide
from reference_rt.accel.bvh.wide import (
    CENTER,
    CHILDREN,
    LEAF_SHARE,
    WIDE_STACK,
    codes_of,
    leaf_code,
)
from reference_rt.jit.simd import VECTOR_WIDTH


def _walk(tree):
    """(code, boxes of all its ancestors and itself, depth) of each leaf."""
    leaves, jobs = [], [(0, [], 0)]
    while jobs:
        node, boxes, depth = jobs.pop()
        for lane in range(VECTOR_WIDTH):
            code = int(codes_of(tree)[node, lane])
            if code == bvh.NOTHING:
                continue
            own = tree.boxes[node, :CHILDREN].reshape(6, VECTOR_WIDTH)[:, lane].astype(float)
            if code >= 0:
                assert code > node  # no cycles
                jobs.append((code, [*boxes, own], depth + 1))
            else:
                leaves.append((code, np.array([*boxes, own]), depth + 1))
    return leaves


def _joined(corners, method, is_triangle):
    nodes, references = build(corners, method)
    wide = bvh.widened(nodes, is_triangle[references])
    kinds = np.where(is_triangle[references], 3, 7)
    vertices = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    tree = bvh.joined([wide], [kinds], [references])
    return nodes, references, bvh.with_corners(tree, corners.reshape(-1, 3), vertices)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n", [1, 2, 9, 70, 3000])
@pytest.mark.parametrize("offset", [0.0, 1e7])
def test_holds_what_the_binary_tree_holds(method, n, offset):
    rng = np.random.default_rng(n)
    corners = small_triangles(n) + offset
    is_triangle = rng.random(n) < 0.7
    _, references, tree = _joined(corners, method, is_triangle)
    seen = np.zeros(len(references), int)
    center = tree.frames[0, CENTER : CENTER + 3]
    low, high = (side - center for side in bounds(corners))
    for code, boxes, _ in _walk(tree):
        first, size = bvh.first_of(code), bvh.size_of(code)
        assert 1 <= size <= LEAF_SHARE
        rows = tree.references[first : first + size, 1]
        seen[first : first + size] += 1
        assert bvh.is_triangle_leaf(code) == is_triangle[rows].all()
        if bvh.is_triangle_leaf(code):
            lanes = tree.corners[9 * first : 9 * (first + size)].reshape(9, size)
            assert np.array_equal(lanes.T, corners[rows])
        if method != "spatial":  # which cuts what it holds
            assert (boxes[:, None, :3] <= low[rows]).all()
            assert (boxes[:, None, 3:] >= high[rows]).all()
        else:
            assert (boxes[:-1, :3] <= boxes[1:, :3]).all() or len(boxes) == 1
    assert (seen == 1).all()
    assert np.array_equal(tree.references[:, 1], references)
    found = bvh.of_wide(tree)
    assert found.references == len(references)
    assert found.leaves == len(_walk(tree))
    assert found.depth == max(depth for _, _, depth in _walk(tree))
    assert found.depth * (VECTOR_WIDTH - 1) <= WIDE_STACK
    assert found.nodes == len(tree.boxes)


def test_boxes_are_tight_far_from_the_origin():
    """They are relative to the tree's centre: float32 rounds them by 2^-24 of the tree's size,
    wherever it stands."""
    corners = small_triangles(3000)
    at_origin, far = (
        _joined(corners + offset, "sah", np.ones(3000, bool))[2] for offset in (0.0, 2.0**20)
    )
    assert bvh.of_wide(far).sah_cost == pytest.approx(bvh.of_wide(at_origin).sah_cost, rel=1e-3)


def test_codes():
    for first, size, is_triangle_leaf in (
        (0, 0, False),
        (0, 1, True),
        (2**26 - 1, 8, True),
        (77, 5, False),
    ):
        code = leaf_code(first, size, is_triangle_leaf)
        assert -(2**31) <= code < 0
        assert (bvh.first_of(code), bvh.size_of(code)) == (first, size)
        assert bvh.is_triangle_leaf(code) == is_triangle_leaf
    assert leaf_code(0, 0, False) == bvh.NOTHING


def _cheapest(nodes, is_triangle, references):
    """The cost of the best wide tree, by trying all: the sum over its nodes of their area, and over
    its leaves of area times `_leaf_cost`; the root's own area is left out."""

    def below(node):
        if nodes.size[node] > 0:
            return references[nodes.first[node] :][: nodes.size[node]].tolist()
        left = nodes.first[node]
        return below(left) + below(left + 1)

    def area(node):
        x, y, z = nodes.boxes[node, 3:] - nodes.boxes[node, :3]
        return x * y + y * z + z * x

    def child(node):
        held = below(node)
        leaf = area(node) * wide._leaf_cost(len(held), is_triangle[held].all())
        return leaf if nodes.size[node] > 0 else min(leaf, area(node) + opened(node))

    def opened(node):
        left = nodes.first[node]
        return min(
            sum(map(child, a + b))
            for a in cuts(left)
            for b in cuts(left + 1)
            if len(a) + len(b) <= VECTOR_WIDTH
        )

    def cuts(node):
        """All ways to divide a subtree among some of its nodes."""
        found = [[node]]
        if nodes.size[node] == 0:
            left = nodes.first[node]
            found += [a + b for a in cuts(left) for b in cuts(left + 1)]
        return [cut for cut in found if len(cut) < VECTOR_WIDTH]

    return opened(0)


@pytest.mark.parametrize("seed", range(6))
def test_is_the_cheapest_of_all(seed):
    rng = np.random.default_rng(seed)
    corners = small_triangles(26, size=0.3, seed=seed)
    is_triangle = rng.random(26) < 0.6
    nodes, references, tree = _joined(corners, "sah", is_triangle)
    cost = 0.0
    for row in range(len(tree.boxes)):
        planes = tree.boxes[row, :CHILDREN].reshape(6, VECTOR_WIDTH).astype(float)
        x, y, z = planes[3:] - planes[:3]
        for lane, code in enumerate(codes_of(tree)[row].tolist()):
            if code != bvh.NOTHING:
                rows = tree.references[bvh.first_of(code) :][: bvh.size_of(code), 1]
                tests = 1.0
                if code < 0:
                    tests = wide._leaf_cost(len(rows), is_triangle[rows].all())
                cost += tests * (x * y + y * z + z * x)[lane]
    # Planes are rounded outwards to float32: by 2^-23 of the tree's size, about 4, areas of up to
    # 16 by up to 8e-6 each and some 1e-6 of a box's own; measured at most 1.3e-7 of the cost.
    assert cost == pytest.approx(_cheapest(nodes, is_triangle, references), rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_areas_that_overflow(method):
    corners = slivers(40, 0.1) * 1e160
    with np.errstate(over="ignore", invalid="ignore"):
        _, references, tree = _joined(corners, method, np.ones(40, bool))
    assert sum(bvh.size_of(code) for code, _, _ in _walk(tree)) == len(references)


def test_everything_in_one_point():
    corners = np.zeros((100, 9))
    _, _, tree = _joined(corners, "sah", np.zeros(100, bool))
    assert sum(bvh.size_of(code) for code, _, _ in _walk(tree)) == 100
