"""Light without random numbers, to rounding: point, spot, directional; Phong; mirrors, glass."""

import math

import numpy as np
import pytest
from worlds import FLOOR, RHO, at, facing, world

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.lights import DIRECTIONAL, POINT, SPOT
from reference_rt.rendering import query


def rays_onto(points):
    """Rays from above onto points of the floor."""
    o = points + np.array([0.3, 5.0, -0.4])
    d = points - o
    return o, d / np.linalg.norm(d, axis=1, keepdims=True)


LIGHTS = {
    "point": rt.Point(position=(0.5, 2, -1), intensity=(7, 8, 9)),
    "spot": rt.Spot(
        origin=(0.5, 2, -1), target=(0, 0, 0.5), intensity=(7, 8, 9), cutoff_angle=40, beam_width=25
    ),
    "narrow spot": rt.Spot(
        origin=(0.5, 2, -1), target=(0, 0, 0.5), intensity=(7, 8, 9), cutoff_angle=50, beam_width=0
    ),
    "directional": rt.Directional(direction=(1, -2, 0.5), irradiance=(7, 8, 9)),
}


def arriving(light, p):
    """(n, 3): irradiance on the floor (y = 0, normal +y) at p, by the textbook."""
    if isinstance(light, rt.Directional):
        d = np.array(light.direction)
        return np.outer(np.full(len(p), -d[1] / np.linalg.norm(d)), light.irradiance)
    where = np.array(light.position if isinstance(light, rt.Point) else light.origin)
    w = where - p
    r = np.linalg.norm(w, axis=1)
    irradiance = w[:, 1] / r**3
    if isinstance(light, rt.Spot):
        axis = np.subtract(light.target, light.origin)
        axis = axis / np.linalg.norm(axis)
        # Kahan's angle, good at every size.
        v = -w / r[:, None]
        angle = 2 * np.arctan2(np.linalg.norm(v - axis, axis=1), np.linalg.norm(v + axis, axis=1))
        beam, cutoff = np.radians(light.beam_width), np.radians(light.cutoff_angle)
        irradiance = irradiance * np.clip((cutoff - angle) / (cutoff - beam), 0.0, 1.0)
    return np.outer(irradiance, light.intensity)


@pytest.mark.parametrize("name", LIGHTS)
def test_deterministic_lights(name):
    """By Whitted's integrator, and asked by itself."""
    light = LIGHTS[name]
    scene = world(FLOOR, lights=(light,))
    p = np.random.default_rng(5).uniform(-2, 2, (2000, 3)) * [1, 0, 1]
    o, d = rays_onto(p)
    p = o - d * (o[:, 1] / d[:, 1])[:, None]
    expected = RHO / math.pi * arriving(light, p)
    assert np.count_nonzero(expected[:, 0]) > 100
    if name != "point" and name != "directional":
        assert np.count_nonzero(expected[:, 0] == 0) > 100
    found = query.radiance_without_noise(scene.tables, rt.Whitted().setup(), o, d)
    # Near a spot's rim the difference of two angles of about 1 remains: relative to the beam.
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected) <= 1e-12 * np.maximum(expected, 1e-3 * scale)).all()
    kinds = scene.tables.lights.choice.kind
    rows = scene.tables.lights.choice.row
    code = {rt.Point: POINT, rt.Spot: SPOT, rt.Directional: DIRECTIONAL}[type(light)]  # fmt: skip
    (k,) = np.flatnonzero((kinds == code) & (rows == 1))  # row 0 is the hidden one
    direct = query.direct_light(scene.tables, o, d, int(k)).contribution
    assert (np.abs(direct - expected) <= 1e-12 * np.maximum(expected, 1e-3 * scale)).all()


def test_direct_on_a_grid():
    """`direct` has the light of all lights at once, at the grid's points, in two samples a side."""
    scene = rt.Scene(
        camera=rt.Orthographic(eye=(0, 5, 0), target=(0, 0, 0), up=(0, 0, -1), width=4.0),
        film=rt.Film(width=16, height=16),
        integrator=rt.Direct(),
        sampler=rt.Grid(spp=4),
        materials={"floor": rt.Diffuse(reflectance=tuple(RHO))},
        shapes=(FLOOR,),
        lights=tuple(LIGHTS.values()),
    )
    along = (np.arange(32) + 0.5) / 8.0 - 2.0
    z, x = np.meshgrid(along, along, indexing="ij")
    p = np.stack([x, 0.0 * x, z], axis=-1).reshape(-1, 3)
    exact = RHO / math.pi * sum(arriving(light, p) for light in LIGHTS.values())
    expected = exact.reshape(16, 2, 16, 2, 3).mean(axis=(1, 3))
    # The angle at a spot's rim, as above, counts relative to the brightest pixel.
    permitted = 1e-12 * expected.max()
    assert np.abs(rt.render(scene).colour - expected).max() <= permitted
    # A wall that the camera sees edge-on blocks light, unless there are no shadows.
    wall = rt.Rectangle(
        transform=(*facing((0, 1, 0), 90), transform.Translate(translate=(1, 1, 0)))
    )
    scene = scene.changed(shapes=(FLOOR, wall))
    dark = expected - rt.render(scene).colour
    assert (dark >= -permitted).all()
    assert (dark > 0.1 * expected.max()).any()
    bright = rt.render(scene.changed(integrator=rt.Direct(shadows=False))).colour
    assert np.abs(bright - expected).max() <= permitted


def test_a_sky_without_shadows():
    """In a corner, where half of it is hidden."""
    wall = rt.Rectangle(transform=(transform.Translate(translate=(0, 0.9, 0.1)),))
    sky = rt.Constant(radiance=(1, 2, 3))
    floor = {"floor": rt.Diffuse(reflectance=tuple(RHO))}
    scene = rt.Scene(materials=floor, shapes=(FLOOR, wall), lights=(sky,))
    o, d = rays_onto(np.zeros((1, 3)))
    open_sky, hidden = (
        query.radiance(scene, o, d, spp=16384, integrator=rt.Direct(shadows=shadows))
        for shadows in (False, True)
    )
    expected = RHO * sky.radiance
    assert (np.abs(open_sky.mean - expected) <= 5.0 * open_sky.standard_error).all()
    assert (open_sky.standard_error < 0.02 * expected).all()
    assert (hidden.mean < 0.6 * expected).all()


@pytest.mark.parametrize("half_vector", [False, True])
def test_phong(half_vector):
    """k_a I_a + the sum over lights of (k_d l·n + k_s (e·r or h·n)^p) E, written out."""
    k_a, k_d, k_s, p = (0.1, 0.2, 0.3), (0.2, 0.1, 0.05), (0.3, 0.2, 0.1), 20.5
    material = rt.Phong(ambient=k_a, diffuse=k_d, specular=k_s, exponent=p, half_vector=half_vector)
    floor = FLOOR.model_copy(update={"material": "shiny"})
    ambient = np.array([0.5, 0.6, 0.7])
    lights = tuple(LIGHTS.values())
    scene = world(
        floor, materials={"shiny": material}, lights=(*lights, rt.Ambient(radiance=tuple(ambient)))
    )
    points = np.random.default_rng(6).uniform(-2, 2, (2000, 3)) * [1, 0, 1]
    o, d = rays_onto(points)
    points = o - d * (o[:, 1] / d[:, 1])[:, None]
    expected = np.tile(k_a * ambient, (len(points), 1))
    for light in lights:
        if isinstance(light, rt.Directional):
            to_light = np.tile(np.multiply(-1.0, light.direction), (len(points), 1))
        else:
            to_light = getattr(light, "position", None) or light.origin
            to_light = np.array(to_light) - points
        to_light /= np.linalg.norm(to_light, axis=1, keepdims=True)
        across = arriving(light, points) / to_light[:, 1:2]
        if half_vector:
            h = to_light - d
            cos = h[:, 1] / np.linalg.norm(h, axis=1)
        else:
            cos = np.sum((to_light * [-1, 1, -1]) * -d, axis=1)  # mirrored at the floor
        lobe = np.maximum(0.0, cos) ** p
        expected += (np.outer(to_light[:, 1], k_d) + np.outer(lobe, k_s)) * across
    found = query.radiance_without_noise(scene.tables, rt.Whitted().setup(), o, d)
    # A rounding of the cosine counts p times.
    assert np.allclose(found, expected, rtol=1e-12, atol=0)


@pytest.mark.parametrize("bounces", [0, 1, 2, 5])
def test_a_light_between_mirrors(bounces):
    """Two level mirrors of reflectance m face each other: a ray that is mirrored k times sees the
    floor m^k as bright; here by an open side to a lit wall, with the light's inverse square."""
    m = 0.8
    mirrors = [
        rt.Rectangle(
            transform=(transform.Scale(scale=(10, 10, 1)), *facing((1, 0, 0), turn), *at(0, y, 0)),
            material="dull",
        )
        for turn, y in ((-90, 0.0), (90, 1.0))
    ]
    wall = rt.Rectangle(
        transform=(transform.Scale(scale=(100, 100, 1)), *facing((0, 1, 0), -90), *at(20, 0, 0)),
        material="floor",
    )
    light = rt.Point(position=(15.0, 3.0, 2.0), intensity=(7, 8, 9))
    scene = world(wall, *mirrors, lights=(light,), materials={"dull": rt.Mirror(reflectance=m)})
    # Unfolded, the ray goes straight; it starts in the middle and comes out of x = 10 after
    # `bounces` crossings of the planes y = integer.
    rise = bounces / 10.0
    o, d = np.array([[0.0, 0.5, 0.0]]), np.array([[1.0, rise, 0.05]])
    d /= np.linalg.norm(d)
    crossings = math.floor(0.5 + rise * 10.0)
    assert crossings == bounces
    y_out = 0.5 + 20.0 * rise - bounces if bounces % 2 == 0 else 1 + bounces - 0.5 - 20.0 * rise
    p = np.array([20.0, y_out, 1.0])
    w = np.array(light.position) - p
    irradiance = np.array([7, 8, 9]) * -w[0] / np.linalg.norm(w) ** 3
    found = query.radiance_without_noise(scene.tables, rt.Whitted().setup(), o, d)
    assert np.allclose(found, m**bounces * RHO / math.pi * irradiance, rtol=1e-12, atol=0)


@pytest.mark.parametrize("ior", [1.3, 1.5, 2.4])
def test_a_pane_by_all_its_bounces(ior):
    """Whitted's tree in a pane of glass, seen straight on between walls of radiance 1: what is
    mirrored at the front and the whole series behind it; both with R = ((n-1)/(n+1))²."""
    R = ((ior - 1) / (ior + 1)) ** 2
    front = rt.Rectangle(material="pane", transform=at(0, 0, 0.1))
    back = rt.Rectangle(material="pane", transform=(*facing((0, 1, 0), 180), *at(0, 0, -0.1)))
    walls = [
        rt.Rectangle(
            material="wall", transform=(transform.Scale(scale=(9, 9, 1)), *turn, *at(0, 0, z))
        )
        for turn, z in (((), -6), (facing((0, 1, 0), 180), 6))
    ]
    scene = world(
        front,
        back,
        *walls,
        materials={
            "pane": rt.Dielectric(interior_ior=ior),
            "wall": rt.Emissive(radiance=(1, 1, 1)),
        },
    )
    setup = rt.Whitted(max_depth=200, min_contribution=0.0).setup()
    found = query.radiance_without_noise(scene.tables, setup, [[0.0, 0, 5]], [[0.0, 0, -1]])
    assert np.allclose(found, 1.0, rtol=1e-12)
    for depth in range(1, 8):
        setup = rt.Whitted(max_depth=depth, min_contribution=0.0).setup()
        found = query.radiance_without_noise(scene.tables, setup, [[0.0, 0, 5]], [[0.0, 0, -1]])
        # Depth 1 mirrors outside; depth k >= 2 goes out after k - 2 bounces within.
        through = [(1 - R) ** 2 * R**k for k in range(depth - 1)]
        assert np.allclose(found, R + sum(through), rtol=1e-12)
