"""The rays of a sample: they add up to what `render` computes, and their numbers are right."""

import threading

import numpy as np
import pytest
from builders import SCENES
from galleries import gallery_of_lights, gallery_of_materials, gallery_of_shapes

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.rendering.accumulation import widths_of
from reference_rt.rendering.executor import Prepared
from reference_rt.rendering.ray_tree import ray_trees
from reference_rt.rendering.units import Unit

SMALL = rt.Film(width=6, height=4)


def shapes(folder):
    return gallery_of_shapes(folder).changed(film=SMALL)


def cornell_box(folder):
    return rt.Scene.load(SCENES / "cornell_box.yaml").changed(film=SMALL)


def fog(folder):
    """A lamp in a coloured cloud over a floor, and glass with something in it."""
    return rt.Scene(
        camera=rt.Perspective(eye=(0, 1, 5), target=(0, 0, 0), fov=40),
        film=SMALL,
        sampler=rt.Sobol(spp=4),
        media={
            "fog": rt.Homogeneous(sigma_t=(0.5, 1.0, 2.0), albedo=0.9),
            "ink": rt.Homogeneous(sigma_t=(0.5, 0.1, 2.0), albedo=0.0),
        },
        materials={
            "edge": rt.NoSurface(),
            "glass": rt.Dielectric(),
            "lamp": rt.Emissive(radiance=(9, 8, 7)),
        },
        shapes=(
            rt.Sphere(radius=1.4, material="edge", interior="fog"),
            rt.Sphere(radius=0.2, center=(0.4, 0.3, 0.5), material="lamp"),
            rt.Box(material="glass", interior="ink", exterior="fog", transform=({"scale": 0.5},)),
            rt.Rectangle(transform=({"scale": 9},)),
        ),
    )


WHITTED = {"integrator": rt.Whitted(), "sampler": rt.Grid(spp=4)}
HIDDEN = {"integrator": rt.Path(hide_emitters=True, rr_depth=1, sampling="bsdf")}
DIRECT = {"integrator": rt.Direct(light_samples=2, bsdf_samples=2)}
CASES = {
    "shapes, path": (shapes, {}),
    "shapes, ray cast": (shapes, {"integrator": rt.RayCast(), "sampler": None}),
    "shapes, whitted": (shapes, WHITTED),
    "materials, path": (gallery_of_materials, {}),
    "materials, whitted": (gallery_of_materials, WHITTED),
    "lights, path": (gallery_of_lights, {}),
    "lights, hidden lamps": (gallery_of_lights, HIDDEN),
    "lights, direct": (
        gallery_of_lights,
        {"integrator": rt.Direct(light_samples=2, bsdf_samples=2)},
    ),
    "lights, whitted": (gallery_of_lights, WHITTED),
    "cornell box, path": (cornell_box, {}),
    "cornell box, signs of a filter": (
        cornell_box,
        {"film": rt.Film(width=6, height=4, filter=rt.LanczosFilter())},
    ),
    "fog, path": (fog, {}),
    "fog, roulette at once": (fog, {"integrator": rt.Path(rr_depth=1, hide_emitters=True)}),
    "cornell box, direct": (cornell_box, {"integrator": rt.Direct(hide_emitters=True)}),
}


def rendered(prepared, x, y, sample):
    """What `render` adds to the sums of a pixel for one sample."""
    scene = prepared.scene
    pixel = scene.film.width * y + x
    sums = {name: np.zeros((1, width)) for name, width in widths_of(scene).items()}
    unit = Unit(pixel, pixel + 1, sample, sample + 1)
    done = prepared.compute(unit, sums, 64, threading.Event())
    return done.sums["colour"][0]


@pytest.mark.cases(4)
@pytest.mark.parametrize("case", CASES)
def test_a_tree_adds_up_to_the_rendered_sample(case, tmp_path):
    """Bit for bit: the traced contributions, times the filter's weight, are the sum of the sample
    that compiled kernels compute; a ray that is traced alone ends where it ended in the sample."""
    make, changes = CASES[case]
    check_sums(make(tmp_path).changed(**changes))


def test_a_light_tree_adds_up():
    """Plain Python picks the lights that compiled kernels do, where children are lanes."""
    check_sums(rt.Scene.load(SCENES / "many_lights.yaml").changed(film=SMALL))


def test_a_tree_adds_up_on_a_film_that_is_exposed():
    scene = rt.Scene.load(SCENES / "cornell_box.yaml").changed(film=SMALL)
    place = {field: getattr(scene.camera, field) for field in ("eye", "target", "up")}
    camera = rt.Pinhole(**place, hole_radius=0.1, exposure=7.0)
    check_sums(scene.changed(camera=camera))


def check_sums(scene):
    film, spp = scene.film, 1 if isinstance(scene.integrator, rt.RayCast) else 2
    places = [(x, y, (x + y) % spp) for x in (1, film.width // 2) for y in range(1, film.height, 2)]
    trees, prepared = ray_trees(scene, places), Prepared(scene, threads=1)
    for tree, place in zip(trees, places, strict=True):
        expected = rendered(prepared, *place)
        assert np.array_equal(tree["value"], expected)
        weight = tree["filter_weight"] * tree["exposure"]
        assert np.array_equal(np.multiply(tree["radiance"], weight), expected)
    rays = [ray for tree in trees for ray in tree["rays"]]
    assert any(ray["adds"] for ray in rays)
    assert len(rays) > len(places) or spp == 1


@pytest.mark.parametrize("make", [shapes, cornell_box])
def test_what_a_ray_costs_is_what_it_meets(make, tmp_path):
    """The layers of compiled kernels count the nodes and primitives that the recorder sees, with a
    hierarchy that has instances and a solid, and without one."""
    costs = "bvh_steps", "intersections"
    scene = make(tmp_path)
    film = scene.film.model_copy(update={"layers": costs})
    scene = scene.changed(film=film, integrator=rt.RayCast(), sampler=None)
    layers = rt.render(scene).layers
    places = [(x, y, 0) for x in range(1, film.width, 2) for y in range(film.height)]
    for (x, y, _), tree in zip(places, ray_trees(scene, places), strict=True):
        (ray,) = tree["rays"]
        assert [layers[name][y, x] for name in costs] == [len(ray["steps"]), ray["tests"]]
    assert layers["bvh_steps"].any() == (make is shapes)
    assert layers["intersections"].all()


def test_the_tree_of_a_glass_ball():
    """Whitted's rays through a ball on its axis: the camera ray is refracted twice, straight on,
    and each boundary mirrors (n - 1)^2 / (n + 1)^2 = 4 % of it."""
    lamp = rt.Rectangle(material="lamp", transform=(transform.Translate(translate=(0, 0, -3)),))
    scene = rt.Scene(
        camera=rt.Orthographic(eye=(0, 0, 5), width=1e-6),
        film=rt.Film(width=1, height=1),
        integrator=rt.Whitted(max_depth=2),
        sampler=rt.Grid(spp=1),
        materials={
            "glass": rt.Dielectric(interior_ior=1.5, exterior_ior=1.0),
            "lamp": rt.Emissive(radiance=(1, 1, 1)),
        },
        shapes=(rt.Sphere(material="glass"), lamp),
    )
    (tree,) = ray_trees(scene, [(0, 0, 0)])
    rays = tree["rays"]
    found = {
        (ray["kind"], ray["depth"], None if ray["hit"] is None else ray["hit"]["shape"]): ray
        for ray in rays
    }
    through = found["refracted", 2, 1]
    assert rays[through["parent"]]["kind"] == "refracted"
    assert rays[rays[through["parent"]]["parent"]]["kind"] == "camera"
    # Radiance is divided by n^2 on entering and multiplied by it on leaving: 0.96 * 0.96 is left.
    assert through["weight"] == pytest.approx([0.96**2] * 3, rel=1e-12)
    assert through["adds"] == [["emitted", through["weight"]]]
    assert found["mirrored", 1, None]["weight"] == pytest.approx([0.04] * 3, rel=1e-12)
    assert found["mirrored", 2, 0]["parent"] == rays.index(found["refracted", 1, 0])
