"""Spot and directional lights: closed forms, powers."""

import math

import numpy as np
import pytest

from reference_rt.core.vec3 import Vec3
from reference_rt.lights.emitters import constant, directional, point, spot
from reference_rt.lights.emitters.constant import Constant
from reference_rt.lights.emitters.directional import Directional
from reference_rt.lights.emitters.point import Point
from reference_rt.lights.emitters.spot import Spot

U = 2.0**-53
ORIGIN, INTENSITY = np.array([1.0, 2.0, -3.0]), (3.0, 2.0, 1.0)


def aimed(axis, **fields):
    target = tuple(float(x) for x in ORIGIN + axis)
    return Spot(origin=tuple(ORIGIN), target=target, intensity=INTENSITY, **fields)


def seen(light, p):
    with np.errstate(all="ignore"):
        return spot.sample(light.tabulate(), 0, None, Vec3(*p))


def test_a_wide_spot_and_a_hard_one():
    wide = aimed([0, 0, 1], cutoff_angle=180.0, beam_width=0.0)
    assert seen(wide, ORIGIN - [0, 0, 1]).radiance == pytest.approx((0, 0, 0), abs=1e-15)
    half = np.array(INTENSITY) / 2
    assert seen(wide, np.add(ORIGIN, [0, 1, 0])).radiance == pytest.approx(half, rel=8 * U)
    hard = aimed([0, 0, 1], cutoff_angle=45.0, beam_width=45.0)
    assert seen(hard, np.add(ORIGIN, [0, 0.999, 1])).pdf == 1.0
    assert seen(hard, np.add(ORIGIN, [0, 1.001, 1])).pdf == 0.0


def test_directional_is_the_same_everywhere():
    light = Directional(direction=(0, -3, -4), irradiance=(1, 2, 3)).tabulate()
    found = directional.sample(light, 0)
    assert found.wi == pytest.approx((0, 0.6, 0.8), abs=2 * U)
    assert found.target == found.wi
    assert found.radiance == Vec3(1, 2, 3)
    assert (found.distance, found.pdf, found.is_delta) == (math.inf, 1.0, True)


def luminance(rgb):
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]


@pytest.mark.parametrize(
    ("beam", "cutoff"), [(0, 180), (15, 20), (0.01, 0.02), (30, 30), (90, 179)]
)
def test_spot_power_is_its_intensity_over_all_directions(beam, cutoff):
    """By quadrature of the kernel itself, on both sides of the beam's edge."""
    light = aimed([0, 0, 1], cutoff_angle=float(cutoff), beam_width=float(beam)).tabulate()
    nodes, weights = np.polynomial.legendre.leggauss(30)
    total = 0.0
    for low, high in ((0.0, math.radians(beam)), (math.radians(beam), math.radians(cutoff))):
        angle = low + 0.5 * (high - low) * (nodes + 1)
        f = [spot.falloff(light, 0, Vec3(math.sin(a), 0.0, math.cos(a))) for a in angle]
        total += 0.5 * (high - low) * np.sum(weights * f * np.sin(angle))
    expected = 2 * math.pi * total * luminance(INTENSITY)
    # Of a thin cone 1 - cos keeps what (theta² / 2) leaves of the digits.
    assert spot.power(light, 9.0)[0] == pytest.approx(expected, rel=1e-12, abs=32 * U)


def test_powers():
    assert point.power(Point(position=(0, 0, 0), intensity=2.0).tabulate(), 9.0) == pytest.approx(
        [8 * math.pi]
    )
    sun = Directional(direction=(0, 0, 1), irradiance=(1, 2, 3)).tabulate()
    assert directional.power(sun, 3.0) == pytest.approx([9 * math.pi * luminance((1, 2, 3))])
    sky = Constant(radiance=(1, 2, 3)).tabulate()
    assert constant.power(sky, 3.0) == pytest.approx([36 * math.pi**2 * luminance((1, 2, 3))])
