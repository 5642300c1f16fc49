"""BVH builders: no primitive is lost and no tree too deep, whatever the input."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from bvh_checks import (
    BUILDERS,
    METHODS,
    bounds,
    build,
    check,
    covered,
    slivers,
    small_triangles,
    strips,
)
from hypothesis import given
from hypothesis import strategies as st

from reference_rt.accel import bvh
from reference_rt.accel.bvh import spatial, top_down

# ---- any input ----------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_random_triangles(method):
    for n, size in product((1, 2, 3, 4, 5, 9, 64, 1000), (0.0, 0.05, 2.0)):
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
def test_adversaries(method):
    for name, lower, upper in adversaries():
        nodes, references = bvh.build(lower, upper, method)
        check(lower, upper, nodes, references, method)
        points = np.stack([lower, 0.5 * lower + 0.5 * upper, upper], axis=1)
        assert covered(nodes, references, points, len(lower)).all(), name
        assert 1.0 <= bvh.statistics(nodes).sah_cost < np.inf, name


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


def test_scaled_by_a_power_of_two():
    """Which is exact: the same tree, the boxes scaled."""
    corners = slivers(100, 0.2)
    for method, power in product(BUILDERS, (-120, -3, 60)):
        nodes, references = build(corners, method)
        scaled, same = build(corners * 2.0**power, method)
        assert np.array_equal(references, same)
        assert np.array_equal(nodes.first, scaled.first)
        assert np.array_equal(nodes.size, scaled.size)
        assert np.array_equal(nodes.boxes * 2.0**power, scaled.boxes)


def test_subtrees_apart_are_the_same_tree(monkeypatch):
    """What threads build, split by split and subtree by subtree, is what one call builds, but for
    the order of the nodes."""
    corners = small_triangles(3000)
    whole, references = build(corners, "sah")
    monkeypatch.setattr(top_down, "APART", 100)
    nodes, same = build(corners, "sah")
    check(*bounds(corners), nodes, same, "sah")
    assert np.array_equal(references, same)
    assert not np.array_equal(whole.first, nodes.first)
    rows = [
        sorted(
            zip(
                tree.boxes.tolist(), np.where(tree.size > 0, tree.first, -1), tree.size, strict=True
            )
        )
        for tree in (whole, nodes)
    ]
    assert rows[0] == rows[1]


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


def test_no_point_of_a_cut_triangle_is_lost():
    rng, one = np.random.default_rng(2), np.tile(strips(1), (50, 1))
    for corners in (slivers(200, 0.2), strips(200), small_triangles(100, 1.0), one):
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
        for trial in range(150):
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


# ---- many ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("method", BUILDERS)
def test_many(method):
    for corners in (small_triangles(200_000, 0.01), slivers(50_000, 0.2), strips(50_000)):
        nodes, references = build(corners, method)
        check(*bounds(corners), nodes, references, method)
