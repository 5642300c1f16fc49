"""What each BVH builder guarantees, and the statistics of trees."""

import numpy as np
import pytest
from builders import U, unit_vectors
from bvh_checks import BUILDERS, bounds, build, slivers, small_triangles, strips

from reference_rt.accel import bvh

# ---- what each method promises ------------------------------------------------------------------


def cost(corners, method):
    return bvh.statistics(build(corners, method)[0]).sah_cost


@pytest.mark.parametrize("seed", range(3))
def test_spatial_splits_pay_on_long_diagonal_triangles(seed):
    """Measured on six seeds: 0.52 to 0.56 of the cost, and 0.55 to 0.89 for strips."""
    for spread in (0.05, 0.2):
        corners = slivers(500, spread, seed)
        assert cost(corners, "spatial") < 0.65 * cost(corners, "sah")
    corners = strips(500, seed)
    assert cost(corners, "spatial") < cost(corners, "sah")


def test_spatial_splits_do_nothing_where_boxes_are_apart():
    x, y, z = np.meshgrid(*[np.arange(0, 20, 2.0)] * 3)
    lower = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    sah, order = bvh.build(lower, lower + 1, "sah")
    cut, references = bvh.build(lower, lower + 1, "spatial")
    assert np.array_equal(order, references)
    assert np.array_equal(sah.boxes, cut.boxes)


def test_sah_parts_what_is_apart():
    """Clusters of unequal numbers: the heuristic splits between them, the median through one."""
    rng = np.random.default_rng(5)
    lower = rng.uniform(0, 1, (100, 3))
    lower[:10] += [100, 0, 0]
    nodes, _ = bvh.build(lower, lower + 0.1, "sah")
    near = nodes.boxes[1:3, 0] < 50
    assert sorted(near) == [False, True]
    assert (nodes.boxes[1:3, 3][near] < 50).all()
    for method in ("median", "none"):
        worse = bvh.build(lower, lower + 0.1, method)[0]
        assert bvh.statistics(worse).sah_cost > 1.2 * bvh.statistics(nodes).sah_cost


def test_sah_finds_the_cheapest_of_all_planes():
    """Sixteen centres, one in each bin: every split of them along an axis is a plane's."""
    rng = np.random.default_rng(6)
    for trial in range(20):
        centers = rng.uniform(0, 1, (16, 3))
        centers[:, trial % 3] = 16 * rng.permutation(16) / 15
        half = 0.5 * rng.uniform(0.1, 3, (16, 3))
        lower, upper = centers - half, centers + half
        centers = 0.5 * lower + 0.5 * upper
        nodes, references = bvh.build(lower, upper, "sah")

        def area(rows, lower=lower, upper=upper):
            x, y, z = upper[rows].max(axis=0) - lower[rows].min(axis=0)
            return x * y + y * z + z * x

        best = np.inf
        for axis in [trial % 3]:
            order = np.argsort(centers[:, axis])
            for k in range(1, 16):
                best = min(best, k * area(order[:k]) + (16 - k) * area(order[k:]))
        left_size = sum(nodes.size[below(nodes, 1)])
        left, right = references[:left_size], references[left_size:]
        assert len(left) * area(left) + len(right) * area(right) <= best * (1 + 8 * U)


def below(nodes, root):
    """All nodes of a subtree."""
    found = [root]
    for node in found:
        if nodes.size[node] == 0:
            found += [nodes.first[node], nodes.first[node] + 1]
    return found


def leaf_sets(nodes, references):
    """The references of each leaf, left to right."""
    leaves = np.flatnonzero(nodes.size > 0)
    leaves = leaves[np.argsort(nodes.first[leaves])]
    return [set(references[nodes.first[k] :][: nodes.size[k]].tolist()) for k in leaves]


def test_median_of_sorted_centres():
    x = np.array([7.0, 1, 9, 3, 100, 5, 2, 8, 4])
    lower = np.stack([x * 0, x, 10 * (x % 3)], axis=1)  # furthest apart along y: by the 100
    # Sorted: 1 2 3 4 | 5 7 8 9 100, and of the five on the right 5 7 | 8 9 100.
    nodes, references = bvh.build(lower, lower + 1, "median")
    assert leaf_sets(nodes, references) == [{1, 6, 3, 8}, {5, 0}, {7, 2, 4}]
    assert nodes.boxes[1].tolist() == [0, 1, 0, 1, 5, 21]
    # Not the boxes' sizes count, but their centres: these are furthest apart along z.
    size = np.array([50.0, 0, 0])
    lower = np.stack([x * 0, x * 0, x], axis=1)
    nodes, references = bvh.build(lower - size, lower + size, "median")
    assert leaf_sets(nodes, references) == [{1, 6, 3, 8}, {5, 0}, {7, 2, 4}]


def test_median_keeps_the_order_of_equals():
    same = np.zeros((11, 3))
    nodes, references = bvh.build(same, same + 1, "median")
    assert references.tolist() == list(range(11))
    assert [len(s) for s in leaf_sets(nodes, references)] == [2, 3, 3, 3]


def test_none_is_one_leaf():
    corners = small_triangles(33)
    nodes, references = build(corners, "none")
    lower, upper = bounds(corners)
    assert nodes.boxes.tolist() == [[*lower.min(axis=0), *upper.max(axis=0)]]
    assert references.tolist() == list(range(33))


# ---- statistics ---------------------------------------------------------------------------------


def test_statistics_of_a_tree_by_hand():
    """Two unit cubes at the ends of a 3 x 1 x 1 box: half areas 3 and 7, leaves of one and three;
    what follows the tree does not count."""
    boxes = np.array([[0, 0, 0, 3, 1, 1], [0, 0, 0, 1, 1, 1], [2, 0, 0, 3, 1, 1], [0] * 6], float)
    nodes = bvh.Nodes(boxes, np.array([1, 0, 1, 0]), np.array([0, 1, 3, 9]))
    found = bvh.statistics(nodes)
    assert found[:6] == (3, 2, 4, 1, 2.0, 3)
    assert found.sah_cost == pytest.approx(2 + 3 / 7 * 1 + 3 / 7 * 3, rel=8 * U)


@pytest.mark.parametrize("method", BUILDERS)
def test_cost_is_that_of_random_lines(method):
    """Lines of uniform direction through uniform points of the disk across a ball around the root
    are uniform (Santaló 1976); 5 standard errors."""
    rng = np.random.default_rng(7)
    nodes, _ = build(slivers(60, 0.3), method)
    low, high = nodes.boxes[:, :3], nodes.boxes[:, 3:]
    middle, radius = 0.5 * (low[0] + high[0]), 0.5 * np.linalg.norm(high[0] - low[0])
    count = 20_000
    d = unit_vectors(rng, count)
    across = np.cross(d, unit_vectors(rng, count))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    o = middle + radius * np.sqrt(rng.uniform(size=(count, 1))) * across
    tests = np.zeros(count)
    for node in range(len(nodes.size)):
        t = np.sort([(low[node] - o) / d, (high[node] - o) / d], axis=0)
        met = t[0].max(axis=1) <= t[1].min(axis=1)
        if node == 0:
            through = met
        tests += met * (nodes.size[node] or 2)
    tests = tests[through]
    error = tests.std() / np.sqrt(len(tests))
    assert abs(tests.mean() - bvh.statistics(nodes).sah_cost) < 5 * error
