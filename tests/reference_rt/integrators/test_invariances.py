"""Scenes that are described differently and must look the same: to the last bit, or to stated
roundings."""

import math
import threading

import numpy as np
import pytest
from builders import U
from PIL import Image

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.core.exr import write_exr
from reference_rt.rendering.executor import Prepared
from reference_rt.rendering.units import Unit

GREY = 0.25
"""A reflectance that float32 files, and products with 1, hold exactly."""


MAX_DEPTH = 4


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A ball on a floor under a lamp; beside it lie images of one colour."""
    folder = tmp_path_factory.mktemp("same")
    write_exr(folder / "flat.exr", {c: np.full((3, 4), GREY) for c in "RGB"}, {})
    Image.new("RGB", (2, 2), (255, 255, 255)).save(folder / "white.png")
    (folder / "scene.yaml").write_text("{}")
    down, up = (
        transform.Rotate(rotate=transform.Turn(axis=(1, 0, 0), degrees=s * 90)) for s in (1, -1)
    )
    low = (transform.Scale(scale=4), up, transform.Translate(translate=(0, -1, 0)))
    high = (down, transform.Translate(translate=(0.5, 3, 0)))
    return rt.Scene.load(folder / "scene.yaml").changed(
        camera=rt.Perspective(eye=(0, 1, 6), fov=45),
        film=rt.Film(width=16, height=12),
        sampler=rt.Sobol(spp=4, seed=2),
        integrator=rt.Path(max_depth=MAX_DEPTH),
        textures={
            "checks": rt.Checker(first=(GREY,) * 3, second=(GREY,) * 3, uv={"scale": 7.0}),
            "flat": rt.Bitmap(file="flat.exr", filter="nearest", uv={"rotate": 30.0}),
            "smooth": rt.Bitmap(file="flat.exr"),
            "white": rt.Bitmap(file="white.png"),
        },
        materials={
            "plain": rt.Diffuse(reflectance=(GREY,) * 3),
            "checks": rt.Diffuse(reflectance="checks"),
            "flat": rt.Diffuse(reflectance="flat"),
            "smooth": rt.Diffuse(reflectance="smooth"),
            "whole": rt.Mask(base="plain", opacity=1.0),
            "opaque": rt.Mask(base="plain", opacity="white"),
            "sides": rt.TwoSided(base="plain"),
            "red": rt.Diffuse(reflectance=(0.9, 0.1, 0.1)),
            "first": rt.Blend(first="plain", second="red", weight=0.0),
            "lamp": rt.Emissive(radiance=(4.0, 3.0, 2.0)),
        },
        shapes=(
            rt.Rectangle(material="plain", transform=low),
            rt.Sphere(material="plain"),
            rt.Rectangle(material="lamp", transform=high),
        ),
        lights=(rt.Point(position=(-2, 3, 2), intensity=(5, 6, 7)),),
    )


def of_material(scene, name, **parts):
    """The scene with another material in place of `plain`."""
    shapes = [s.model_copy(update={"material": name}) for s in scene.shapes[:2]]
    return scene.changed(shapes=(*shapes, *scene.shapes[2:]), **parts)


WHITTED = {"integrator": rt.Whitted(), "sampler": rt.Grid(spp=4)}


@pytest.fixture(scope="module")
def plain(scene):
    """The picture, path-traced and by Whitted."""
    return rt.render(scene).colour, rt.render(scene.changed(**WHITTED)).colour


@pytest.mark.parametrize("name", ["checks", "flat", "smooth", "whole", "opaque", "sides", "first"])
def test_other_words_for_the_same_material(scene, plain, name):
    """Textures of one colour, masks that let nothing pass, two sides of which one is seen, a blend
    of one.

    What does not sample, Whitted, does the very same operations; so do paths, but for a blend and a
    mask, whose samples are weighed by value / density: at most 8 roundings a bounce.
    """
    paths, whitted = plain
    assert paths.any()
    assert whitted.any()
    other = of_material(scene, name)
    assert np.array_equal(rt.render(other.changed(**WHITTED)).colour, whitted)
    found = rt.render(other).colour
    if name in ("whole", "opaque", "first"):
        assert np.allclose(found, paths, rtol=MAX_DEPTH * 8 * U, atol=0)
    else:
        assert np.array_equal(found, paths)


@pytest.mark.parametrize("k", [-40, 11])
def test_all_light_times_a_power_of_two(scene, plain, k):
    """The picture times that: nothing has a scale of its own."""
    factor = 2.0**k
    lamp = rt.Emissive(radiance=tuple(factor * x for x in scene.materials["lamp"].radiance))
    (point,) = scene.lights
    point = rt.Point(position=point.position, intensity=tuple(factor * x for x in point.intensity))
    other = scene.changed(materials=scene.materials | {"lamp": lamp}, lights=(point,))
    paths, whitted = plain
    assert np.array_equal(rt.render(other).colour, factor * paths)
    assert np.array_equal(rt.render(other.changed(**WHITTED)).colour, factor * whitted)


@pytest.mark.slow
def test_nine_lights_in_one_place():
    """Picked by a tree, they are one of nine times the intensity: k_d I cos / r² without noise."""
    light = rt.Point(position=(1, 2, 2), intensity=(9, 18, 36))
    scene = rt.Scene(
        camera=rt.Orthographic(eye=(0, 0, 1e-3), width=1e-9),
        film=rt.Film(width=4, height=4),
        integrator=rt.Direct(bsdf_samples=0),
        shapes=(rt.Rectangle(),),
        lights=(light,) * 9,
    )
    assert scene.tables.lights.tree is not None
    expected = 9 * np.array([9, 18, 36]) * 0.5 / math.pi * (2 / 3) / 9
    # The view is 1e-9 wide around the origin.
    assert np.allclose(rt.render(scene).colour, expected, rtol=1e-8)


@pytest.mark.parametrize(("n", "m"), [(2, 1), (3, 70), (70, 3)])
def test_rays_that_wait_change_no_bits(scene, n, m):
    """`direct` traces rays of many samples together, in blocks of 64: the picture is that of one
    sample at a time."""
    film = rt.Film(width=8, height=6)
    scene = scene.changed(film=film, integrator=rt.Direct(light_samples=n, bsdf_samples=m))
    together, prepared = rt.render(scene).colour, Prepared(scene, threads=1)
    colour = np.zeros((48, 3))
    for pixel in range(48):
        for k in range(4):
            unit, sums = Unit(pixel, pixel + 1, k, k + 1), {"colour": colour[pixel : pixel + 1]}
            prepared.compute(unit, sums, 64, threading.Event())
    assert together.any()
    assert np.array_equal(together.reshape(48, 3), colour / 4)


def test_direct_light_is_that_of_paths_of_two_edges(scene, monkeypatch):
    """With one sample of each kind, to the last bit: `direct` may be rendered as such paths."""
    scene = scene.changed(integrator=rt.Direct())
    as_paths = rt.render(scene).colour
    monkeypatch.setattr(rt.Direct, "as_path", lambda direct: None)
    assert as_paths.any()
    assert np.array_equal(rt.render(scene).colour, as_paths)
