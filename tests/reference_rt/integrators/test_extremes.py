"""Radiometry at extremes: the brightest and the faintest, the largest and the smallest, the nearest
and the farthest lights are finite and right."""

import math

import numpy as np
import pytest
from worlds import FLOOR, ORIGIN, RADIANCE, RHO, assert_mean, at, facing, world

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.rendering import query

LEVEL = facing((1, 0, 0), 90)  # a front that looks down
DOWN = ([[0.0, 1.0, 0.0]], [[0.0, -1.0, 0.0]])
"""The ray onto the origin."""


def whitted(scene):
    return query.radiance_without_noise(scene.tables, rt.Whitted().setup(), *DOWN)[0]


@pytest.mark.cases(1)
@pytest.mark.parametrize("factor", [2.0**-100, 1e-30, 1e-15, 1e15, 1e30, 2.0**100])
def test_brightness_is_a_factor(factor):
    """Twice the light is twice the picture, for each sample; exactly where factors are powers of
    two, which do not round."""

    def picture(k):
        lamp = rt.Sphere(center=(0.5, 2, -1), radius=0.8, material="bright")
        scene = world(
            FLOOR,
            lamp,
            materials={"bright": rt.Emissive(radiance=tuple(k * RADIANCE))},
            lights=(
                rt.Point(position=(1, 2, 3), intensity=k),
                rt.Spot(origin=(-1, 2, 3), target=(0, 0, 0), intensity=3 * k),
                rt.Directional(direction=(0, -1, 1), irradiance=2 * k),
            ),
            pixels=64,
        )
        return rt.render(scene).colour

    once, scaled = picture(1.0), picture(factor)
    assert np.isfinite(scaled).all()
    assert (scaled > 0).all()
    if math.frexp(factor)[0] == 0.5:
        assert np.array_equal(scaled, factor * once)
    # A light is picked with the same probability to rounding: some number may fall on its limit.
    assert np.allclose(scaled, factor * once, rtol=1e-12, atol=0)


DISTANCES = 10.0 ** np.arange(-9, 10, 3)


@pytest.mark.cases(6)
@pytest.mark.parametrize("distance", DISTANCES)
@pytest.mark.parametrize("intensity", [1e-30, 1.0, 1e30])
def test_point_and_spot_at_any_distance(distance, intensity):
    """The inverse square, without noise."""
    towards = np.array([0.48, 0.8, -0.36])
    position = tuple(distance * towards)
    expected = RHO / math.pi * intensity * 0.8 / distance**2
    point = rt.Point(position=position, intensity=intensity)
    assert np.allclose(whitted(world(FLOOR, lights=(point,))), expected, rtol=1e-12, atol=0)
    spot = rt.Spot(origin=position, target=(0, 0, 0), intensity=intensity, cutoff_angle=1e-3)
    assert np.allclose(whitted(world(FLOOR, lights=(spot,))), expected, rtol=1e-12, atol=0)
    below = rt.Point(position=(position[0], -position[1], position[2]), intensity=intensity)
    assert not whitted(world(FLOOR, lights=(below,))).any()


SIZES = 10.0 ** np.arange(-6, 7, 2)
"""Of lamps with areas of 1e-12 to 1e12."""


def lamp_of(kind, size, height):
    """A lamp right above the origin that shines down, and its irradiance there."""
    scale = transform.Scale(scale=(size, size, 1.0))
    place = (scale, *LEVEL, *at(0, height, 0))
    ratio = (size / height) ** 2
    if kind == "disk":
        return rt.Disk(transform=place, material="lamp"), math.pi * ratio / (1 + ratio)
    if kind == "sphere":
        return rt.Sphere(center=(0, height, 0), radius=size, material="lamp"), math.pi * ratio
    if kind == "rectangle":
        # Four rectangles with a corner above the origin (Howell & Mengüç, B-4 with a = b).
        x = size / height
        y = x / math.sqrt(1 + x * x)
        return rt.Rectangle(transform=place, material="lamp"), 4 * y * math.atan(y)
    # A triangle of three corners around the middle: three edges of Lambert's formula.
    phi = np.arange(3) * 2 * math.pi / 3
    corners = np.stack([np.cos(phi) * size, np.full(3, height), np.sin(phi) * size], axis=1)
    a, b = corners[0], corners[1]
    cross = np.cross(a, b)
    angle = math.atan2(np.linalg.norm(cross), a @ b)
    irradiance = 1.5 * angle * abs(cross[1]) / np.linalg.norm(cross)
    v = [tuple(c) for c in corners]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    if normal[1] > 0:
        v = v[::-1]
    return rt.Triangle(v0=v[0], v1=v[1], v2=v[2], material="lamp"), irradiance


@pytest.mark.cases(6)
@pytest.mark.parametrize("kind", ["disk", "sphere", "rectangle", "triangle"])
@pytest.mark.parametrize("size", SIZES)
def test_lamps_of_any_area(kind, size):
    """Seen under the same angle; and from afar where they are small, at a unit distance."""
    heights = (2.0 * size, 2.0) if size <= 1 else (2.0 * size,)
    for height in heights:
        lamp, irradiance = lamp_of(kind, size, height)
        # Between the lamp and the floor, even for the smallest.
        eye = (0.0, min(1e-3, 0.5 * size), 0.0)
        scene = world(FLOOR, lamp, spp=16, camera=ORIGIN.model_copy(update={"eye": eye}))
        assert_mean(scene, RHO / math.pi * RADIANCE * irradiance, power=5e-3)


@pytest.mark.parametrize("kind", ["disk", "rectangle", "triangle"])
def test_lamps_that_fill_the_sky(kind):
    """1e6 wide and 1 away: all but 1e-12 or 1e-6 of the hemisphere."""
    lamp, irradiance = lamp_of(kind, 1e6, 1.0)
    assert irradiance == pytest.approx(math.pi, rel=3e-6)
    assert_mean(world(FLOOR, lamp, spp=64), RHO / math.pi * RADIANCE * irradiance, power=5e-3)
