"""Interreflection in enclosures where every bounce has a closed form."""

import math

import numpy as np
import pytest
from worlds import RADIANCE, assert_mean, at, budgets, facing, world

import reference_rt as rt
from reference_rt.core import transform


def exchanged(emitted, factors, reflectance, bounces):
    """Radiosity (Goral et al. 1984) of surfaces, each seeing the others evenly: the sum over at
    most `bounces` of (rho F)^k E; None: all."""
    step = np.diag(reflectance) @ factors
    if bounces is None:
        return np.linalg.solve(np.eye(len(step)) - step, emitted)
    return sum(np.linalg.matrix_power(step, k) @ emitted for k in range(bounces + 1))


WALL, BODY = 0.7, 0.4
GREYS = {
    "wall": rt.Diffuse(reflectance=WALL),
    "hollow": rt.TwoSided(base="wall"),
    "body": rt.Diffuse(reflectance=BODY),
    "shining body": rt.Emissive(radiance=tuple(RADIANCE), base="body"),
}


def met(o, d, radius):
    """Where a ray from inside meets a sphere about the origin."""
    d = d / np.linalg.norm(d)
    b = o @ d
    return o + d * (math.sqrt(b * b + radius**2 - o @ o) - b)


def looking(eye, target):
    """All pixels along one ray."""
    return rt.Orthographic(eye=eye, target=target, up=(0.1, 0.2, 0.9), width=1e-12)


@pytest.mark.cases(5)
@budgets
@pytest.mark.parametrize("max_depth", [2, 3, 4, None])
@pytest.mark.parametrize("seen", ["outside", "inside"])
def test_concentric_spheres(max_depth, seen, spp, power):
    """A lamp in a hollow sphere: of what leaves the outer one, (r/R)² meets the inner, evenly."""
    r, R = 0.7, 2.0
    part = (r / R) ** 2
    factors = np.array([[0.0, 1.0], [part, 1 - part]])
    bounces = None if max_depth is None else max_depth - 1
    target = (0.0, 0.0, 0.0) if seen == "inside" else (1.5, 1.0, 0.3)
    scene = world(
        rt.Sphere(radius=R, material="hollow"),
        rt.Sphere(radius=r, material="shining body"),
        materials=GREYS,
        spp=spp,
        camera=looking((0.5, 1.0, 0.8), target),
        integrator=rt.Path(max_depth=max_depth),
    )
    left = exchanged(np.array([1.0, 0.0]), factors, (BODY, WALL), bounces)
    assert_mean(scene, RADIANCE * left[0 if seen == "inside" else 1], power)


@pytest.mark.cases(2)
@budgets
@pytest.mark.parametrize("max_depth", [2, 3, 4, None])
@pytest.mark.parametrize("seen", ["upper", "lower"])
def test_parallel_planes(max_depth, seen, spp, power):
    """A shining floor and a ceiling, 1 apart and 2e4 wide: 1e-8 is lost at the rim."""
    scene = world(
        rt.Rectangle(
            transform=(transform.Scale(scale=(1e4, 1e4, 1)), *facing((1, 0, 0), -90)),
            material="shining body",
        ),
        rt.Rectangle(
            transform=(transform.Scale(scale=(1e4, 1e4, 1)), *facing((1, 0, 0), 90), *at(0, 1, 0)),
            material="wall",
        ),
        materials=GREYS,
        spp=spp,
        camera=looking((0.1, 0.5, 0.2), (0.2, 1.0 if seen == "upper" else 0.0, 0.3)),
        integrator=rt.Path(max_depth=max_depth),
    )
    bounces = None if max_depth is None else max_depth - 1
    factors = np.array([[0.0, 1.0], [1.0, 0.0]])
    left = exchanged(np.array([1.0, 0.0]), factors, (BODY, WALL), bounces)
    assert_mean(scene, RADIANCE * left[0 if seen == "lower" else 1], power)


@pytest.mark.cases(2)
@budgets
@pytest.mark.parametrize("max_depth", [2, 3, 4, None])
def test_inside_a_sphere(max_depth, spp, power):
    """A point light in the middle of a sphere of two colours that cover half of it each: it lights
    all of it evenly, and what is scattered from anywhere falls evenly everywhere, so that a bounce
    counts the mean of the colours."""
    R, intensity, eye = 2.0, 5.0, np.array([0.4, 0.3, -0.2])
    scene = world(
        rt.Sphere(radius=R, material="patched"),
        materials={
            "patches": rt.Diffuse(reflectance="patches"),
            "patched": rt.TwoSided(base="patches"),
        },
        textures={"patches": rt.Checker(first=(0.9, 0.8, 0.6), second=(0.1, 0.2, 0.4))},
        lights=(rt.Point(position=(0, 0, 0), intensity=intensity),),
        spp=spp,
        camera=looking(tuple(eye), (1.2, 0.9, 1.0)),
        integrator=rt.Path(max_depth=max_depth),
    )
    # Of (u, v) the quarters on a diagonal are the first colour: phi < pi above the equator.
    p = met(eye, np.array([1.2, 0.9, 1.0]) - eye, R)
    first = (math.atan2(p[1], p[0]) > 0) == (p[2] > 0)
    own = np.array([0.9, 0.8, 0.6]) if first else np.array([0.1, 0.2, 0.4])
    mean = np.array([0.5, 0.5, 0.5])
    count = np.inf if max_depth is None else max_depth - 1
    series = (1 - mean**count) / (1 - mean)
    assert_mean(scene, own * intensity / (math.pi * R**2) * series, power)


@pytest.mark.cases(2)
@budgets
@pytest.mark.parametrize("max_depth", [2, 3, 4, None])
def test_inside_a_sphere_off_its_middle(max_depth, spp, power):
    """The same with one colour and the light anywhere: direct light has its cosine and distance,
    all later light is even: rho I / R² a bounce."""
    R, intensity, position = 2.0, 5.0, np.array([0.4, 0.9, -0.2])
    scene = world(
        rt.Sphere(radius=R, material="hollow"),
        materials=GREYS,
        lights=(rt.Point(position=tuple(position), intensity=intensity),),
        spp=spp,
        camera=looking((0.1, 0.2, 0.3), (1.2, 0.9, 1.0)),
        integrator=rt.Path(max_depth=max_depth),
    )
    p = met(np.array([0.1, 0.2, 0.3]), np.array([1.1, 0.7, 0.7]), R)
    to_light = position - p
    distance = np.linalg.norm(to_light)
    direct = intensity * (to_light @ -p / (R * distance)) / distance**2
    count = np.inf if max_depth is None else max_depth - 1
    later = intensity / R**2 * ((1 - WALL**count) / (1 - WALL) - 1)
    assert_mean(scene, WALL / math.pi * (direct + later), power)
