"""All crossings along rays, and hits beyond t_min, of every kind of shape."""

import numpy as np
import pytest
from builders import U, cube, unit_vectors, write_obj
from galleries import every_shape, tilted

import reference_rt as rt
from comparisons.geometry.exact.dyadic import Dyadic, nearest
from comparisons.referee.referee import crossings_of
from comparisons.referee.sizes import ShapeSizes
from reference_rt.core.transform import affine
from reference_rt.scene.examples import NAMED, write_files
from reference_rt.shapes.csg import Solid

CUBE = np.array([-3.0, -4.0, 0.0])
"""Where a mesh is whose edges and vertices rays are aimed at."""

EACH = 16
"""Rays that are aimed at each shape."""

FIELDS = ("t", "shape", "primitive", "part", "instance", "p", "n", "ns", "uv")


@pytest.fixture(scope="module")
def forms(tmp_path_factory):
    """The scene, and the middle of each of its shapes."""
    rng = np.random.default_rng(3)
    folder = tmp_path_factory.mktemp("shapes")
    write_files(folder)
    made = [*every_shape(0), *every_shape(-1)]
    steps = [tilted(rng, k, k >= len(made) // 2) for k in range(len(made))]
    shapes = [
        shape.model_copy(update={"transform": step})
        for shape, step in zip(made, steps, strict=True)
    ]
    cube_file = write_obj(folder / "cube.obj", *cube(3))
    shapes.append(rt.Mesh(file=str(cube_file), transform=({"translate": tuple(CUBE.tolist())},)))
    # Of a map that keeps angles a sphere stays one.
    shapes.append(rt.Sphere(radius=0.8, center=(-2.5, 0.0, 0.0)))
    middles = [*(affine(step)[:, 3] for step in steps), CUBE, [-2.5, 0.0, 0.0]]
    scene = rt.Scene(shapes=tuple(shapes), groups=NAMED["groups"])
    scene._folder = folder
    return scene, np.array(middles)


@pytest.fixture(scope="module")
def rays(forms):
    rng = np.random.default_rng(42)  # a seed with which at least two rays hit each shape
    aims = np.repeat(forms[1], EACH, axis=0)
    aims = aims + 0.4 * rng.normal(size=aims.shape)
    o = aims + 8.0 * unit_vectors(rng, len(aims))
    return o, (aims - o) * rng.uniform(0.02, 3.0, (len(aims), 1))


def test_every_shape_is_crossed_where_exact_arithmetic_says(forms, rays):
    """But for solids, whose crossings are those that repeated first hits find."""
    scene, (o, d) = forms[0], rays
    found, sizes = scene.crossings(o, d), ShapeSizes(scene)
    expected = []
    for copy in sizes.copies:
        inverse = np.linalg.inv(copy.outer[:, :3])
        local = (o - copy.outer[:, 3]) @ inverse.T, d @ inverse.T
        for leaf in sizes.leaves_of(copy):
            lists, _ = crossings_of(leaf, local, tuple(map(Dyadic.of, local)))
            for k, ray in enumerate(lists):
                expected += [(copy.shape, k, t) for t, _, _ in ray if t > 0]
    solids = [k for k, shape in enumerate(scene.shapes) if isinstance(shape, Solid)]
    shape, ray = (np.array([row[k] for row in expected]) for k in (0, 1))
    t = nearest(np.array([row[2] for row in expected], object))
    mine, of = ~np.isin(found.shape, solids), ~np.isin(shape, solids)
    there = np.lexsort((found.t[mine], found.ray[mine], found.shape[mine]))
    here = np.lexsort((t[of], ray[of], shape[of]))
    assert np.array_equal(found.shape[mine][there], shape[of][here])
    assert np.array_equal(found.ray[mine][there], ray[of][here])
    np.testing.assert_allclose(found.t[mine][there], t[of][here], rtol=1e-9)
    assert set(range(len(scene.shapes))) == {*shape.tolist()}
    assert np.unique(len(o) * shape + ray, return_counts=True)[1].max() >= 4
    # Points are put back onto their surface, from where the rounding of o + t d has left them.
    points = o[found.ray] + found.t[:, None] * d[found.ray]
    assert np.abs(found.p - points).max() < 256 * U * np.abs(o).max()


def test_crossings_are_what_repeated_first_hits_beyond_the_last_find(forms, rays):
    """To the last bit, and the first is the hit itself; t_max ends both alike."""
    scene, _ = forms
    o, d = rays
    found = scene.crossings(o, d)
    assert (np.diff(found.t)[np.diff(found.ray) == 0] >= 0.0).all()
    assert np.array_equal(found.count, np.bincount(found.ray, minlength=len(o)))
    t_min, expected = np.zeros(len(o)), found.first[:-1].copy()
    for _ in range(found.count.max() + 1):
        hits = scene.intersect(o, d, t_min=t_min)
        few = scene.first_hits(o, d, t_min=t_min)
        there = expected < found.first[1:]
        assert np.array_equal(hits.hit, there)
        for name in FIELDS:
            got, told = getattr(hits, name), getattr(found, name)
            assert got[there].tobytes() == told[expected[there]].tobytes(), name
        for name in FIELDS[:5]:
            assert getattr(few, name).tobytes() == getattr(hits, name).tobytes(), name
        assert np.array_equal(scene.occluded(o, d, t_min=t_min), there)
        assert not scene.occluded(o, d, t_min=t_min, t_max=hits.t).any()
        beyond = np.nextafter(hits.t, np.inf)
        assert np.array_equal(scene.occluded(o, d, t_min=t_min, t_max=beyond), there)
        assert not scene.intersect(o, d, t_min=t_min, t_max=hits.t).hit.any()
        assert np.array_equal(scene.intersect(o, d, t_min=t_min, t_max=beyond).t, hits.t)
        t_min = np.where(there, hits.t, t_min)
        # What coincides with it, if anything does, is not beyond it.
        while (
            again := there
            & (expected < found.first[1:])
            & (found.t[np.minimum(expected, len(found.t) - 1)] <= t_min)
        ).any():
            expected[again] += 1
    part = scene.crossings(o, d, t_min=0.5, t_max=0.9)
    inside = (found.t > 0.5) & (found.t < 0.9)
    for name in (*FIELDS, "ray"):
        assert getattr(part, name).tobytes() == getattr(found, name)[inside].tobytes(), name


def test_the_way_back_is_free(forms, rays):
    """From just before what was hit, back to the origin, nothing is in the way."""
    scene, (o, d) = forms[0], rays
    t = scene.intersect(o, d).t
    hit = np.isfinite(t)
    # A millionth short: points are off by 1e-14, which at a cosine of 1e-8 is that along the ray.
    short = t[hit] * (1.0 - 1e-6)
    p = o[hit] + d[hit] * short[:, None]
    # And a millionth short of the origin, which may lie on a surface itself.
    assert not scene.occluded(p, -d[hit], t_max=short * (1.0 - 1e-6)).any()


def test_rays_do_not_depend_on_each_other(forms, rays):
    scene, (o, d) = forms[0], rays
    order = np.random.default_rng(8).permutation(len(o))
    one, two = scene.intersect(o, d), scene.intersect(o[order], d[order])
    for name in FIELDS:
        assert getattr(one, name)[order].tobytes() == getattr(two, name).tobytes(), name


@pytest.mark.parametrize("hierarchy", ["median", "spatial", "none"])
def test_hierarchies_change_nothing(forms, rays, hierarchy):
    scene, _ = forms
    found, other = (one.crossings(*rays) for one in (scene, scene.changed(hierarchy=hierarchy)))
    for name in (*FIELDS, "ray", "first"):
        assert getattr(found, name).tobytes() == getattr(other, name).tobytes(), name


def test_threads_and_the_room_for_crossings_change_nothing(forms, rays):
    """Of many thousand rays, some with many more crossings than there is room for at first."""
    scene, _ = forms
    o, d = (np.tile(a, (8, 1)) for a in rays)
    one, two = (scene.crossings(o, d, threads=n) for n in (1, 2))
    for name in (*FIELDS, "ray", "first"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes(), name
    once = scene.crossings(*rays)
    assert np.array_equal(one.t, np.tile(once.t, 8))
    assert np.array_equal(one.count, np.tile(once.count, 8))


def test_closed_meshes_are_crossed_in_pairs(forms):
    """Through vertices and edges too, and from inside an odd number of times."""
    scene, middles = forms
    mesh = len(middles) - 2
    vertices, faces = cube(3)
    rng = np.random.default_rng(5)
    aims = np.concatenate([vertices, 0.5 * (vertices[faces[:, 0]] + vertices[faces[:, 1]])])
    aims = np.tile(aims, (8, 1)) + CUBE
    o = CUBE + 4.0 * unit_vectors(rng, len(aims))
    found = scene.crossings(o, aims - o)
    mine = found.shape == mesh
    count = np.bincount(found.ray[mine], minlength=len(o))
    assert (count % 2 == 0).all()
    assert (count > 0).mean() > 0.9
    enter = np.sum(found.n[mine] * (aims - o)[found.ray[mine]], axis=1) < 0.0
    balance = np.zeros(len(o))
    np.add.at(balance, found.ray[mine], np.where(enter, 1, -1))
    assert (balance == 0).all()
    inside = scene.crossings(rng.uniform(-0.9, 0.9, (200, 3)) + CUBE, unit_vectors(rng, 200))
    count = np.bincount(inside.ray[inside.shape == mesh], minlength=200)
    assert (count % 2 == 1).all()


FEW = rt.Scene(
    shapes=(
        rt.Disk(),
        rt.Torus(major_radius=0.7, minor_radius=0.3),
        rt.Quadric(
            coefficients=(1, 1, -1, 0, 0, 0, 0, 0, 0, -0.1), lower=(-1,) * 3, upper=(1,) * 3
        ),
    )
)


def test_a_single_ray_of_many_crossings():
    """Through a hundred walls, of which half are where another is."""
    walls = tuple(
        rt.Disk(transform=({"translate": (0.0, 0.0, -5.0 - float(k // 2))},)) for k in range(100)
    )
    scene = rt.Scene(shapes=(*walls, *FEW.shapes))
    found = scene.crossings((0.1, 0.2, -4.0), (0.0, 0.0, -0.5))
    assert np.array_equal(found.t, 2.0 + 2.0 * (np.arange(100) // 2))
    assert np.array_equal(found.shape, np.arange(100))  # the scene's order at one t
    assert found.count.tolist() == [100]
    # Of those that coincide, t_min leaves none.
    beyond = scene.crossings((0.1, 0.2, -4.0), (0.0, 0.0, -0.5), t_min=2.0, t_max=5.0)
    assert beyond.shape.tolist() == [2, 3]


def test_few_shapes_without_a_hierarchy():
    rng = np.random.default_rng(6)
    o = 3.0 * unit_vectors(rng, 300)
    d = rng.uniform(-0.8, 0.8, (300, 3)) - o
    assert FEW.tables.geometry.bvh is None
    found, other = (s.crossings(o, d) for s in (FEW, FEW.changed(hierarchy="sah")))
    for name in (*FIELDS, "ray", "first"):
        assert getattr(found, name).tobytes() == getattr(other, name).tobytes(), name
    assert set(found.shape) == {0, 1, 2}
    assert found.count.max() >= 6


def test_rays_that_are_none_cross_nothing(forms):
    bad = [[np.nan, 0, 0], [0, 0, 0], [np.inf, 0, 1]]
    found = FEW.crossings([0.0, 0.0, 3.0], bad)
    assert found.count.tolist() == [0, 0, 0]
    assert not forms[0].intersect([0.0, 0.0, 3.0], bad, t_min=1.0).hit.any()
    assert FEW.crossings(np.zeros((0, 3)), np.zeros((0, 3))).first.tolist() == [0]


@pytest.mark.parametrize("length", [2.0**-300, 1e-160, 1e100, 2.0**300])
def test_directions_of_extreme_length(length):
    o, d = np.array([0.6, 0.1, 3.0]), np.array([0.0, 0.0, -1.0])
    once, scaled = FEW.crossings(o, d), FEW.crossings(o, d * length)
    assert len(once.t) == 5
    np.testing.assert_allclose(scaled.t * length, once.t, rtol=1e-14)
    for k in range(4):
        beyond = FEW.crossings(o, d * length, t_min=scaled.t[k])
        assert np.array_equal(beyond.t, scaled.t[k + 1 :])
