"""Shapes that shine but that no light sample finds: scattered rays do, with the same mean."""

import math

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.transform import Rotate, Scale, Translate, Turn

LAMP = {"lamp": rt.Emissive(radiance=(2.0, 3.0, 4.0)), "grey": rt.Diffuse(reflectance=(0.5,) * 3)}
FLOOR = rt.Rectangle(material="grey", transform=(Scale(scale=(20.0, 20.0, 1.0)),))
DOWN = (
    Rotate(rotate=Turn(axis=(1.0, 0.0, 0.0), degrees=180.0)),
    Translate(translate=(0.0, 0.0, 1.0)),
)
"""The plane z = 0 turned over, at height 1."""
SQUARE = (((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)),)


def seen(shapes, spp=40_000, groups=None, **path):
    """(mean, standard error) of the radiance of the floor below the middle of the light."""
    pixels = 16
    scene = rt.Scene(
        camera=rt.Perspective(eye=(3.0, 0.0, 0.5), target=(0.0, 0.0, 0.0), up=(0, 0, 1), fov=1e-6),
        film=rt.Film(width=pixels, height=1),
        sampler=rt.Independent(spp=spp // pixels),
        integrator=rt.Path(max_depth=2, **path),
        materials=LAMP,
        shapes=(FLOOR, *shapes),
        groups=groups or {},
    )
    colour = rt.render(scene).colour[0, :, 0]
    return colour.mean(), colour.std(ddof=1) / math.sqrt(pixels)


def square_irradiance(height=1.0):
    """Of the square [-1, 1]² of radiance 2 over its middle: pi times its configuration factor, four
    times that of a quarter (Howell's catalogue, B-3)."""
    a = 1.0 / height
    root = math.sqrt(1 + a * a)
    quarter = (a / root * math.atan(a / root) * 2) / (2 * math.pi)
    return math.pi * 2.0 * 4 * quarter


def lit_by(shape, **more):
    return (shape.model_copy(update={"material": "lamp", "transform": DOWN}),), more


CASES = {
    "sampled": lit_by(rt.Rectangle()),
    "polygon": lit_by(rt.Polygon(rings=SQUARE)),
    "group": (
        (rt.Instance(group="g", transform=DOWN),),
        {"groups": {"g": (rt.Rectangle(material="lamp"),)}},
    ),
}


@pytest.mark.parametrize("name", ["sampled", "polygon", "group"])
def test_a_square_of_light(name):
    shapes, more = CASES[name]
    mean, error = seen(shapes, **more)
    expected = 0.5 / math.pi * square_irradiance()
    assert error < 0.01 * expected
    assert abs(mean - expected) < 4 * error


def test_an_infinite_plane_of_light():
    """Half of the sphere shines: irradiance pi L."""
    mean, _ = seen((rt.Plane(material="lamp", transform=DOWN),), spp=1600)
    assert mean == pytest.approx(0.5 * 2.0, rel=1e-12)


def test_lights_alone_do_not_lose_them():
    """What light samples cannot find, scattered rays may count in full."""
    shapes, more = CASES["polygon"]
    mean, error = seen(shapes, sampling="lights", **more)
    expected = 0.5 / math.pi * square_irradiance()
    assert abs(mean - expected) < 4 * error


def test_the_inside_of_a_hollow_shines():
    """A ball inside a solid from which a larger shining ball was taken: a furnace."""
    scene = rt.Scene(
        camera=rt.Perspective(eye=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), fov=60),
        film=rt.Film(width=8, height=8),
        sampler=rt.Independent(spp=16),
        integrator=rt.Path(max_depth=2),
        materials=LAMP,
        shapes=(rt.Box(transform=(Scale(scale=5.0),)) - rt.Sphere(radius=3.0, material="lamp"),),
    )
    assert np.all(rt.render(scene).colour == (2.0, 3.0, 4.0))


def test_explain_tells():
    from reference_rt.explain import explain

    shapes, _ = CASES["polygon"]
    scene = rt.Scene(materials=LAMP, shapes=(FLOOR, *shapes))
    _, left_out = explain(scene, rt.build_tables(scene))
    assert "sampling of 1 emissive primitives" in dict(left_out)
