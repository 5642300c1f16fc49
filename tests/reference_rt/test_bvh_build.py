"""The builders: nothing is lost, nothing is too deep, and what each promises."""

import os
import subprocess
import sys
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from builders import U, unit_vectors
from hypothesis import given
from hypothesis import strategies as st

from reference_rt import bvh
from reference_rt.bvh import spatial

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


# ---- any input ----------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 9, 64, 1000])
def test_random_triangles(method, n):
    for size in (0.0, 0.05, 2.0):
        corners = small_triangles(n, size, seed=n)
        nodes, references = build(corners, method)
        check(*bounds(corners), nodes, references, method)


def adversaries():
    n = 300
    rng = np.random.default_rng(1)
    k = np.arange(n)[:, None] * np.ones(3)
    point = rng.uniform(-1, 1, (n, 3))
    side = rng.uniform(0, 1, (n, 3))
    flat = side * [1, 0, 1]
    for ratio in (0.5, 0.1, 0.999, 3.0):
        # Sizes and places that shrink by a ratio make the heuristic peel one at a time.
        x = np.clip(ratio**k, 1e-300, 1e100)
        yield f"ratio {ratio}", x, 1.5 * x
        yield f"ratio {ratio}, points", x, x
        yield f"ratio {ratio}, about 0", -x, x
        yield f"ratio {ratio}, along a line", x * [1, 0, 0], x * [1, 0, 0]
        yield f"ratio {ratio}, slabs", x * [1, -1e3, -1e3], x * [1, 1e3, 1e3]
    yield "identical", np.zeros((n, 3)), np.ones((n, 3))
    yield "identical points", np.ones((n, 3)), np.ones((n, 3))
    yield "one centre", -side, side
    yield "two places", point[k[:, 0].astype(int) % 2], point[k[:, 0].astype(int) % 2] + 1
    yield "flat", point * [1, 0, 1], point * [1, 0, 1] + flat
    yield "infinite aspect", point * [1e300, 1, 1e-300], point * [1e300, 1, 1e-300]
    yield "neighbouring floats", 1 + k * 2.0**-52, 1 + k * 2.0**-52
    for scale in (1e-320, 1e-300, 1e-160, 1e155, 1e300, 1.7e308):
        yield f"scale {scale}", point * scale, np.minimum(point + side, 1) * scale
    far = np.where(rng.uniform(size=(n, 3)) < 0.5, -1.7e308, 1.7e308)
    yield "differences overflow", far, far
    yield "everything", np.where(rng.uniform(size=(n, 1)) < 0.5, far, -abs(far)), abs(far)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("lower", "upper"), [a[1:] for a in adversaries()], ids=[a[0] for a in adversaries()]
)
def test_adversaries(lower, upper, method):
    nodes, references = bvh.build(lower, upper, method)
    check(lower, upper, nodes, references, method)
    centers = 0.5 * lower + 0.5 * upper
    points = np.stack([lower, centers, upper], axis=1)
    assert covered(nodes, references, points, len(lower)).all()
    cost = bvh.statistics(nodes).sah_cost
    assert 1.0 <= cost < np.inf


PLAIN = [0.0, -0.0, 1.0, 2.0, -1.0, 0.5, 1 + 2.0**-52, 3.0]
EXTREME = [*PLAIN, 5e-324, 1e-300, -1e-160, 1e160, -1e300, 1.7e308, -1.7e308]


def rows_of(values):
    row = st.lists(st.sampled_from(values), min_size=9, max_size=9)
    return st.lists(st.tuples(row, st.booleans()), min_size=1, max_size=12)


@given(rows_of(PLAIN) | rows_of(EXTREME), st.integers(1, 50))
def test_degenerate_primitives(rows, n):
    """Coincident, flat, on one line, of any magnitude; some of them no triangles but boxes."""
    corners = np.resize(np.array([r[0] for r in rows]), (n, 9))
    boxes = np.resize([r[1] for r in rows], n)
    lower, upper = bounds(corners)
    points = corners.reshape(-1, 3, 3).copy()
    points[boxes] = np.stack([lower, 0.5 * lower + 0.5 * upper, upper], axis=1)[boxes]
    corners[boxes] = np.nan
    for method in METHODS:
        nodes, references = bvh.build(lower, upper, method, corners)
        check(lower, upper, nodes, references, method)
        assert covered(nodes, references, points, n).all()


@pytest.mark.parametrize("method", BUILDERS)
@pytest.mark.parametrize("power", [-120, -3, 60])
def test_scaled_by_a_power_of_two(method, power):
    """Which is exact: the same tree, the boxes scaled."""
    corners, scale = slivers(100, 0.2), 2.0**power
    nodes, references = build(corners, method)
    scaled, same = build(corners * scale, method)
    assert np.array_equal(references, same)
    assert np.array_equal(nodes.first, scaled.first)
    assert np.array_equal(nodes.size, scaled.size)
    assert np.array_equal(nodes.boxes * scale, scaled.boxes)


# ---- spatial splits -----------------------------------------------------------------------------


def dyadic(corners, bits):
    return np.round(corners * 2.0**bits) / 2.0**bits


def points_of(corners, k, rng):
    """Points (n, k, 3) of triangles whose corners have 20 bits, without rounding."""
    w = rng.integers(0, 1024, (len(corners), k, 2))
    w = np.where((w.sum(axis=-1) > 1024)[..., None], 1024 - w, w) / 1024
    w[:, : k // 4, 0] = 0.0  # on an edge
    w[:, :3] = [[0, 0], [0, 1], [1, 0]]
    w = np.concatenate([1 - w.sum(axis=-1, keepdims=True), w], axis=-1)
    return np.einsum("nkc,ncd->nkd", w, corners.reshape(-1, 3, 3))


@pytest.mark.parametrize(
    "corners",
    [slivers(200, 0.2), strips(200), small_triangles(100, 1.0), np.tile(strips(1), (50, 1))],
    ids=["slivers", "strips", "large", "one"],
)
def test_no_point_of_a_cut_triangle_is_lost(corners):
    rng = np.random.default_rng(2)
    corners = dyadic(corners, 20)
    nodes, references = build(corners, "spatial")
    assert covered(nodes, references, points_of(corners, 500, rng), len(corners)).all()


def test_no_point_of_a_cut_box_is_lost():
    """What is no triangle; and both in one scene."""
    rng = np.random.default_rng(3)
    lower, upper = bounds(slivers(200, 0.2))
    corners = np.full((200, 9), np.nan)
    corners[::2] = strips(100)
    lower[::2], upper[::2] = bounds(corners[::2])
    nodes, references = bvh.build(lower, upper, "spatial", corners)
    check(lower, upper, nodes, references, "spatial")
    assert len(references) > 250
    w = rng.uniform(size=(200, 500, 3))
    points = np.clip(lower[:, None] + w * (upper - lower)[:, None], lower[:, None], upper[:, None])
    assert covered(nodes, references, points, 200)[1::2].all()


@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_boxes_may_be_larger_than_triangles(corner):
    """Then a part's box may hold nothing of it; and where the same holds for all, one side of a
    cut gets none."""
    rng = np.random.default_rng(8)
    corners = dyadic(corner + 0.01 * small_triangles(300, 1.0), 20)
    for reach in (np.full((300, 3), 2.0), rng.uniform(0, 1, (300, 3))):
        lower, upper = bounds(corners)
        lower, upper = np.minimum(lower, 1 - reach), np.maximum(upper, reach)
        nodes, references = bvh.build(lower, upper, "spatial", corners)
        check(lower, upper, nodes, references, "spatial")
        points = points_of(corners, 50, rng)
        assert covered(nodes, references, points, len(corners)).all()


def test_corners_are_those_of_the_primitives():
    """Given none, and given NaN, boxes are cut."""
    lower, upper = bounds(slivers(200, 0.2))
    none = bvh.build(lower, upper, "spatial")
    nan = bvh.build(lower, upper, "spatial", np.full((200, 9), np.nan))
    assert np.array_equal(none[0].boxes, nan[0].boxes)
    assert np.array_equal(none[1], nan[1])


def exact_part(corners, axis, plane):
    """The exact corners of a triangle's part where x[axis] <= plane."""
    v = [[Fraction(float(x)) for x in p] for p in corners.reshape(3, 3)]
    plane = Fraction(float(plane))
    part = [p for p in v if p[axis] <= plane]
    for p, q in ((v[0], v[1]), (v[1], v[2]), (v[2], v[0])):
        if min(p[axis], q[axis]) < plane < max(p[axis], q[axis]):
            t = (plane - p[axis]) / (q[axis] - p[axis])
            part.append([a + t * (b - a) for a, b in zip(p, q, strict=True)])
    return part


@pytest.mark.parametrize("scale", [1.0, 1e-322, 1e-310, 1e-300, 1e300, 1.7e308])
def test_cut_bounds_its_rounding(scale):
    """The exact parts are in the boxes, which are larger by no more than twice the bound."""
    rng = np.random.default_rng(4)
    parts = spatial.new_parts()
    with np.errstate(over="ignore", invalid="ignore"):
        for trial in range(300):
            v = rng.uniform(-1, 1, (1, 9))
            if trial % 3 == 1:  # small, and far from the origin
                v = 0.5 + 2.0 ** -rng.integers(2, 50) * v
            if trial % 3 == 2:  # of very different coordinates
                v *= 2.0 ** -rng.integers(0, 40, 9)
            v *= scale
            axis = int(rng.integers(3))
            low, high = v[0, axis::3].min(), v[0, axis::3].max()
            plane = low + rng.uniform() * (0.5 * high - 0.5 * low)
            box = np.concatenate([*(side[0] for side in bounds(v))])
            spatial.cut(v, 0, box, axis, plane, parts)
            for sign, found in ((1, parts.left), (-1, parts.right)):
                exact = exact_part(sign * v[0], axis, sign * plane)
                for k in range(3):
                    x = [sign * p[k] for p in exact]
                    assert found[k] <= min(x)
                    assert found[3 + k] >= max(x)
                    if scale < 1e308:  # else differences overflow, and whole edges count
                        slack = 2 * (spatial.CUT_ERROR * abs(v[0, k::3]).max() + 2.0**-1022)
                        assert found[k] >= min(x) - Fraction(slack)
                        assert found[3 + k] <= max(x) + Fraction(slack)


def test_cuts_stay_in_the_reference():
    """Cut again and again, parts only shrink, and flat triangles stay flat."""
    v = np.array([[0.1, 0.3, 0.7, 1.3, 2.9, 0.7, -0.7, 1.1, 0.7]])
    parts = spatial.new_parts()
    box = np.concatenate([*(side[0] for side in bounds(v))])
    for axis, plane in ((0, 0.2), (1, 1.0), (0, 0.0), (1, 0.7)):
        spatial.cut(v, 0, box, axis, plane, parts)
        assert (parts.left[:3] >= box[:3]).all()
        assert (parts.left[3:] <= box[3:]).all()
        assert parts.left[3 + axis] == plane
        assert parts.right[axis] == plane
        assert parts.left[2] == parts.left[5] == parts.right[2] == parts.right[5] == 0.7
        box = parts.left.copy()
    # Of the triangle nothing is left below: the part is empty, not a box turned inside out.
    spatial.cut(v, 0, box, 1, -5.0, parts)
    assert parts.left[0] == np.inf
    assert parts.left[3] == -np.inf


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
    count = 60_000
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


# ---- plain Python -------------------------------------------------------------------------------

_BUILD = """
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
import test_bvh_build as here
np.savez(sys.argv[2], **here.trees())
"""


def trees():
    """Small ones of every kind, of ordinary and of extreme sizes."""
    inputs = {
        "small": small_triangles(40),
        "slivers": slivers(40, 0.2),
        "strips": strips(40),
        "huge": 1e307 * small_triangles(30),
        "tiny": 1e-309 * small_triangles(30),
    }
    return {
        f"{name} {method} {k}": array
        for (name, corners), method in product(inputs.items(), METHODS)
        for nodes, references in [build(corners, method)]
        for k, array in enumerate((*nodes, references))
    }


def test_plain_python_makes_the_same_bits(tmp_path):
    file = tmp_path / "plain.npz"
    subprocess.run(
        [sys.executable, "-W", "error", "-c", _BUILD, str(Path(__file__).parent), str(file)],
        check=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )
    compiled, plain = trees(), dict(np.load(file))
    assert set(compiled) == set(plain)
    different = [name for name in compiled if compiled[name].tobytes() != plain[name].tobytes()]
    assert different == []


# ---- many ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("method", BUILDERS)
def test_many(method):
    for corners in (small_triangles(200_000, 0.01), slivers(50_000, 0.2), strips(50_000)):
        nodes, references = build(corners, method)
        check(*bounds(corners), nodes, references, method)
