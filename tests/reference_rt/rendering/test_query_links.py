"""Queries through links: the bits of plain Python, which links nothing, for every kind of scene;
one compiled kernel for all of them; links that last as long as the query."""

import contextlib
import dataclasses
import gc
import weakref
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import numpy as np
import pytest
from builders import SCENES, cube, same_in_plain_python, unit_vectors, write_obj
from galleries import every_shape, tilted

import reference_rt as rt
from reference_rt.rendering.kept_links import link_to_geometry
from reference_rt.rendering.query import bsdf, direct_light, hits, light, tracing
from reference_rt.rendering.query.crossings import solid_crossings
from reference_rt.rendering.query.radiance import cast_kernel
from reference_rt.scene.examples import NAMED

FEW = rt.Scene(shapes=(rt.Sphere(radius=0.7), rt.Box(), rt.Torus(), rt.Cylinder(radius=0.9)))
SOLID = rt.Scene(
    shapes=(rt.Difference(of=(rt.Box(), rt.Sphere(radius=1.2))), rt.Sphere(radius=0.3))
)
N = 24
"""Rays: the last 16 are a packet."""

GROUPS = NAMED["groups"]
PLACED = rt.Scene(shapes=(rt.Instance(group="group"), rt.Sphere(radius=0.2)), groups=GROUPS)


def everything(folder):
    """Every kind of shape, a mesh, a solid and instances."""
    rng = np.random.default_rng(1)
    shapes = [
        shape.model_copy(update={"transform": tilted(rng, k, k % 2 == 0)})
        for k, shape in enumerate(every_shape(0))
    ]
    mesh = rt.Mesh(file=str(write_obj(folder / "cube.obj", *cube(3))))
    return rt.Scene(shapes=(*shapes, mesh), groups=GROUPS)


def traced(scene, o, d):
    """What all queries of rays find, by name."""
    near, far = np.linspace(0.0, 1.2, len(o)), np.linspace(0.9, 1.6, len(o))
    return {
        "intersect": scene.intersect(o, d),
        "beyond": scene.intersect(o, d, t_min=near, t_max=far),
        "first_hits": scene.first_hits(o, d),
        "crossings": scene.crossings(o, d),
        "occluded": scene.occluded(o, d),
        "between": scene.occluded(o, d, t_max=far, t_min=near),
    }


@contextlib.contextmanager
def many_from(n):
    """More than n rays are many."""
    with mock.patch.object(tracing, "FEW", n), mock.patch.object(hits, "FEW", n):
        yield


def arrays_of(found):
    """Arrays, and those of dataclasses, by name."""
    arrays = {}
    for name, value in found.items():
        if not isinstance(value, np.ndarray):
            arrays |= {f"{name}.{key}": part for key, part in dataclasses.asdict(value).items()}
        else:
            arrays[name] = value
    return arrays


def write_traced(folder, file):
    rng = np.random.default_rng(2)
    found = {}
    whole = everything(folder)
    for number, scene in enumerate((FEW, SOLID, PLACED, whole)):
        o = 6.0 * unit_vectors(rng, N)
        d = rng.uniform(-0.8, 0.8, (N, 3)) - o
        if scene is whole:
            o, d = o + np.array([4.0, 4.0, 0.0]), 2.0 * d
        d[-16:] = -o[-1]  # a packet of coherent rays, most of which hit
        o[-16:] = o[-1] + 0.01 * unit_vectors(rng, 16)
        for n in (0,) if scene is whole else (N, 0):
            with many_from(n):
                for name, value in traced(scene, o, d).items():
                    found[f"{number} {n} {name}"] = value
        if scene.tables.geometry.solids is not None:
            found[f"{number} solid"] = solid_crossings(scene.tables, 0, o, d)
    np.savez(file, **arrays_of(found))


@pytest.mark.slow
def test_rays_find_what_they_find_in_plain_python(tmp_path):
    compiled = same_in_plain_python(write_traced, tmp_path)
    for number in range(4):
        assert (compiled[f"{number} 0 intersect.shape"] >= 0).sum() > 8
        for name in ("intersect.t", "intersect.ns", "intersect.uv", "beyond.t", "occluded"):
            if number < 3:  # of the last one few rays would take plain Python seconds
                few, many = (compiled[f"{number} {n} {name}"] for n in (N, 0))
                assert few.tobytes() == many.tobytes()
    assert (compiled["1 solid.count"] > 0).any()


BUMPY = rt.Scene(
    textures={"waves": rt.Checker(first=(0.2, 0.2, 0.2), second=(0.9, 0.9, 0.9))},
    materials={
        "floor": rt.Bump(base="brushed", height="waves", scale=0.1),
        # Not rough plastic, whose tables take plain Python ten seconds.
        "brushed": rt.RoughConductor(eta=0.2, k=3.0, alpha=(0.1, 0.4), reflectance="waves"),
    },
    shapes=(rt.Rectangle(material="floor", transform=({"scale": 5.0},)),),
    lights=(rt.Point(position=(1.0, 1.0, 2.0), intensity=1.0), rt.Constant(radiance=0.5)),
)


def write_scattered(_folder, file):
    """Of scenes with all lights, textures, nested and anisotropic materials."""
    rng = np.random.default_rng(3)
    found = {}
    names = "material_blend material_mask material_normal_map light_shapes light_spot environment"
    scenes = {name: rt.Scene.load(SCENES / f"{name}.yaml") for name in names.split()}
    for label, scene in {**scenes, "bumpy": BUMPY}.items():
        wo, wi, u = unit_vectors(rng, 8), unit_vectors(rng, 8), rng.random((8, 3))
        at = {"uv": rng.random((8, 2)), "dpdu": wo[::-1].copy(), "dpdv": wi[::-1].copy()}
        for name in scene.materials:
            one = scene.bsdf(name)
            found[f"{label} {name} value"] = one.evaluate(wo, wi, **at)
            found[f"{label} {name} sample"] = one.sample(wo, u, **at)
        o, d = scene.camera_rays(np.stack(np.meshgrid(*2 * [np.arange(5, 60, 18)]), -1))
        seen = scene.intersect(o, d)
        found[f"{label} samples"] = scene.sample_lights(seen.p, rng.random(3), seen.ns)
        found[f"{label} density"] = scene.light_pdf(o, d)
        found[f"{label} direct"] = direct_light(scene.tables, o[2], d[2], 0)
        found[f"{label} colour"] = scene.radiance(o, d, integrator=rt.RayCast()).mean
    np.savez(file, **arrays_of(found))


@pytest.mark.slow
def test_materials_and_lights_are_those_of_plain_python(tmp_path):
    compiled = same_in_plain_python(write_scattered, tmp_path)
    found = {name for name in compiled.files if compiled[name].any()}
    for label in (name.removesuffix(" density") for name in compiled.files if "density" in name):
        assert {f"{label} samples.pdf", f"{label} colour"} <= found, label
    for kind, least in (("value", 10), ("sample.pdf", 10), ("density", 3), ("contribution", 3)):
        assert sum(name.endswith(kind) for name in found) >= least, kind


KERNELS = (
    tracing.closest,
    tracing.closest_of_few,
    tracing.cross,
    tracing.describe,
    hits.occluded_by_blocks,
    hits.occluded_of_few,
    bsdf.scatter_kernel,
    light.sample_kernel,
    light.pdf_kernel,
    light.direct_kernel,
    cast_kernel,
)


def test_all_scenes_have_the_same_kernels():
    o, d = np.array([[0.1, 0.2, 6.0]]), np.array([[0.0, 0.0, -1.0]])
    lamp = rt.Point(position=(0.0, 0.0, 4.0), intensity=1.0)
    plain = rt.Scene(shapes=(rt.Sphere(),), lights=(lamp,))
    for scene in (plain, rt.Scene.load(SCENES / "textured_room.yaml")):
        for n in (1, 0):
            with many_from(n):
                traced(scene, o, d)
        scene.sample_lights(o, [0.5, 0.5, 0.5])
        scene.light_pdf(o, d)
        direct_light(scene.tables, o, d, 0)
        scene.radiance(o, d, integrator=rt.RayCast())
        scene.bsdf(next(iter(scene.materials), None)).evaluate(-d, -d)
    for kernel in KERNELS:
        # By their first argument; other arguments may be arrays or empty.
        assert len({signature[0] for signature in kernel.signatures}) == 1, kernel


def test_links_of_a_scene_are_made_once():
    """And are gone with its tables."""
    scene = rt.Scene(shapes=(rt.Sphere(), rt.Box()))
    one = link_to_geometry(scene.tables, "closest_hit")
    assert link_to_geometry(scene.tables, "closest_hit") is one
    assert link_to_geometry(scene.tables, "occluded") is not one
    gone = weakref.ref(one)
    del scene, one
    gc.collect()
    assert gone() is None


def test_links_last_as_long_as_the_query():
    """Though the scene is gone."""
    scene = rt.Scene(shapes=(rt.Sphere(radius=0.5), rt.Box()))
    o, d = np.array([[0.0, 0.0, 3.0]]), np.array([[0.0, 0.0, -1.0]])
    traced_later = tracing.FirstHits(scene.tables, 1, surfaces=True)
    del scene
    gc.collect()
    taken = [np.full(n, -1) for n in range(1, 500)]  # the memory of links that are no more
    out = tracing.empty_hits(1, surfaces=True)
    traced_later.trace(o, d, None, tracing.NO_LIMIT, out)
    assert out.t[0] == 2.0
    assert out.shape[0] == 1
    assert len(taken) == 499


def test_threads_that_query_many_scenes():
    scenes = [rt.Scene(shapes=(rt.Sphere(radius=(k + 1) / 16),)) for k in range(12)]
    o, d = (np.tile([0.0, 0.0, z], (500, 1)) for z in (3.0, -1.0))

    def query(k):
        return scenes[k % 12].intersect(o, d, threads=1).t

    with ThreadPoolExecutor(6) as pool:
        for k, t in enumerate(pool.map(query, range(96))):
            assert (t == 3.0 - scenes[k % 12].shapes[0].radius).all(), k
