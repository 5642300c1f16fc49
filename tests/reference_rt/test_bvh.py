"""The hierarchy finds what testing every primitive finds, on ordinary and on degenerate input."""

import numpy as np
import pytest
from builders import cube, random_shape, unit_vectors, write_obj

import reference_rt as rt
from reference_rt import bvh, query, tables, transform

RAYS = 20_000
KINDS = ("sphere", "rectangle", "box", "triangle")


def hits(shapes, bvh_from, o, d, monkeypatch):
    monkeypatch.setattr(tables, "BVH_FROM", bvh_from)
    built = rt.build_tables(rt.Scene(shapes=tuple(shapes)))
    assert (built.geometry.bvh is None) == (bvh_from > 1)
    return query.intersect(built, o, d), query.occluded(built, o, d)


def assert_same(shapes, o, d, monkeypatch):
    """Bit for bit the same hits with and without.  Where t is the same to the last bit on two
    shapes (they touch), either may be named: the same t is all there is to ask."""
    one, shadow_one = hits(shapes, 10**9, o, d, monkeypatch)
    tree, shadow_tree = hits(shapes, 1, o, d, monkeypatch)
    assert np.array_equal(one.t, tree.t)
    assert np.array_equal(shadow_one, shadow_tree)
    assert np.array_equal(shadow_tree, np.isfinite(tree.t))
    return one, tree


@pytest.mark.parametrize("offset", [2.0, 1e3])
def test_mixed_shapes(offset, monkeypatch):
    rng = np.random.default_rng(31)
    sizes = 0.15 * offset * 10 ** rng.uniform(-1, 0.3, 120)
    shapes = [random_shape(KINDS[i % 4], rng, size, offset) for i, size in enumerate(sizes)]
    o = offset * rng.uniform(-2, 2, (RAYS, 3))
    d = offset * rng.uniform(-1, 1, (RAYS, 3)) - o
    one, tree = assert_same(shapes, o, d, monkeypatch)
    assert np.array_equal(one.shape, tree.shape)
    for name in ("face", "p", "n", "ns", "uv"):
        assert np.array_equal(getattr(one, name), getattr(tree, name)), name
    assert np.isfinite(one.t).mean() > 0.2


def test_rays_that_start_inside_and_on_things(monkeypatch):
    rng = np.random.default_rng(32)
    shapes = [random_shape(kind, rng, 1.0, 1.0) for kind in KINDS for _ in range(10)]
    first, _ = assert_same(
        shapes, rng.uniform(-1, 1, (RAYS, 3)), unit_vectors(rng, RAYS), monkeypatch
    )
    assert_same(shapes, first.p, unit_vectors(rng, RAYS), monkeypatch)


def test_rays_in_the_planes_of_nodes(tmp_path, monkeypatch):
    """A flat-boxed mesh, rays along its axes at the coordinates of its vertices, both zeros."""
    vertices, faces = cube(4)
    mesh = rt.Mesh(file=str(write_obj(tmp_path / "cube.obj", vertices, faces)))
    ticks = np.linspace(-1, 1, 5)
    grid = np.array([(x, y) for x in ticks for y in ticks])
    o, d = [], []
    for axis in range(3):
        for side in (-3.0, 0.25, 3.0):
            for way in (-1.0, 1.0):
                for zero in (0.0, -0.0):
                    origins, direction = np.full((len(grid), 3), side), np.full(3, zero)
                    origins[:, [(axis + 1) % 3, (axis + 2) % 3]] = grid
                    direction[axis] = way
                    o.append(origins)
                    d.append(np.tile(direction, (len(grid), 1)))
    elsewhere = [random_shape(kind, np.random.default_rng(0), 1.0, 1.0) for kind in KINDS]
    away = (transform.Translate(translate=(1e3, 1e3, 1e3)),)
    elsewhere = [s.model_copy(update={"transform": (*s.transform, *away)}) for s in elsewhere]
    one, _ = assert_same([mesh, *elsewhere], np.concatenate(o), np.concatenate(d), monkeypatch)
    # Through the inner vertices of a face, from inside and from outside: one third each.
    assert np.isfinite(one.t).mean() > 0.5


def test_coincident_primitives(monkeypatch):
    triangle = rt.Triangle(v0=(-1, -1, 0), v1=(3, -1, 0), v2=(-1, 3, 0))
    shapes = [rt.Sphere(radius=2.0), rt.Box(), rt.Rectangle(), triangle] * 30
    o = np.array([[0, 0, 3.0], [0, 0, 0.5], [0.25, 0.25, 0.5], [3, 3, 3.0]])
    d = np.array([[0, 0, -1.0], [1.0, 0, 0], [0, 0, -1.0], [0, 0, 1.0]])
    one, _ = assert_same(shapes, o, d, monkeypatch)
    assert one.t.tolist() == [1.0, 1.0, 0.5, np.inf]


def depth_of(tree_first, tree_size):
    deepest, waiting = 0, [(0, 1)]
    while waiting:
        node, depth = waiting.pop()
        deepest = max(deepest, depth)
        if tree_size[node] == 0:
            waiting += [(tree_first[node], depth + 1), (tree_first[node] + 1, depth + 1)]
    return deepest


@pytest.mark.parametrize("ratio", [0.5, 0.1, 0.999])
def test_depth_of_geometric_progressions(ratio):
    """Sizes and places that shrink by a ratio make the heuristic peel one primitive at a time."""
    n = 2000
    x = np.maximum(ratio ** np.arange(n), 1e-300)[:, None] * np.ones(3)
    boxes, first, size, order = bvh.build(x, 1.5 * x)
    assert sorted(order) == list(range(n))
    assert sorted(k for f, s in zip(first, size, strict=True) for k in range(f, f + s)) == list(
        range(n)
    )
    # The traversal's stack holds one node for each level above the leaf's.
    assert depth_of(first, size) <= bvh.STACK_SIZE
    assert size.max() <= bvh.LEAF_SIZE
    for node in np.flatnonzero(size == 0):
        for child in (first[node], first[node] + 1):
            assert (boxes[node, :3] <= boxes[child, :3]).all()
            assert (boxes[node, 3:] >= boxes[child, 3:]).all()


def test_one_primitive_and_bounds_that_touch_infinity(monkeypatch):
    """Sizes near the largest float: products of extents overflow, hits do not get lost."""
    shapes = [rt.Sphere(radius=1e100, center=(0, 0, k * 1e101)) for k in range(20)]
    o, d = np.array([[0, 0, -1e102]]), np.array([[0, 0, 1.0]])
    one, _ = assert_same(shapes, o, d, monkeypatch)
    assert one.shape[0] == 0
    lone, _ = hits([rt.Sphere()], 1, [[0, 0, 3.0]], [[0, 0, -1.0]], monkeypatch)
    assert lone.t[0] == 2.0
