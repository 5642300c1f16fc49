"""Lamps that also reflect, under arbitrary affine maps: rounding does not make a lamp light itself.

A shading point of a lamp lies on the lamp, but for rounding.  Seen from a point that rounding has
lifted above its plane, a flat lamp would fill half of the sphere of directions.
"""

import math

import numpy as np
import pytest
from builders import cube, random_turn, unit_vectors, write_obj

import reference_rt as rt
from reference_rt import shapes as any_shape
from reference_rt.core.transform import Matrix, compose
from reference_rt.core.vec3 import Vec3
from reference_rt.lights.emitters import point as point_light
from reference_rt.lights.emitters import projector as projector_light
from reference_rt.lights.emitters import spot as spot_light
from reference_rt.rendering import query
from reference_rt.shapes import TABLES

MATERIALS = {
    "grey": rt.Diffuse(reflectance=(0.5, 0.5, 0.5)),
    "lamp": rt.Emissive(radiance=(5.0, 4.0, 3.0), base="grey"),
}
KINDS = ("sphere", "rectangle", "box", "triangle", "disk", "mesh")
"""Of all shapes that light samples find; `test_kinds_are_all` holds that."""


def random_map(rng, similar, size, offset):
    """(3, 4): rotated, sheared in two of three cases unless `similar`, mirrored every other time;
    of this size, `offset` sizes away from the origin."""
    left, right = (random_turn(rng) for _ in range(2))
    stretch = np.ones(3) if similar or rng.random() < 1 / 3 else 10.0 ** rng.uniform(-1, 0, 3)
    mirrored = rng.choice([-1.0, 1.0])
    linear = size * mirrored * (left * np.linalg.det(left)) @ np.diag(stretch)
    linear = linear @ (right * np.linalg.det(right))
    return np.column_stack([linear, unit_vectors(rng, 1)[0] * size * offset])


def lamp(kind, m, mesh):
    parts = {"material": "lamp", "transform": (Matrix(matrix=tuple(map(tuple, m.tolist()))),)}
    if kind == "triangle":
        return rt.Triangle(v0=(-1.0, -1.0, 0.0), v1=(1.0, -1.0, 0.0), v2=(0.0, 1.0, 0.0), **parts)
    if kind == "mesh":
        return rt.Mesh(file=mesh, **parts)
    types = {"sphere": rt.Sphere, "rectangle": rt.Rectangle, "box": rt.Box, "disk": rt.Disk}
    return types[kind](**parts)


def test_kinds_are_all():
    """Whoever lets light samples find another shape adds it to `KINDS`."""
    sampled = {table.__name__ for _, _, table, module in TABLES if hasattr(module, "sample")}
    assert sampled == {"Spheres", "Rectangles", "Boxes", "Triangles", "Disks"}
    assert len(KINDS) == len(sampled) + 1  # a mesh is made of triangles
    assert all(hasattr(module, "pdf") for _, _, _, module in TABLES if hasattr(module, "sample"))


@pytest.mark.parametrize("count", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_no_convex_lamp_lights_itself(tmp_path, count):
    """What a ray meets of a lamp, as a receiver of that lamp, under so many maps: of a mesh, of its
    single triangles.

    All shapes are convex: nothing arrives, and nothing is other than finite.
    """
    rng = np.random.default_rng(1701)
    mesh = write_obj(tmp_path / "cube.obj", *cube(1)).name
    kinds = np.tile(KINDS, count)
    sizes, offsets = 10.0 ** rng.uniform(-3, 3, len(kinds)), 10.0 ** rng.uniform(0, 8, len(kinds))
    maps = [
        random_map(rng, *parts) for parts in zip(kinds == "sphere", sizes, offsets, strict=True)
    ]
    shapes = [lamp(kind, m, mesh) for kind, m in zip(kinds, maps, strict=True)]
    scene = rt.Scene(materials=MATERIALS, shapes=tuple(shapes))
    scene._folder = tmp_path
    tables = rt.build_tables(scene)
    lights_of = lights_by_shape(tables, len(shapes))
    seen, rays = 0, 6
    for i, m in enumerate(maps):
        o = m[:, 3] + unit_vectors(rng, rays) * 2.0 * sizes[i]
        d = m[:, 3] + rng.uniform(-0.3, 0.3, (rays, 2)) @ m[:, :2].T - o
        met = query.intersect(tables, o, d).shape == i
        seen += np.count_nonzero(met)
        for light in lights_of[i]:
            for u in ((0.5, 0.5), tuple(rng.uniform(size=2))):
                found = query.direct_light(tables, o[met], d[met], light, u)
                assert np.isfinite(found.target).all(), (i, kinds[i])
                assert np.isfinite(found.pdf).all(), (i, kinds[i])
                # A cube's other triangle of the same face is seen edge-on, from as far above its
                # plane as positions round, which is 1e-8 sizes 1e8 sizes away.
                # Measured: 1.2e-8, next to an edge.
                most = 1e-7 if kinds[i] == "mesh" else 0.0
                assert found.contribution.max(initial=0.0) <= most, (i, kinds[i])
                assert kinds[i] == "mesh" or not found.pdf.any(), (i, kinds[i])
    assert seen > 0.8 * rays * len(kinds)  # large lamps near the origin hide small ones


def lights_by_shape(tables, count):
    """The entries of the light choice that belong to each shape."""
    lights = [[] for _ in range(count)]
    areas = tables.lights.areas
    for k, (code, row) in enumerate(zip(areas.kind, areas.row, strict=True)):
        lights[any_shape.owner(tables.geometry.shapes, code, row)].append(k)
    return lights


FLOOR = np.column_stack([np.diag([6.0, 6.0, 1.0]), np.zeros(3)])
CORNER = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 1], [0, 0, 1]]
"""Two squares at a right angle, which light each other: their vertices."""


def world(folder, floor, maps, whole):
    """A floor, a lamp of each of KINDS and a concave one, under these maps and then `whole`."""
    write_obj(folder / "cube.obj", *cube(1))
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1], [0, 5, 4]])
    write_obj(folder / "corner.obj", np.array(CORNER) - 0.5, faces)
    kinds, meshes = (*KINDS, "mesh"), ("cube.obj",) * len(KINDS) + ("corner.obj",)
    grey = rt.Rectangle(
        material="grey", transform=(Matrix(matrix=tuple(map(tuple, compose(floor, whole)))),)
    )
    lamps = [
        lamp(kind, compose(m, whole), mesh)
        for kind, m, mesh in zip(kinds, maps, meshes, strict=True)
    ]
    eye, target = (whole[:, :3] @ v + whole[:, 3] for v in ((0.0, -6.0, 4.0), (0.0, 0.0, 0.6)))
    scene = rt.Scene(
        materials=MATERIALS,
        shapes=(grey, *lamps),
        camera=rt.Perspective(
            eye=tuple(eye), target=tuple(target), up=tuple(whole[:, 2]), fov=50.0
        ),
        film=rt.Film(width=48, height=36, layers=("variance",)),
    )
    scene._folder = folder
    return scene


def rendered(scene, sampling, seed):
    picture = rt.render(
        scene.changed(
            integrator=rt.Path(max_depth=3, sampling=sampling),
            sampler=rt.Independent(spp=128, seed=seed),
        )
    )
    assert picture.nonfinite == 0
    return picture


def tiles(layer):
    """The means of 12 x 12 pixels, in each channel."""
    return layer.reshape(3, 12, 4, 12, 3).mean(axis=(1, 3))


SEEDS = [*range(6), *(pytest.param(k, marks=pytest.mark.slow) for k in range(6, 60))]


@pytest.mark.cases(4)
@pytest.mark.parametrize("seed", SEEDS)
def test_means_are_those_of_scattered_rays_alone(tmp_path, seed):
    """All is under one more map: a similarity of a size of 1e-3 to 1e3, up to 1e6 sizes away."""
    rng = np.random.default_rng([1702, seed])
    whole = random_map(rng, True, 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(0, 6))
    maps = [random_map(rng, kind == "sphere", 0.5, 0.0) for kind in (*KINDS, "mesh")]
    for k, m in enumerate(maps):
        m[:, 3] = 2.0 * math.cos(0.9 * k), 2.0 * math.sin(0.9 * k), 1.0
    scene = world(tmp_path, FLOOR, maps, whole)
    both, alone = (rendered(scene, how, 2 * seed + k) for k, how in enumerate(("both", "bsdf")))
    variance = sum(tiles(p.layers["variance"]) / 144 for p in (both, alone))
    z = (tiles(both.colour) - tiles(alone.colour)) / np.sqrt(variance)
    # Normal to within what 18,432 paths a tile leave: 60 pictures of 36 numbers pass 5 once in 800.
    assert np.abs(z).max() < 5.0
    assert both.colour.mean() > 0.1


@pytest.mark.cases(2)
@pytest.mark.parametrize("seed", range(4))
def test_a_lamp_in_the_plane_of_a_floor_does_not_light_it(tmp_path, seed):
    """Of two surfaces in one plane rounding decides which is met; neither sees the other.

    The floor is 1,000 times as large as the lamps.
    """
    rng = np.random.default_rng([1703, seed])
    whole = random_map(rng, True, 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(0, 2))
    floor = np.column_stack([np.diag([1000.0, 1000.0, 1.0]), rng.uniform(-500, 500, 3) * (1, 1, 0)])
    below = {"sphere": -3.0, "box": -1.0, "mesh": -1.0}
    maps = [
        np.column_stack([np.eye(3), ((k % 3) * 2.2 - 2.2, (k // 3) * 2.2, below.get(kind, 0.0))])
        for k, kind in enumerate((*KINDS, "mesh"))
    ]
    maps[-1][2, 3] = -3.0  # the concave one is out of sight
    scene = world(tmp_path, floor, maps, whole)
    both, alone = (rendered(scene, how, seed) for how in ("both", "bsdf"))
    # The same numbers, and nothing but what the camera meets: lamps, or the floor, which is black,
    # but for a lamp seen edge-on: two cosines of what rounding is over its distance, and a solid
    # angle that is as small (measured: 3e-32).
    assert np.allclose(both.colour, alone.colour, rtol=0.0, atol=1e-30)
    assert 0.0 < both.colour.mean() < 5.0


def test_lights_without_size_at_the_very_point():
    """No direction leads to them."""
    p = Vec3(0.1, 0.2, 0.3)
    spot = rt.Spot(origin=p, target=(0.0, 0.0, 0.0), intensity=(1.0, 1.0, 1.0))
    projector = rt.Projector(origin=p, target=(0.0, 0.0, 0.0), irradiance=(1.0, 1.0, 1.0))
    point = rt.Point(position=p, intensity=(1.0, 1.0, 1.0))
    samples = (
        point_light.sample(point.tabulate(), 0, p),
        spot_light.sample(spot.tabulate(), 0, None, p),
        projector_light.sample(projector.tabulate(), 0, None, p),
    )
    for found in samples:
        assert found.pdf == 0.0
        assert found.wi == (0.0, 0.0, 0.0)
