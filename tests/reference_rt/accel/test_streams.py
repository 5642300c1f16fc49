"""Stream traversal of a hierarchy finds what each ray finds alone, to the last bit."""

import math

import numpy as np
import pytest
from builders import cube, icosphere, same_in_plain_python, unit_vectors, write_obj

import reference_rt as rt
from reference_rt.accel.block_query import any_hits, closest_hits
from reference_rt.accel.geometry import closest_hit, occluded
from reference_rt.core.ray import BLOCK, Ray
from reference_rt.core.ray_block import (
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    HitBlock,
    RayBlock,
    hit_of,
)
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering import query
from reference_rt.scene import build_hierarchies

COLUMNS = 6


@entry_kernel
def _alone(geometry, numbers, n, found, blocked):
    for j in range(n):
        o = Vec3(numbers[j], numbers[BLOCK + j], numbers[2 * BLOCK + j])
        d = Vec3(numbers[3 * BLOCK + j], numbers[4 * BLOCK + j], numbers[5 * BLOCK + j])
        ray = Ray(o, d, numbers[6 * BLOCK + j])
        hit = closest_hit(geometry, ray)
        found[j, 0], found[j, 1], found[j, 2] = hit.t, hit.u, hit.v
        found[j, 3], found[j, 4], found[j, 5] = hit.kind, hit.row, hit.instance
        blocked[j] = occluded(geometry, ray)


@entry_kernel
def _together(geometry, numbers, n, hits, found, blocked):
    closest_hits(geometry, RayBlock(numbers), hits, n)
    for j in range(n):
        hit = hit_of(hits, j)
        found[j, 0], found[j, 1], found[j, 2] = hit.t, hit.u, hit.v
        found[j, 3], found[j, 4], found[j, 5] = hit.kind, hit.row, hit.instance
    any_hits(geometry, RayBlock(numbers), hits, n)
    for j in range(n):
        blocked[j] = hits.codes[j] >= 0


def block(o, d, t_max):
    """As `streams.RayBlock`; what nobody asks for is NaN."""
    numbers = np.full(RAY_FLOATS, np.nan)
    numbers.reshape(7, BLOCK)[:, : len(o)] = [*o.T, *d.T, t_max]
    return numbers


def assert_same(tables, o, d, t_max):
    """In blocks of all sizes; the share of rays that meet something."""
    geometry = tables.geometry
    assert geometry.bvh is not None
    hits = HitBlock(np.empty(HIT_FLOATS), np.empty(HIT_INTEGERS, np.int64))
    begin, met, rng = 0, 0, np.random.default_rng(1)
    while begin < len(o):
        n = min(int(rng.integers(1, BLOCK + 1)), len(o) - begin)
        k = slice(begin, begin + n)
        begin += n
        numbers = block(o[k], d[k], t_max[k])
        one, all_ = np.empty((2, n, COLUMNS))
        one_blocked, all_blocked = np.empty((2, n), bool)
        _alone(geometry, numbers, n, one, one_blocked)
        _together(geometry, numbers, n, hits, all_, all_blocked)
        assert one.tobytes() == all_.tobytes()
        assert np.array_equal(one_blocked, all_blocked)
        assert np.array_equal(one_blocked, one[:, 3] >= 0)
        met += int(one_blocked.sum())
    return met / len(o)


def rays(rng, n):
    """From outside and from within, along axes too, and where zeros have either sign."""
    o, d = rng.uniform(-1.5, 1.5, (n, 3)), unit_vectors(rng, n)
    along = rng.random(n) < 0.2
    d[along] = np.concatenate([np.eye(3), -np.eye(3)])[rng.integers(0, 6, along.sum())]
    whole = rng.random(n) < 0.2
    o[whole] = np.round(o[whole])
    d *= 2.0 ** rng.integers(-3, 4, (n, 1))
    return o, d, rng.choice([math.inf, 1.0, 0.3], n)


def mesh(folder, of):
    return rt.Mesh(file=str(write_obj(folder / "mesh.obj", *of)))


@pytest.mark.parametrize("of", [icosphere(4), cube(7)])
def test_meshes(of, tmp_path):
    tables = rt.build_tables(rt.Scene(shapes=(mesh(tmp_path, of),)))
    assert 0.1 < assert_same(tables, *rays(np.random.default_rng(2), 30_000)) < 0.9


def test_through_vertices_and_edges(tmp_path):
    """Several triangles are met at the same t."""
    vertices, faces = icosphere(4)
    tables = rt.build_tables(rt.Scene(shapes=(mesh(tmp_path, (vertices, faces)),)))
    rng = np.random.default_rng(3)
    o, _, _ = rays(rng, 20_000)
    corners = vertices[faces[rng.integers(0, len(faces), len(o))]]
    share = rng.integers(0, 3, (len(o), 1)) / 2.0
    d = corners[:, 0] * share + corners[:, 1] * (1.0 - share) - o
    # What ends at the point itself as well.
    assert assert_same(tables, o, d, rng.choice([math.inf, 1.0], len(o))) > 0.5


def test_shapes_solids_and_a_plane(tmp_path, monkeypatch):
    """The plane has no finite box: a second root."""
    monkeypatch.setattr(build_hierarchies, "BVH_FROM", 1)
    others = (
        rt.Sphere(center=(0.9, 0.2, 0.1), radius=0.4),
        rt.Difference(of=(rt.Sphere(center=(-0.8, 0.5, 0.3), radius=0.5), rt.Sphere(radius=0.7))),
        rt.Plane(transform=({"translate": (0.0, 0.0, -0.9)},)),
    )
    tables = rt.build_tables(rt.Scene(shapes=(mesh(tmp_path, icosphere(2)), *others)))
    assert tables.geometry.bvh.unbounded >= 0
    assert assert_same(tables, *rays(np.random.default_rng(4), 20_000)) > 0.2


def test_instances(tmp_path):
    """They are asked one by one."""
    scene = rt.Scene(
        groups={"two": (mesh(tmp_path, icosphere(2)), rt.Sphere(radius=0.3))},
        shapes=tuple(
            rt.Instance(group="two", transform=({"scale": 0.5}, {"translate": (x, 0.1, 0.2)}))
            for x in (-0.7, 0.6)
        ),
    )
    tables = rt.build_tables(scene)
    assert tables.geometry.instances is not None
    assert assert_same(tables, *rays(np.random.default_rng(5), 5_000)) > 0.05


@pytest.mark.parametrize("ratio", [0.5, 0.9])
def test_deep_trees(ratio):
    """Each sphere is a share of the one before: the trees are as deep as trees become."""
    rng = np.random.default_rng(6)
    sizes = ratio ** np.arange(600.0 if ratio == 0.9 else 300.0)
    shapes = tuple(rt.Sphere(center=(x, 0.5 * x, -x), radius=0.2 * x) for x in sizes.tolist())
    tables = rt.build_tables(rt.Scene(shapes=shapes))
    o, _, t_max = rays(rng, 6_000)
    to = rng.choice(sizes, len(o))[:, None] * np.array([1.0, 0.5, -1.0])
    o *= rng.choice(sizes, len(o))[:, None]
    assert assert_same(tables, o, to * (1.0 + 0.1 * unit_vectors(rng, len(o))) - o, t_max) > 0.3


def test_what_lies_on_arrays_of_rays(tmp_path):
    """Rays that are none, long and short ones: `query` against one ray at a time."""
    tables = rt.build_tables(rt.Scene(shapes=(mesh(tmp_path, icosphere(3)),)))
    rng = np.random.default_rng(7)
    o, d, t_max = rays(rng, 5_000)
    expected = query.occluded(tables, o, d, t_max)
    one_by_one = [query.occluded(tables, o[i], d[i], t_max[i]) for i in ([k] for k in range(300))]
    assert np.array_equal(expected[:300], np.concatenate(one_by_one))
    assert 0.1 < expected.mean() < 0.9
    with pytest.raises(ValueError, match=r"that broadcast to one, got .* t_max \(7,\)"):
        query.occluded(tables, o, d, t_max[:7])
    length = 2.0 ** rng.integers(-90, 90, len(o))
    scaled = query.occluded(tables, o, d * length[:, None], t_max / length)
    assert np.array_equal(scaled, expected)
    spoiled = rng.random(len(o)) < 0.3
    d[spoiled, rng.integers(0, 3, spoiled.sum())] = math.nan
    d[::97] = 0.0
    spoiled[::97] = True
    assert np.array_equal(query.occluded(tables, o, d, t_max), expected & ~spoiled)


def write_hits(folder, file):
    tables = rt.build_tables(rt.Scene(shapes=(mesh(folder, icosphere(2)),)))
    numbers = block(*rays(np.random.default_rng(8), 40))
    hits = HitBlock(np.empty(HIT_FLOATS), np.empty(HIT_INTEGERS, np.int64))
    found, blocked = np.empty((40, COLUMNS)), np.empty(40, bool)
    with np.errstate(all="ignore"):
        _together(tables.geometry, numbers, 40, hits, found, blocked)
    np.savez(file, found=found, blocked=blocked)


def test_plain_python_gives_the_same_bits(tmp_path):
    compiled = same_in_plain_python(write_hits, tmp_path)
    assert 5 < compiled["blocked"].sum() < 35
