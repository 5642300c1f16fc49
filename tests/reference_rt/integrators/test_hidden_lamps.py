"""Hidden lamps: what lies behind them is seen, in their light."""

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.core.transform import Scale
from reference_rt.integrators import Direct, Path

TURN = {"rotate": {"axis": (1, 2, 3), "degrees": 40}}

LAMPS = {
    "sphere": rt.Sphere(radius=0.4, material="lamp", transform=(TURN,)),
    "ellipsoid": rt.Sphere(material="lamp", transform=({"scale": (0.5, 0.2, 0.3)}, TURN)),
    "rectangle": rt.Rectangle(material="lamp", transform=({"scale": 0.5}, TURN)),
    "disk": rt.Disk(material="lamp", transform=({"scale": 0.5}, TURN)),
    "box": rt.Box(material="lamp", transform=({"scale": 0.3}, TURN)),
    "cylinder": rt.Cylinder(material="lamp", transform=({"scale": 0.4}, TURN)),
    "cone": rt.Cone(material="lamp", capped=True, transform=({"scale": 0.4}, TURN)),
    "torus": rt.Torus(material="lamp", transform=({"scale": 0.6}, TURN)),
    "triangle": rt.Triangle(
        material="lamp", v0=(-0.5, -0.4, 0.1), v1=(0.5, -0.3, -0.1), v2=(0, 0.5, 0.2)
    ),
    "solid": rt.Difference(
        of=(rt.Sphere(radius=0.5), rt.Sphere(center=(0.3, 0, 0), radius=0.4)), material="lamp"
    ),
}

INTEGRATORS = {"path": Path(max_depth=4), "direct": Direct(light_samples=2, bsdf_samples=3)}


def scene(lamps, integrator, hidden, lights=(), radiance=(3.0, 2.0, 1.0)):
    return rt.Scene(
        camera=rt.Perspective(eye=(0, 0.4, 4), target=(0, 0, 0), fov=40),
        film=rt.Film(width=12, height=8, layers=("depth",)),
        sampler=rt.Independent(spp=4, seed=3),
        integrator=integrator.model_copy(update={"hide_emitters": hidden}),
        materials={
            "clay": rt.Diffuse(reflectance=(0.7, 0.4, 0.3)),
            "lamp": rt.Emissive(radiance=radiance),
        },
        shapes=(
            rt.Rectangle(material="clay", transform=({"scale": 1.1}, {"translate": (0, 0, -1)})),
            *lamps,
        ),
        lights=lights,
    )


@pytest.mark.cases(8)
@pytest.mark.parametrize("integrator", INTEGRATORS.values(), ids=INTEGRATORS)
@pytest.mark.parametrize("lamp", LAMPS.values(), ids=LAMPS)
def test_what_is_behind_a_lamp_is_seen(lamp, integrator):
    """A lamp, and another one in it, are invisible: the picture has light where the wall is, as
    without them, and nowhere else.  Layers show them."""
    shrink = Scale(scale=(0.9, 0.9, 0.9))
    sky = (rt.Constant(radiance=0.5),)
    shrink = Scale(scale=(0.9, 0.9, 0.9))
    smaller = lamp.model_copy(update={"transform": (shrink, *lamp.transform)})
    found = rt.render(scene((lamp, smaller), integrator, True, sky))
    shown = rt.render(scene((lamp, smaller), integrator, False, sky))
    wall = rt.render(scene((), integrator, True, sky))
    inside = wall.colour[..., 0] > 0.0
    assert inside.any()
    assert not inside.all()
    assert not found.colour[~inside].any()
    lit = found.colour[inside] > 0.0
    assert lit.mean() > 0.95  # at the wall's edge a pixel may have one sample, which is in shadow
    # The wall is nowhere as bright as the lamps.
    assert found.colour.max() < 2.5 < shown.colour.max()
    assert np.array_equal(found.layers["depth"], shown.layers["depth"])
    assert (shown.layers["depth"] < wall.layers["depth"]).any()


@pytest.mark.cases(1)
@pytest.mark.parametrize("integrator", INTEGRATORS.values(), ids=INTEGRATORS)
def test_the_same_wall_in_the_same_light(integrator):
    """A lamp between the eye and the wall, and its light by a point source in its middle's place
    of an equal intensity: a sphere's light outside of it is that of a point."""
    r = 0.05
    lamp = rt.Sphere(center=(0.1, 0.1, 1.0), radius=r, material="lamp")
    bright = (400.0, 200.0, 100.0)
    hidden = scene((lamp,), integrator, True, radiance=bright)
    point = rt.Point(position=(0.1, 0.1, 1.0), intensity=tuple(np.pi * r * r * np.array(bright)))
    plain = scene((), integrator, False, (point,))
    film = rt.Film(width=64, height=48)
    found = rt.render(hidden.changed(film=film, sampler=rt.Sobol(spp=64, seed=2))).colour
    expected = rt.render(plain.changed(film=film, sampler=rt.Sobol(spp=64, seed=2))).colour
    lit = expected > 0.0
    assert np.array_equal(found > 0.0, lit)
    whole = lit.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            whole &= np.roll(lit, step, axis)
    # cos / d² over the sphere differs from that of its middle by about (r / d)², 6e-4 at most; the
    # noise of 64 points on it, of a pixel that the wall fills, is larger: some r / d / 64.
    assert found[whole] == pytest.approx(expected[whole], rel=4e-3)


@pytest.mark.parametrize("integrator", INTEGRATORS.values(), ids=INTEGRATORS)
def test_the_background_is_black_and_its_light_the_same(integrator):
    sky = (rt.Constant(radiance=(0.5, 0.7, 0.9)),)
    shown = rt.render(scene((), integrator, False, sky)).colour
    hidden = rt.render(scene((), integrator, True, sky)).colour
    # By as many of the four samples of a pixel as miss the wall.
    samples = 4.0 * (shown - hidden) / np.array(sky[0].radiance)
    assert samples == pytest.approx(np.round(samples), abs=1e-12)
    assert set(np.unique(np.round(samples))) >= {0.0, 4.0}
    assert (hidden[samples[..., 0] == 0.0] > 0.0).all()


def test_mirrors_show_hidden_lamps():
    mirror = scene(
        (rt.Sphere(center=(0, 0.4, 8), radius=3, material="lamp"),), Path(max_depth=4), True
    )
    glass = mirror.changed(materials=mirror.materials | {"clay": rt.Mirror()})
    assert rt.render(glass).colour.max() == pytest.approx(3.0)


def test_what_ends_at_the_far_plane_behind_a_lamp():
    """The distance to the far plane counts from the near one, not from the lamp."""
    lamp = rt.Sphere(center=(0, 0.2, 1), radius=0.3, material="lamp")
    whole = scene((lamp,), Path(max_depth=3), True)
    for far, sees in ((5.5, True), (4.5, False)):
        camera = whole.camera.model_copy(update={"near": 0.5, "far": far})
        assert rt.render(whole.changed(camera=camera)).colour.any() == sees
