"""The hierarchy finds what testing every primitive finds, on ordinary and on degenerate input.

F5 of the stability suites has many more scenes, and one with every kind of shape."""

import numpy as np
import pytest
from builders import cube, random_shape, unit_vectors, write_obj

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.rendering import query
from reference_rt.scene import build_hierarchies

RAYS = 20_000
KINDS = ("sphere", "rectangle", "box", "triangle")


METHODS = ("sah", "median", "spatial", "none")


def answers(scene, o, d):
    tables = rt.build_tables(scene)
    return query.intersect(tables, o, d), query.occluded(tables, o, d)


def assert_same(shapes, o, d, monkeypatch):
    """The very same hits, bit for bit, whatever leads to the shapes: also where several are met at
    the same t."""
    scene = rt.Scene(shapes=tuple(shapes))
    monkeypatch.setattr(build_hierarchies, "BVH_FROM", 10**9)
    one, shadow = answers(scene, o, d)
    assert np.array_equal(shadow, np.isfinite(one.t))
    for method in METHODS:
        other, other_shadow = answers(scene.changed(hierarchy=method), o, d)
        assert np.array_equal(shadow, other_shadow), method
        for name in vars(one):
            assert np.array_equal(getattr(one, name), getattr(other, name)), (method, name)
    return one


@pytest.mark.parametrize("offset", [2.0, 1e3])
def test_mixed_shapes(offset, monkeypatch):
    rng = np.random.default_rng(31)
    sizes = 0.15 * offset * 10 ** rng.uniform(-1, 0.3, 120)
    shapes = [random_shape(KINDS[i % 4], rng, size, offset) for i, size in enumerate(sizes)]
    o = offset * rng.uniform(-2, 2, (RAYS, 3))
    d = offset * rng.uniform(-1, 1, (RAYS, 3)) - o
    one = assert_same(shapes, o, d, monkeypatch)
    assert np.isfinite(one.t).mean() > 0.2


def test_rays_that_start_inside_and_on_things(monkeypatch):
    rng = np.random.default_rng(32)
    shapes = [random_shape(kind, rng, 1.0, 1.0) for kind in KINDS for _ in range(10)]
    o = rng.uniform(-1, 1, (RAYS, 3))
    first = assert_same(shapes, o, unit_vectors(rng, RAYS), monkeypatch)
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
    one = assert_same([mesh, *elsewhere], np.concatenate(o), np.concatenate(d), monkeypatch)
    # Two of three towards the cube; of the 5 x 5 lines through its vertices 4 x 4 count as inside.
    assert np.isfinite(one.t).sum() == len(one.t) * 16 / 25 * 2 / 3


def test_coincident_primitives(monkeypatch):
    triangle = rt.Triangle(v0=(-1, -1, 0), v1=(3, -1, 0), v2=(-1, 3, 0))
    shapes = [rt.Sphere(radius=2.0), rt.Box(), rt.Rectangle(), triangle] * 30
    o = np.array([[0, 0, 3.0], [0, 0, 0.5], [0.25, 0.25, 0.5], [3, 3, 3.0]])
    d = np.array([[0, 0, -1.0], [1.0, 0, 0], [0, 0, -1.0], [0, 0, 1.0]])
    one = assert_same(shapes, o, d, monkeypatch)
    assert one.t.tolist() == [1.0, 1.0, 0.5, np.inf]


def test_one_primitive_and_bounds_that_touch_infinity(monkeypatch):
    """Sizes near the largest float: products of extents overflow, hits do not get lost."""
    shapes = [rt.Sphere(radius=1e100, center=(0, 0, k * 1e101)) for k in range(20)]
    o, d = np.array([[0, 0, -1e102]]), np.array([[0, 0, 1.0]])
    one = assert_same(shapes, o, d, monkeypatch)
    assert one.shape[0] == 0
    lone, _ = answers(
        rt.Scene(shapes=(rt.Sphere(),), hierarchy="sah"), [[0, 0, 3.0]], [[0, 0, -1.0]]
    )
    assert lone.t[0] == 2.0
