"""Point lights, skies and how lights are picked; Whitted's lamps."""

import math

import numpy as np
import pytest
from worlds import FLOOR, ORIGIN, RADIANCE, RHO, estimate, lambert

import reference_rt as rt
from reference_rt.core import transform

SMALL = transform.Scale(scale=(1e-3, 1e-3, 1e-3))
ELSEWHERE = (
    rt.Sphere(center=(0, -50, 0), radius=1e-3),
    rt.Box(transform=(SMALL, transform.Translate(translate=(0, -60, 0)))),
    rt.Triangle(v0=(0, -70, 0), v1=(1e-3, -70, 0), v2=(0, -70, 1e-3)),
    rt.Rectangle(material="off", transform=(SMALL, transform.Translate(translate=(0, -80, 0)))),
)
"""One of each shape, and a lamp, out of sight: every scene here has the same tables, and those that
are rendered in the same way share kernels."""

MATERIALS = {
    "lamp": rt.Emissive(radiance=(3.0, 2.0, 1.0)),
    "off": rt.Emissive(radiance=(0, 0, 0)),
    "floor": rt.Diffuse(reflectance=(0.8, 0.5, 0.2)),
    "glass": rt.Dielectric(),
}


def assert_estimates(scene, expected):
    """Within 4 standard errors (1 in 16,000 by chance; the seed is fixed), and rounding."""
    mean, error = estimate(scene)
    assert (np.abs(mean - expected) <= 4 * error + 1e-12 * np.abs(expected)).all(), (mean, expected)


def scene_of(*shapes, lights=(), sky=0.0, materials=None, **parts):
    """Shapes under lights and a sky of one radiance."""
    given = {
        "camera": ORIGIN,
        "film": rt.Film(width=32, height=32),
        "sampler": rt.Sobol(spp=64, seed=4),
        "integrator": rt.Path(max_depth=2),
    } | parts
    dark = rt.Point(position=(0, -55, 0), intensity=0)
    return rt.Scene(
        materials=MATERIALS | (materials or {}),
        shapes=(*shapes, *ELSEWHERE),
        lights=(*lights, dark, rt.Constant(radiance=sky)),
        **given,
    )


WHITTED = {"integrator": rt.Whitted(), "sampler": rt.Grid()}


def lit(lamp, **parts):
    return scene_of(FLOOR, lamp, **parts)


STEPS = (
    transform.Scale(scale=(1.2, 0.6, 0.3)),
    transform.Rotate(rotate=transform.Turn(axis=(1, 0, 0), degrees=70)),
    transform.Rotate(rotate=transform.Turn(axis=(0, 1, 0), degrees=25)),
    transform.Translate(translate=(0.6, 2.0, -0.5)),
)


def test_a_rectangle_shines_with_its_front_alone():
    """Lamps in front of the origin: `test_closed_forms`."""
    away = (transform.Scale(scale=(1, 1, -1)), *STEPS)
    assert not estimate(lit(rt.Rectangle(transform=away, material="lamp")))[0].any()


def test_something_in_the_way():
    """A wall between a point light and the floor."""
    wall = rt.Sphere(center=(0, 1, 0), radius=0.1)
    light = rt.Point(position=(0, 2, 0), intensity=(1, 1, 1))
    assert rt.render(scene_of(FLOOR, lights=(light,), **WHITTED)).colour.all()
    assert not rt.render(scene_of(FLOOR, wall, lights=(light,), **WHITTED)).colour.any()


def test_whitteds_area_light_is_its_middle():
    """One point of radiance times area: L A cos cos' / r² (the area is 4 times 1.2 times 0.6)."""
    m = transform.affine(STEPS)
    w = m[:, 3]
    r2 = w @ w
    normal = np.cross(m[:, 0], m[:, 1])  # of half the edges: a quarter of the area long
    expected = RHO / math.pi * RADIANCE * 4 * (-normal @ w) * w[1] / r2**2
    lamp = rt.Rectangle(transform=STEPS, material="lamp")
    # The view is 1e-12 wide, seen from 1e-3.
    assert np.allclose(rt.render(lit(lamp, **WHITTED)).colour, expected, rtol=1e-8)


def test_whitteds_environment_is_seen_and_lights_nothing():
    camera, film = rt.Orthographic(eye=(0, 0, 3), width=3.0), rt.Film(width=9, height=9)
    scene = scene_of(rt.Sphere(), sky=(1.0, 2.0, 3.0), camera=camera, film=film, **WHITTED)
    colour = rt.render(scene).colour
    assert np.unique(colour.reshape(-1, 3), axis=0).tolist() == [[0, 0, 0], [1, 2, 3]]


@pytest.mark.parametrize(
    ("integrator", "share"),
    [
        (rt.Path(max_depth=2), 0.125),
        (rt.Path(max_depth=2, sampling="bsdf"), 0.125),
        (rt.Path(max_depth=2, sampling="lights"), 0.9),
        (rt.Direct(), 0.125),
        (rt.Direct(bsdf_samples=0), 0.9),
    ],
    ids=["both", "bsdf", "lights", "direct", "direct lights"],
)
def test_a_lamp_under_a_sky(integrator, share):
    """The sky is picked seldom where scattered rays find it too, else by its power but for the
    least share of the lamp, and gives as much as ever."""
    m = transform.affine(STEPS)
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    seen = lambert(transform.apply_points(m, square))
    sky = np.array([2.0, 0.5, 1.0])
    lamp = rt.Rectangle(transform=STEPS, material="lamp")
    scene = lit(lamp, sky=tuple(sky), integrator=integrator)
    chances = scene.tables.lights.choice.probability
    assert chances[-1] == share if share < 0.5 else chances[-1] > share
    assert chances.sum() == pytest.approx(1.0, abs=1e-15)
    assert_estimates(scene, RHO / math.pi * (RADIANCE * seen + sky * (math.pi - seen)))


def test_a_sky_without_other_lights_keeps_its_share():
    """Also beside lamps without power; what other lights have goes by their power."""
    sky, point = rt.Constant(radiance=1), rt.Point(position=(0, 5, 0), intensity=1)
    dark = point.model_copy(update={"intensity": (0.0, 0.0, 0.0)})
    twice = point.model_copy(update={"intensity": (2.0, 2.0, 2.0)})
    for lights, expected in (
        ((sky,), [1]),
        ((dark, sky), [0, 1]),
        ((point, dark, twice, sky), [7 / 24, 0, 14 / 24, 1 / 8]),
    ):
        scene = rt.Scene(shapes=(rt.Sphere(center=(0, -50, 0)),), lights=lights)
        chances = scene.tables.lights.choice.probability
        np.testing.assert_allclose(chances, expected, rtol=1e-15)


def test_unlimited_paths_without_any_light_are_black():
    scene = rt.Scene(
        film=rt.Film(width=2, height=2), shapes=(rt.Sphere(),), camera=rt.Perspective(eye=(0, 0, 5))
    )
    with pytest.warns(rt.SceneWarning, match="no lights"):
        assert not rt.render(scene).colour.any()


def test_light_samples_do_not_depend_on_the_acceleration_structure():
    """Lights are numbered in the order of the scene, not of the rows that a BVH sorts."""
    rng = np.random.default_rng(3)
    corners = rng.uniform(-1.0, 1.0, (20, 3, 3)) + rng.uniform(-3.0, 3.0, (20, 1, 3))
    lamp = rt.Mesh(
        material="lamp", vertices=corners.reshape(-1, 3), faces=np.arange(60).reshape(20, 3)
    )
    floor = FLOOR.model_copy(
        update={"transform": (*FLOOR.transform, transform.Translate(translate=(0, -4, 0)))}
    )
    scene = rt.Scene(
        camera=rt.Perspective(eye=(0, 3, 9), target=(0, 0, 0)),
        film=rt.Film(width=8, height=6),
        sampler=rt.Sobol(spp=4),
        materials=MATERIALS,
        shapes=(lamp, floor, *ELSEWHERE),
    )
    pictures = [
        rt.render(scene.changed(hierarchy=kind)).colour
        for kind in ("none", "sah", "median", "spatial")
    ]
    assert pictures[0].any()
    for other in pictures[1:]:
        np.testing.assert_array_equal(other, pictures[0])
