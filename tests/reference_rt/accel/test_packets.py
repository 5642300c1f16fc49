"""Ray packets find what each of their rays finds alone, to the last bit."""

import math

import numpy as np
import pytest
from builders import cube, icosphere, same_in_plain_python, unit_vectors, write_obj

import reference_rt as rt
from reference_rt.accel.geometry import closest_hit
from reference_rt.accel.packet import PACKET_SIZE, SPAN_FLOATS, packet_of
from reference_rt.accel.packet_traversal import enter_packet
from reference_rt.accel.single_ray import enter, slab_ray_of
from reference_rt.core.ray import Ray
from reference_rt.core.scaled_ray import is_representable, scaled
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel, local_floats
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.rendering import query
from reference_rt.scene import build_hierarchies


@entry_kernel
def _alone(geometry, o, d, t, codes, uv):
    for i in range(len(o)):
        t[i], codes[i, 0], codes[i, 1], uv[i, 0], uv[i, 1] = math.inf, -1, -1, 0.0, 0.0
        ray, unit, valid = scaled(row(o, i), row(d, i), math.inf)
        if not valid:
            continue
        hit = closest_hit(geometry, ray)
        if hit.kind < 0 or not is_representable(hit.t * unit, ray.o + ray.d * hit.t):
            continue
        t[i], codes[i, 0], codes[i, 1] = hit.t * unit, hit.kind, hit.row
        uv[i, 0], uv[i, 1] = hit.u, hit.v


@entry_kernel
def _go_together(bvh, o, d, together):
    span = local_floats(SPAN_FLOATS)
    for i in range(len(together)):
        together[i] = packet_of(bvh, o, d, i * PACKET_SIZE, span).is_coherent


@entry_kernel
def _entered(bvh, o, d, together, for_all, for_each, distances):
    """The children of each node that a bundle enters, and those that its rays enter."""
    span, own = local_floats(SPAN_FLOATS), local_floats(VECTOR_WIDTH)
    bundle = packet_of(bvh, o, d, 0, span)
    together[0] = bundle.is_coherent
    for node in range(len(for_all)):
        for_all[node] = enter_packet(bvh, node, bundle, math.inf, own)
        for lane in range(VECTOR_WIDTH):
            distances[node, 0, lane] = own[lane]
        for j in range(PACKET_SIZE):
            view = slab_ray_of(bvh, 0, Ray(row(o, j), row(d, j), math.inf))
            for_each[node, j] = enter(bvh, node, view, math.inf, own)
            for lane in range(VECTOR_WIDTH):
                distances[node, 1 + j, lane] = own[lane]


def mesh_scene(folder, mesh, *others):
    file = write_obj(folder / "mesh.obj", *mesh)
    return rt.build_tables(rt.Scene(shapes=(rt.Mesh(file=str(file)), *others)))


def cones(rng, count, aims, width, apart=0.0):
    """`count` bundles: each from around a point outside, towards one of `aims` and around it."""
    o = np.repeat(3.0 * unit_vectors(rng, count), PACKET_SIZE, axis=0)
    aim = np.repeat(aims[rng.integers(0, len(aims), count)], PACKET_SIZE, axis=0)
    o += apart * rng.uniform(-1, 1, o.shape)
    return o, aim + width * rng.uniform(-1, 1, o.shape) - o


def share_together(tables, o, d):
    together = np.zeros(len(o) // PACKET_SIZE, bool)
    _go_together(tables.geometry.bvh, o, d, together)
    return together.mean()


def assert_same(tables, o, d):
    n = len(o)
    t, codes, uv = np.empty(n), np.empty((n, 2), np.int64), np.empty((n, 2))
    with np.errstate(all="ignore"):
        _alone(tables.geometry, o, d, t, codes, uv)
    found = query.closest_primitives(tables, o, d)
    assert found.t.tobytes() == t.tobytes()
    assert np.array_equal(np.column_stack([found.kind, found.row]), codes)
    assert found.uv.tobytes() == uv.tobytes()
    return codes[:, 0] >= 0


@pytest.mark.parametrize(("mesh", "rounds"), [(icosphere(4), 1500), (cube(7), 1500)])
@pytest.mark.parametrize(("width", "apart"), [(0.02, 0.0), (0.1, 0.0), (0.2, 0.0), (0.02, 0.05)])
def test_cones_of_rays(mesh, rounds, width, apart, tmp_path):
    tables = mesh_scene(tmp_path, mesh)
    rng = np.random.default_rng(5)
    o, d = cones(rng, rounds, rng.uniform(-1.8, 1.8, (rounds, 3)), width, apart)
    assert share_together(tables, o, d) > 0.5
    assert 0.2 < assert_same(tables, o, d).mean() < 0.95


@pytest.mark.parametrize("mesh", [icosphere(4), cube(7)])
def test_rays_through_vertices_and_edges(mesh, tmp_path):
    """Several triangles are met at the same t there."""
    vertices, faces = mesh
    tables = mesh_scene(tmp_path, mesh)
    corners = vertices[faces]
    rng = np.random.default_rng(6)
    count = 1500
    o, _ = cones(rng, count, corners[:, 0], 0.0)
    face = np.repeat(rng.integers(0, len(faces), count), PACKET_SIZE)
    share = rng.integers(0, 3, (len(o), 1)) / 2.0
    of = corners[face, rng.integers(0, 3, len(o))], corners[face, rng.integers(0, 3, len(o))]
    d = of[0] * share + of[1] * (1.0 - share) - o
    assert share_together(tables, o, d) > 0.3
    assert assert_same(tables, o, d).mean() > 0.9  # others pass by outlines


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", range(3))
def test_parallel_rays_along_axes(axis, sign, tmp_path):
    """Zeros of either sign in d, and planes of boxes that contain rays."""
    tables = mesh_scene(tmp_path, cube(8))
    rng = np.random.default_rng(7)
    at = np.linspace(-1.25, 1.25, 161)
    o = np.stack(np.meshgrid(at[:160], at, indexing="ij"), axis=-1).reshape(-1, 2)
    o = np.insert(o, axis, -2.0 * sign, axis=1)
    d = np.where(rng.random(o.shape) < 0.5, 0.0, -0.0)
    d[:, axis] = sign
    assert share_together(tables, o, d) > 0.9
    assert 0.3 < assert_same(tables, o, d).mean() < 0.9


SPOILED = [0.0, -0.0, math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, 1e-200]


def test_rays_that_do_not_belong(tmp_path):
    """Single numbers of single rays are something else, whole rays are, or all are very long."""
    tables = mesh_scene(tmp_path, icosphere(3))
    rng = np.random.default_rng(8)
    o, d = cones(rng, 4000, rng.uniform(-1, 1, (4000, 3)), 0.05)
    together = share_together(tables, o, d)
    for vectors in (o, d):
        k = rng.integers(0, len(o), 1500)
        vectors[k, rng.integers(0, 3, len(k))] = rng.choice(SPOILED, len(k))
    k = rng.integers(0, len(d), 500)
    d[k] = unit_vectors(rng, len(k))
    d[rng.integers(0, len(d), 200)] = 0.0
    length = np.repeat(2.0 ** rng.integers(-80, 80, 4000), PACKET_SIZE)
    with np.errstate(all="ignore"):
        d *= length[:, None]
    assert 0.1 < share_together(tables, o, d) < together - 0.2
    assert_same(tables, o, d)
    for n in (0, 1, PACKET_SIZE - 1, PACKET_SIZE + 1, 3 * PACKET_SIZE + 5):
        assert_same(tables, o[:n], d[:n])


def test_rays_of_all_directions_go_alone(tmp_path):
    tables = mesh_scene(tmp_path, icosphere(3))
    rng = np.random.default_rng(9)
    o, d = 2.0 * unit_vectors(rng, 32_000), unit_vectors(rng, 32_000)
    assert share_together(tables, o, d) == 0.0
    assert_same(tables, o, d)


def test_other_shapes_in_the_hierarchy(tmp_path, monkeypatch):
    """Spheres and solids in leaves, and a plane, which is in none."""
    monkeypatch.setattr(build_hierarchies, "BVH_FROM", 1)
    ball = rt.Sphere(center=(0.9, 0.2, 0.1), radius=0.4)
    hollow = rt.Difference(
        of=(rt.Sphere(center=(-0.8, 0.5, 0.3), radius=0.5), rt.Sphere(radius=0.7))
    )
    floor = rt.Plane(transform=({"translate": (0.0, 0.0, -0.9)},))
    tables = mesh_scene(tmp_path, icosphere(2), ball, hollow, floor)
    rng = np.random.default_rng(10)
    o, d = cones(rng, 2000, rng.uniform(-1.2, 1.2, (2000, 3)), 0.1)
    assert share_together(tables, o, d) > 0.5
    assert_same(tables, o, d)
    assert len(set(query.closest_primitives(tables, o, d).kind)) >= 4


@pytest.mark.parametrize("width", [0.0, 0.02, 0.1])
def test_a_bundle_enters_what_its_rays_enter(width, tmp_path):
    tables = mesh_scene(tmp_path, icosphere(4))
    bvh = tables.geometry.bvh
    rng = np.random.default_rng(11)
    nodes = len(bvh.boxes)
    bundles, entered, needed = 0, 0, 0
    for _ in range(60):
        o, d = cones(rng, 1, rng.uniform(-1, 1, (1, 3)), width, width)
        together, for_all = np.zeros(1, bool), np.zeros(nodes, np.int64)
        for_each = np.zeros((nodes, PACKET_SIZE), np.int64)
        distances = np.zeros((nodes, 1 + PACKET_SIZE, VECTOR_WIDTH))
        with np.errstate(all="ignore"):
            _entered(bvh, o, d, together, for_all, for_each, distances)
        if not together[0]:
            continue
        bundles += 1
        any_ray = np.bitwise_or.reduce(for_each, axis=1)
        assert (any_ray & ~for_all == 0).all()
        by_lane = for_each[:, :, None] >> np.arange(VECTOR_WIDTH) & 1 == 1
        nearer = distances[:, :1] <= distances[:, 1:]
        assert nearer[by_lane].all()
        entered += sum(int(bits).bit_count() for bits in for_all)
        needed += sum(int(bits).bit_count() for bits in any_ray)
    assert bundles > 20
    # Intervals forget which origin and which direction belong together.
    assert entered <= (1.2 if width == 0.0 else 5.0) * needed


def write_hits(folder, file):
    tables = mesh_scene(folder, icosphere(2))
    rng = np.random.default_rng(12)
    o, d = cones(rng, 8, rng.uniform(-1, 1, (8, 3)), 0.1)
    found = query.closest_primitives(tables, o, d, threads=1)
    np.savez(file, share=share_together(tables, o, d), t=found.t, row=found.row, uv=found.uv)


def test_plain_python_gives_the_same_bits(tmp_path):
    compiled = same_in_plain_python(write_hits, tmp_path)
    assert compiled["share"] > 0.5
    assert np.isfinite(compiled["t"]).any()
