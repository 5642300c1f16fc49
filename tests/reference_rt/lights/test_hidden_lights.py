"""Shapes that shine but that no light sample finds: scattered rays do, with the same mean.

All scenes have the same kinds of shapes, and share kernels.
"""

import math

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.core.transform import Rotate, Scale, Translate, Turn

LAMP = {"lamp": rt.Emissive(radiance=(2.0, 3.0, 4.0)), "grey": rt.Diffuse(reflectance=(0.5,) * 3)}
FLOOR = rt.Rectangle(material="grey", transform=(Scale(scale=(20.0, 20.0, 1.0)),))
DOWN = (
    Rotate(rotate=Turn(axis=(1.0, 0.0, 0.0), degrees=180.0)),
    Translate(translate=(0.0, 0.0, 1.0)),
)
"""The plane z = 0 turned over, at height 1."""
SQUARE = (((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)),)


def under(z):
    """A place below the floor, of something small that faces down."""
    turned, _ = DOWN
    return (Scale(scale=1e-3), turned, Translate(translate=(0.0, 0.0, z)))


BELOW = (
    rt.Rectangle(material="lamp", transform=under(-40.0)),
    rt.Polygon(rings=SQUARE, transform=under(-41.0)),
    rt.Instance(group="g", transform=under(-42.0)),
    rt.Box(transform=under(-43.0)) - rt.Sphere(transform=under(-43.0)),
    rt.Plane(transform=(Translate(translate=(0.0, 0.0, -50.0)),)),
)


def scene_of(*shapes, **parts):
    groups = {"g": (rt.Rectangle(material="lamp"),)}
    return rt.Scene(materials=LAMP, groups=groups, shapes=(*shapes, *BELOW), **parts)


def seen(shape, spp=40_000, **path):
    """(mean, standard error) of the radiance of the floor below the middle of the light."""
    pixels = 16
    scene = scene_of(
        FLOOR,
        shape,
        camera=rt.Perspective(eye=(3.0, 0.0, 0.5), target=(0.0, 0.0, 0.0), up=(0, 0, 1), fov=1e-6),
        film=rt.Film(width=pixels, height=1),
        sampler=rt.Independent(spp=spp // pixels),
        integrator=rt.Path(max_depth=2, **path),
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


CASES = {
    "sampled": rt.Rectangle(material="lamp", transform=DOWN),
    "polygon": rt.Polygon(rings=SQUARE, material="lamp", transform=DOWN),
    "group": rt.Instance(group="g", transform=DOWN),
}


@pytest.mark.parametrize("name", CASES)
def test_a_square_of_light(name):
    mean, error = seen(CASES[name])
    expected = 0.5 / math.pi * square_irradiance()
    assert error < 0.01 * expected
    assert abs(mean - expected) < 4 * error


def test_an_infinite_plane_of_light():
    """Half of the sphere shines: irradiance pi L."""
    mean, _ = seen(rt.Plane(material="lamp", transform=DOWN), spp=1600)
    assert mean == pytest.approx(0.5 * 2.0, rel=1e-12)


def test_lights_alone_do_not_lose_them():
    """What light samples cannot find, scattered rays may count in full."""
    mean, error = seen(CASES["polygon"], sampling="lights")
    expected = 0.5 / math.pi * square_irradiance()
    assert abs(mean - expected) < 4 * error


def test_the_inside_of_a_hollow_shines():
    """A ball inside a solid from which a larger shining ball was taken: a furnace."""
    scene = scene_of(
        rt.Box(transform=(Scale(scale=5.0),)) - rt.Sphere(radius=3.0, material="lamp"),
        camera=rt.Perspective(eye=(0.0, 0.0, 0.0), target=(0.0, 0.0, -1.0), fov=60),
        film=rt.Film(width=8, height=8),
        sampler=rt.Independent(spp=16),
        integrator=rt.Path(max_depth=2),
    )
    assert np.all(rt.render(scene).colour == (2.0, 3.0, 4.0))


def test_explain_reports():
    from reference_rt.cli.explain import explain

    scene = rt.Scene(materials=LAMP, shapes=(FLOOR, CASES["polygon"]))
    _, left_out = explain(scene, rt.build_tables(scene))
    assert "sampling of 1 emissive primitives" in dict(left_out)
