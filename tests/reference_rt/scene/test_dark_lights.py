"""Lights without power, and with too much of it."""

import pytest

import reference_rt as rt

DARK = {
    "point": {"lights": (rt.Point(position=(0, 3, 0), intensity=(0, 0, 0)),)},
    "spot": {"lights": (rt.Spot(origin=(0, 3, 0), target=(0, 0, 0), intensity=(0, 0, 0)),)},
    "directional": {"lights": (rt.Directional(direction=(0, -1, 0), irradiance=(0, 0, 0)),)},
    "constant": {"lights": (rt.Constant(radiance=(0, 0, 0)),)},
    "ambient": {"lights": (rt.Ambient(radiance=(1, 1, 1)),)},
    "lamp": {"shapes": (rt.Sphere(center=(0, 3, 0), material="dark"), rt.Sphere())},
    "no area": {"shapes": (rt.Sphere(radius=1e-200, material="lamp"), rt.Sphere())},
}


def test_a_light_without_power_or_area_is_never_picked():
    lamps = {"dark": rt.Emissive(radiance=(0, 0, 0)), "lamp": rt.Emissive(radiance=(1, 1, 1))}
    for name, parts in DARK.items():
        scene = rt.Scene(**{"shapes": (rt.Sphere(),)} | parts, materials=lamps)
        assert scene.tables.lights.choice is None, name
        bright = rt.Point(position=(0, 5, 0), intensity=(1, 1, 1))
        scene = scene.changed(lights=(bright, *scene.lights))
        chance = scene.tables.lights.choice.probability
        assert sorted(chance) == [0.0] * (len(chance) - 1) + [1.0], name


def test_a_dark_lamp_is_black():
    """Also to paths that hit it, and as the only light."""
    scene = rt.Scene(
        film=rt.Film(width=4, height=4),
        sampler=rt.Sobol(spp=4),
        materials={"dark": rt.Emissive(radiance=(0, 0, 0), base="grey"), "grey": rt.Diffuse()},
        shapes=(rt.Sphere(material="dark"), rt.Sphere(center=(0, 3, 0), material="dark")),
    )
    with pytest.warns(rt.SceneWarning, match="every light has radiance or intensity 0"):
        assert not rt.render(scene).colour.any()


EXTREMES = [
    (rt.Point(position=(0, 5, 0), intensity=(1e308, 1e308, 1e308)),) * 2,
    (rt.Directional(direction=(0, -1, 0), irradiance=(1e308, 1e308, 1e308)),) * 2,
    (rt.Constant(radiance=(1e308, 1e308, 1e308)), rt.Point(position=(0, 5, 0), intensity=1)),
    (rt.Point(position=(0, 5, 0), intensity=(1e308, 1e308, 1e308)),) * 9,
    (rt.Spot(origin=(0, 5, 0), target=(0, 0, 0), intensity=(1, 1, 1), cutoff_angle=1e-9),) * 2,
]


@pytest.mark.parametrize(
    "lights", EXTREMES, ids=["point", "directional", "constant", "tree", "thin"]
)
def test_probabilities_of_extremes(lights):
    """They add to 1, where powers overflow or a beam is thinner than rounding."""
    scene = rt.Scene(shapes=(rt.Sphere(),), lights=lights)
    chance = scene.tables.lights.choice.probability
    assert len(chance) == len(lights)
    assert (chance >= 0.0).all()
    assert chance.sum() == pytest.approx(1.0)
