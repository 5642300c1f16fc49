"""Every way to what a ray hits finds the same, to the last bit: one ray alone, blocks of rays and
packets, by brute force and by every hierarchy."""

import math
from unittest import mock

import numpy as np
import pytest
from builders import SCENES as FILES
from builders import cube, icosphere, random_shape, unit_vectors

import reference_rt as rt
from reference_rt.accel.array_query import rows_width
from reference_rt.accel.block_query import any_hits, closest_hits
from reference_rt.accel.geometry import closest_hit, occluded
from reference_rt.accel.packet import PACKET_SIZE, SPAN_FLOATS, TILE, packet_of
from reference_rt.accel.packet_traversal import enter_packet
from reference_rt.accel.single_ray import enter, slab_ray_of
from reference_rt.core import transform
from reference_rt.core.ray import (
    BLOCK,
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    HitBlock,
    Ray,
    RayBlock,
    hit_of,
    put_ray,
)
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel, local_floats
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.rendering import query
from reference_rt.rendering.accumulation import jobs_of
from reference_rt.rendering.kept_links import link_to_geometry
from reference_rt.rendering.kernels import kernels_for
from reference_rt.rendering.query import hits, tracing
from reference_rt.scene import build_hierarchies

KINDS = ("sphere", "rectangle", "box", "triangle")
METHODS = ("brute force", "none", "sah", "median", "spatial")
TREES = METHODS[2:]
INSIDE = rt.Difference(of=(rt.Sphere(center=(-0.8, 0.5, 0.3), radius=0.5), rt.Sphere(radius=0.7)))
FLOOR = rt.Plane(transform=({"translate": (0.0, 0.0, -0.9)},))


# ---- the law ------------------------------------------------------------------------------------


@entry_kernel
def _alone(geometry, o, d, t_max, found, blocked):
    for j in range(len(o)):
        ray = Ray(row(o, j), row(d, j), t_max[j])
        hit = closest_hit(geometry, ray)
        found[j, 0], found[j, 1], found[j, 2] = hit.t, hit.u, hit.v
        found[j, 3], found[j, 4], found[j, 5] = hit.kind, hit.row, hit.instance
        blocked[j] = occluded(geometry, ray)


@entry_kernel
def _in_blocks(geometry, o, d, t_max, sizes, numbers, codes, found, blocked):
    """In blocks of the given sizes."""
    rays, met = RayBlock(numbers[:RAY_FLOATS]), HitBlock(numbers[RAY_FLOATS:], codes)
    begin = 0
    for n in sizes:
        for j in range(n):
            put_ray(rays, j, Ray(row(o, begin + j), row(d, begin + j), t_max[begin + j]))
        closest_hits(geometry, rays, met, n)
        for j in range(n):
            hit, i = hit_of(met, j), begin + j
            found[i, 0], found[i, 1], found[i, 2] = hit.t, hit.u, hit.v
            found[i, 3], found[i, 4], found[i, 5] = hit.kind, hit.row, hit.instance
        any_hits(geometry, rays, met, n)
        for j in range(n):
            blocked[begin + j] = met.codes[j] >= 0
        begin += n


def hits_of(found, blocked):
    """Misses as -1: what stands there means nothing."""
    assert np.array_equal(blocked, found[:, 3] >= 0)
    found[~blocked] = -1.0
    return found


def alone(geometry, o, d, t_max):
    found, blocked = np.empty((len(o), 6)), np.empty(len(o), bool)
    with np.errstate(all="ignore"):
        _alone(geometry, o, d, t_max, found, blocked)
    return hits_of(found, blocked)


def in_blocks(geometry, o, d, t_max):
    sizes = np.random.default_rng(1).integers(1, BLOCK + 1, len(o))
    sizes = sizes[: np.searchsorted(np.cumsum(sizes), len(o), side="right")]
    sizes = np.append(sizes, len(o) - sizes.sum())
    numbers, codes = np.full(RAY_FLOATS + HIT_FLOATS, np.nan), np.empty(HIT_INTEGERS, np.int64)
    found, blocked = np.empty((len(o), 6)), np.empty(len(o), bool)
    with np.errstate(all="ignore"):
        _in_blocks(geometry, o, d, t_max, sizes, numbers, codes, found, blocked)
    return hits_of(found, blocked)


def tables_of(scene, methods):
    for method in methods:
        with mock.patch.object(build_hierarchies, "BVH_FROM", 10**9):
            hierarchy = "auto" if method == "brute force" else method
            yield method, rt.build_tables(scene.changed(hierarchy=hierarchy))


def same_by_every_way(scene, o, d, t_max=None, methods=METHODS):
    """Bit for bit, also where several shapes are met at the same t.  The hits."""
    t_max = np.full(len(o), math.inf) if t_max is None else t_max
    expected, shadows = None, None
    for method, tables in tables_of(scene, methods):
        for few in (10**9, 0):  # one by one; packets and blocks
            with mock.patch.object(tracing, "FEW", few), mock.patch.object(hits, "FEW", few):
                found = query.intersect(tables, o, d)
                expected = expected or found
                for name, column in vars(expected).items():
                    assert column.tobytes() == getattr(found, name).tobytes(), (method, few, name)
                dark = query.occluded(tables, o, d, t_max)
                shadows = dark if shadows is None else shadows
                assert np.array_equal(dark, shadows), (method, few)
        if np.isfinite(o).all() and np.isfinite(d).all() and d.any(axis=1).all():
            one = link_to_geometry(tables, "closest_hit", "occluded").tables
            many = link_to_geometry(tables, "closest_hits", "any_hits").tables
            found = alone(one, o, d, t_max)
            assert in_blocks(many, o, d, t_max).tobytes() == found.tobytes(), method
    return expected


# ---- rays ---------------------------------------------------------------------------------------


def rays(rng, n=4_000):
    """From outside and from within, along axes too, and where zeros have either sign."""
    o, d = rng.uniform(-1.5, 1.5, (n, 3)), unit_vectors(rng, n)
    along = rng.random(n) < 0.2
    d[along] = np.concatenate([np.eye(3), -np.eye(3)])[rng.integers(0, 6, along.sum())]
    whole = rng.random(n) < 0.2
    o[whole] = np.round(o[whole])
    d *= 2.0 ** rng.integers(-3, 4, (n, 1))
    return o, d, rng.choice([math.inf, 1.0, 0.3], n)


def cones(rng, count, aims, width, apart=0.0):
    """`count` packets: each from around a point outside, towards one of `aims` and around it."""
    o = np.repeat(3.0 * unit_vectors(rng, count), PACKET_SIZE, axis=0)
    aim = np.repeat(aims[rng.integers(0, len(aims), count)], PACKET_SIZE, axis=0)
    o += apart * rng.uniform(-1, 1, o.shape)
    return o, aim + width * rng.uniform(-1, 1, o.shape) - o


@entry_kernel
def _go_together(bvh, o, d, together):
    span = local_floats(SPAN_FLOATS)
    for i in range(len(together)):
        together[i] = packet_of(bvh, o, d, i * PACKET_SIZE, TILE, span).is_coherent


def share_together(scene, o, d):
    """The share of packets that are coherent."""
    together = np.zeros(len(o) // PACKET_SIZE, bool)
    with np.errstate(all="ignore"):
        _go_together(scene.tables.geometry.bvh, o, d, together)
    return together.mean()


# ---- scenes -------------------------------------------------------------------------------------


def mesh(of):
    return rt.Mesh(vertices=of[0], faces=of[1])


def mixed(offset):
    rng = np.random.default_rng(31)
    sizes = 0.15 * offset * 10 ** rng.uniform(-1, 0.3, 120)
    return [random_shape(KINDS[i % 4], rng, size, offset) for i, size in enumerate(sizes)]


def thrice(kinds):
    """Three of each kind somewhere around the origin, two of which coincide."""
    rng, found = np.random.default_rng(71), []
    for kind in kinds:
        of = rt.Disk if kind == "disk" else None
        for _ in range(2):
            placed = random_shape(kind, rng, 0.8, 1.0) if of is None else of()
            found.append(placed)
        found.append(found[-1])
    return found


SCENES = {
    "two kinds": thrice(["rectangle", "box"]),
    "spheres": thrice(["sphere"]),
    "five kinds": [*thrice(["sphere", "rectangle", "disk"]), rt.Cylinder(z_min=0.25),
                   rt.Polygon(rings=[[(-1, -1, 0.25), (0.5, -1, 0.25), (0, 1, 0.25)]])],
    "a ball of triangles": [mesh(icosphere(3))],
    "a cube of triangles": [mesh(cube(7))],
    "solids and a plane": [mesh(icosphere(2)), rt.Sphere(center=(0.9, 0.2, 0.1), radius=0.4),
                           INSIDE, FLOOR],
}  # fmt: skip


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", SCENES)
def test_scenes(name):
    scene = rt.Scene(shapes=tuple(SCENES[name]))
    found = same_by_every_way(scene, *rays(np.random.default_rng(2)))
    assert 0.1 < found.hit.mean() < 0.99


@pytest.mark.slow
def test_instances():
    """Without a hierarchy there are none."""
    group = mesh(icosphere(2)), rt.Sphere(radius=0.3)
    steps = [({"scale": 0.5}, {"translate": (x, 0.1, 0.2)}) for x in (-0.7, 0.6)]
    copies = tuple(rt.Instance(group="two", transform=step) for step in steps)
    scene = rt.Scene(groups={"two": group}, shapes=copies)
    found = same_by_every_way(scene, *rays(np.random.default_rng(5)), TREES)
    assert found.hit.mean() > 0.05


@pytest.mark.cases(1)
@pytest.mark.parametrize("offset", [2.0, 1e3])
def test_from_anywhere_inside_and_on_things(offset):
    rng = np.random.default_rng(32)
    scene = rt.Scene(shapes=tuple(mixed(offset)))
    o = offset * rng.uniform(-2, 2, (2000, 3))
    first = same_by_every_way(scene, o, offset * rng.uniform(-1, 1, (2000, 3)) - o)
    assert first.hit.mean() > 0.2
    same_by_every_way(scene, first.p, unit_vectors(rng, 2000))


@pytest.mark.parametrize("of", [icosphere(4), cube(7)], ids=["ball", "cube"])
def test_coherent_rays(of):
    """Packets, also through vertices and edges, where several triangles are met at the same t."""
    vertices, faces = of
    scene, rng, n = rt.Scene(shapes=(mesh(of),), hierarchy="sah"), np.random.default_rng(5), 300
    for width, apart in ((0.02, 0.0), (0.1, 0.0), (0.2, 0.0), (0.02, 0.05)):
        o, d = cones(rng, n, rng.uniform(-1.8, 1.8, (n, 3)), width, apart)
        assert share_together(scene, o, d) > 0.5
        assert 0.2 < same_by_every_way(scene, o, d, methods=TREES).hit.mean() < 0.95
    corners = vertices[faces]
    o, _ = cones(rng, n, corners[:, 0], 0.0)
    face = np.repeat(rng.integers(0, len(faces), n), PACKET_SIZE)
    share = rng.integers(0, 3, (len(o), 1)) / 2.0
    one, other = (corners[face, rng.integers(0, 3, len(o))] for _ in range(2))
    d = one * share + other * (1.0 - share) - o
    assert share_together(scene, o, d) > 0.3
    # What ends at the point itself as well; others pass by outlines.
    ends = rng.choice([math.inf, 1.0], len(o))
    assert same_by_every_way(scene, o, d, ends, TREES).hit.mean() > 0.9


@entry_kernel
def _width(o, d):
    return rows_width(o, d)


def test_pictures_are_traced_in_tiles():
    """Rays in the order of pixels, beginning within a row, and more of them than whole tiles."""
    scene = rt.Scene(shapes=(mesh(icosphere(3)),), hierarchy="sah")
    y, x = np.meshgrid(np.linspace(-1, 1, 100), np.linspace(-1, 1, 72), indexing="ij")
    flat = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    behind = np.broadcast_to([0.0, 0.0, -4.0], flat.shape)
    for o, d in ((behind, flat - behind), (flat + behind, -behind)):
        o, d = np.ascontiguousarray(o)[30:-5], np.ascontiguousarray(d)[30:-5]
        assert _width(o, d) == 72
        assert _width(o[:400], d[:400]) == TILE  # too few rows for it to pay
        assert 0.5 < same_by_every_way(scene, o, d, methods=["sah"]).hit.mean() < 0.9
    o, d = unit_vectors(np.random.default_rng(4), 20_000).reshape(2, -1, 3)
    assert _width(o, d) == TILE
    odd = flat.reshape(100, 72, 3)[:, :70].reshape(-1, 3)
    assert _width(0.0 * odd, odd + np.array([0.0, 0.0, 4.0])) == TILE


@pytest.mark.parametrize("axis", range(3))
def test_parallel_rays_along_axes(axis):
    """Zeros of either sign in d, and planes of boxes that contain rays."""
    scene, rng = rt.Scene(shapes=(mesh(cube(8)),), hierarchy="sah"), np.random.default_rng(7)
    at = np.linspace(-1.25, 1.25, 41)
    for sign in (1.0, -1.0):
        o = np.stack(np.meshgrid(at, at[:32], indexing="ij"), axis=-1).reshape(-1, 2)
        o = np.insert(o, axis, -2.0 * sign, axis=1)
        d = np.where(rng.random(o.shape) < 0.5, 0.0, -0.0)
        d[:, axis] = sign
        assert share_together(scene, o, d) > 0.9
        assert 0.3 < same_by_every_way(scene, o, d, methods=TREES).hit.mean() < 0.9


def test_rays_in_the_planes_of_nodes():
    """A flat-boxed mesh, rays along its axes at the coordinates of its vertices, both zeros."""
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
    scene = rt.Scene(shapes=(mesh(cube(4)), *elsewhere))
    one = same_by_every_way(scene, np.concatenate(o), np.concatenate(d))
    # Two of three towards the cube; of the 5 x 5 lines through its vertices 4 x 4 count as inside.
    assert one.hit.sum() == len(one.t) * 16 / 25 * 2 / 3


SPOILED = [0.0, -0.0, math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, 1e-200]


def test_rays_that_do_not_belong():
    """Single numbers of single rays are something else, whole rays are, or all are very long."""
    scene, rng, n = rt.Scene(shapes=(mesh(icosphere(3)),)), np.random.default_rng(8), 1000
    o, d = cones(rng, n, rng.uniform(-1, 1, (n, 3)), 0.05)
    together = share_together(scene, o, d)
    for vectors in (o, d):
        k = rng.integers(0, len(o), n // 3)
        vectors[k, rng.integers(0, 3, len(k))] = rng.choice(SPOILED, len(k))
    k = rng.integers(0, len(d), n // 8)
    d[k] = unit_vectors(rng, len(k))
    d[rng.integers(0, len(d), n // 20)] = 0.0
    length = np.repeat(2.0 ** rng.integers(-80, 80, n), PACKET_SIZE)
    with np.errstate(all="ignore"):
        d *= length[:, None]
    assert 0.1 < share_together(scene, o, d) < together - 0.2
    same_by_every_way(scene, o, d, methods=TREES)
    for m in (0, 1, PACKET_SIZE - 1, PACKET_SIZE + 1, 3 * PACKET_SIZE + 5):
        same_by_every_way(scene, o[:m], d[:m])
    o, d = 2.0 * unit_vectors(rng, 8000), unit_vectors(rng, 8000)  # which go alone
    assert share_together(scene, o, d) == 0.0
    same_by_every_way(scene, o, d, methods=TREES)


@pytest.mark.cases(1)
@pytest.mark.parametrize("ratio", [0.5, 0.9])
def test_deep_trees(ratio):
    """Each sphere is a share of the one before: the trees are as deep as trees become."""
    rng = np.random.default_rng(6)
    sizes = ratio ** np.arange(600.0 if ratio == 0.9 else 300.0)
    shapes = tuple(rt.Sphere(center=(x, 0.5 * x, -x), radius=0.2 * x) for x in sizes.tolist())
    o, _, t_max = rays(rng, 1500)
    to = rng.choice(sizes, len(o))[:, None] * np.array([1.0, 0.5, -1.0])
    o *= rng.choice(sizes, len(o))[:, None]
    d = to * (1.0 + 0.1 * unit_vectors(rng, len(o))) - o
    assert same_by_every_way(rt.Scene(shapes=shapes), o, d, t_max).hit.mean() > 0.3


def test_coincident_primitives():
    triangle = rt.Triangle(v0=(-1, -1, 0), v1=(3, -1, 0), v2=(-1, 3, 0))
    scene = rt.Scene(shapes=(rt.Sphere(radius=2.0), rt.Box(), rt.Rectangle(), triangle) * 30)
    o = np.array([[0, 0, 3.0], [0, 0, 0.5], [0.25, 0.25, 0.5], [3, 3, 3.0]])
    d = np.array([[0, 0, -1.0], [1.0, 0, 0], [0, 0, -1.0], [0, 0, 1.0]])
    assert same_by_every_way(scene, o, d).t.tolist() == [1.0, 1.0, 0.5, np.inf]


def test_one_primitive_and_bounds_that_touch_infinity():
    """Sizes near the largest float: products of extents overflow, hits do not get lost."""
    balls = tuple(rt.Sphere(radius=1e100, center=(0, 0, k * 1e101)) for k in range(20))
    o, d = np.array([[0, 0, -1e102]]), np.array([[0, 0, 1.0]])
    assert same_by_every_way(rt.Scene(shapes=balls), o, d).shape[0] == 0
    lone = rt.Scene(shapes=(rt.Sphere(),))
    assert same_by_every_way(lone, np.array([[0, 0, 3.0]]), -d).t[0] == 2.0


# ---- beneath the law ----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two kinds", "spheres", "five kinds"])
def test_brute_force_of_tables_without_links(name):
    """Rays side by side against one shape, and one ray against shapes side by side."""
    geometry = rt.build_tables(rt.Scene(shapes=tuple(SCENES[name]))).geometry
    assert geometry.bvh is None
    some = rays(np.random.default_rng(71), 12_000)
    found = alone(geometry, *some)
    assert in_blocks(geometry, *some).tobytes() == found.tobytes()
    assert (found[:, 3] >= 0).sum() > 300


@entry_kernel
def _entered(bvh, o, d, together, for_all, for_each, distances):
    """The children of each node that a packet enters, and those that its rays enter."""
    span, own = local_floats(SPAN_FLOATS), local_floats(VECTOR_WIDTH)
    packet = packet_of(bvh, o, d, 0, TILE, span)
    together[0] = packet.is_coherent
    for node in range(len(for_all)):
        for_all[node] = enter_packet(bvh, node, packet, math.inf, own)
        for lane in range(VECTOR_WIDTH):
            distances[node, 0, lane] = own[lane]
        for j in range(PACKET_SIZE):
            view = slab_ray_of(bvh, 0, Ray(row(o, j), row(d, j), math.inf))
            for_each[node, j] = enter(bvh, node, view, math.inf, own)
            for lane in range(VECTOR_WIDTH):
                distances[node, 1 + j, lane] = own[lane]


@pytest.mark.slow
def test_a_packet_enters_what_its_rays_enter():
    bvh = rt.build_tables(rt.Scene(shapes=(mesh(icosphere(4)),))).geometry.bvh
    rng, nodes = np.random.default_rng(11), len(bvh.boxes)
    for width in (0.0, 0.02, 0.1):
        packets, entered, needed = 0, 0, 0
        for _ in range(60):
            o, d = cones(rng, 1, rng.uniform(-1, 1, (1, 3)), width, width)
            together, for_all = np.zeros(1, bool), np.zeros(nodes, np.int64)
            for_each = np.zeros((nodes, PACKET_SIZE), np.int64)
            distances = np.zeros((nodes, 1 + PACKET_SIZE, VECTOR_WIDTH))
            with np.errstate(all="ignore"):
                _entered(bvh, o, d, together, for_all, for_each, distances)
            if not together[0]:
                continue
            packets += 1
            any_ray = np.bitwise_or.reduce(for_each, axis=1)
            assert (any_ray & ~for_all == 0).all()
            by_lane = for_each[:, :, None] >> np.arange(VECTOR_WIDTH) & 1 == 1
            nearer = distances[:, :1] <= distances[:, 1:]
            assert nearer[by_lane].all()
            entered += sum(int(bits).bit_count() for bits in for_all)
            needed += sum(int(bits).bit_count() for bits in any_ray)
        assert packets > 20
        # Intervals forget which origin and which direction belong together.
        assert entered <= (1.2 if width == 0.0 else 5.0) * needed


@pytest.mark.parametrize("spp", [1, 16, 37])
def test_paths_together_are_paths_one_by_one(spp):
    """Blocks of samples, whole and in part, beyond the dimensions that are drawn in blocks."""
    lit = rt.Scene.load(FILES / "cornell_box.yaml")
    lit = lit.changed(
        film=lit.film.model_copy(update={"width": 12, "height": 9}),
        sampler=rt.Sobol(spp=spp, seed=3),
        integrator=rt.Path(rr_depth=12),
    )
    jobs, total = jobs_of(lit), np.zeros((12 * 9, 3))
    view, film_filter = lit.camera.setup(12, 9), lit.film.filter.setup()
    (kernel, *_) = kernels_for(jobs, lit.tables, view, film_filter, 1)
    for pixel in range(12 * 9):
        for sample in range(spp):
            kernel({"colour": total[pixel : pixel + 1]}, pixel, pixel + 1, sample, sample + 1)
    assert np.array_equal(rt.render(lit).colour, total.reshape(9, 12, 3) / spp)


@pytest.mark.parametrize("hierarchy", ["sah", "median"])
def test_a_ray_through_each_triangle_of_twenty_thousand(hierarchy):
    """None is lost on any way, where short rays through the middles meet no other one."""
    ball = icosphere(5)
    corners = ball[0][ball[1]]
    middle = corners.mean(axis=1)
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1)[:, None]
    o, d, t_max = middle + 1e-4 * n, -n, np.full(len(n), 2e-4)
    tables = rt.build_tables(rt.Scene(shapes=(mesh(ball),), hierarchy=hierarchy))
    found = alone(link_to_geometry(tables, "closest_hit", "occluded").tables, o, d, t_max)
    many = link_to_geometry(tables, "closest_hits", "any_hits").tables
    assert in_blocks(many, o, d, t_max).tobytes() == found.tobytes()
    assert (found[:, 3] >= 0).all()
    assert len(np.unique(found[:, 4])) == len(o) == 20_480
    np.testing.assert_allclose(found[:, 0], 1e-4, rtol=1e-9)
