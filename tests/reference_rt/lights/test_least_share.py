"""Lights whose power is a tiny part of all, as that of a lamp beside a sun, are picked as well."""

from typing import Any

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.core.transform import Scale
from reference_rt.scene.build_lights import LEAST_SHARE

FLOOR = rt.Rectangle(transform=(Scale(scale=(3.0, 3.0, 3.0)),))
FAR = rt.Sphere(center=(0.0, 0.0, -3e6))
"""It makes the scene so large that a sun has 1e12 times the power of a lamp."""

SUN = rt.Directional(direction=(0.2, 0.1, -1.0), irradiance=(1.0, 0.5, 0.2))
CAMERA = rt.Perspective(eye=(0.0, -1.0, 5.0), target=(0.0, 0.0, 0.0), fov=40.0)


def scene(lights: Any, **parts: Any) -> rt.Scene:
    return rt.Scene(
        camera=CAMERA,
        film=rt.Film(width=8, height=6),
        shapes=(FLOOR, FAR),
        lights=lights,
        integrator=rt.Direct(),
        **parts,
    )


@pytest.mark.parametrize("integrator", [rt.Direct(), rt.Path(max_depth=3)], ids=["direct", "path"])
@pytest.mark.parametrize("shape", [rt.Rectangle, rt.Sphere, rt.Disk])
def test_a_lamp_with_an_area_is_not_lost(shape: Any, integrator: Any) -> None:
    steps = ({"scale": 0.3}, {"rotate": {"axis": (1, 0, 0), "degrees": 180}})
    lamp = shape(material="lamp", transform=(*steps, {"translate": (0.5, 0.2, 1.5)}))
    glow = {"lamp": rt.Emissive(radiance=(3.0, 4.0, 5.0))}

    def mean(lights: Any, shapes: Any) -> Any:
        lit = scene(lights, materials=glow).changed(shapes=shapes, integrator=integrator)
        return rt.render(lit, spp=256).colour.mean(axis=(0, 1))

    both = mean((SUN,), (FLOOR, FAR, lamp))
    # The lamp's shadow, too: it is there, but dark, in the other picture.
    dark = lamp.model_copy(update={"material": "black"})
    glow["black"] = rt.Emissive(radiance=(0.0, 0.0, 0.0))
    alone = mean((SUN,), (FLOOR, FAR, dark)) + mean((), (FLOOR, FAR, lamp))
    np.testing.assert_allclose(both, alone, rtol=0.02)


@pytest.mark.parametrize("kind", ["point", "spot", "projector"])
def test_a_lamp_beside_a_sun_is_not_lost(kind: str) -> None:
    """The picture is the sum of those of single lights, which have little noise."""
    lamp = {
        "point": rt.Point(position=(0.5, 0.2, 2.0), intensity=(3.0, 4.0, 5.0)),
        "spot": rt.Spot(origin=(0.5, 0.2, 3.0), target=(0.0, 0.0, 0.0), intensity=(9.0, 8.0, 7.0)),
        "projector": rt.Projector(
            origin=(0.5, 0.2, 3.0), target=(0.0, 0.0, 0.0), irradiance=(3.0, 2.0, 1.0), fov=60.0
        ),
    }[kind]
    both, *alone = (
        rt.render(scene(lights), spp=256).colour for lights in ((SUN, lamp), (SUN,), (lamp,))
    )
    np.testing.assert_allclose(
        both.mean(axis=(0, 1)), np.sum(alone, axis=0).mean(axis=(0, 1)), rtol=0.02
    )
    found = scene((SUN, lamp)).light_sources()
    assert found.probability.min() > 0.4 * LEAST_SHARE


def test_many_lamps_are_picked_as_one() -> None:
    """A tree picks among them; by their number they would have most of the samples."""
    lamps = [rt.Point(position=(0.1 * k, 0.0, 2.0), intensity=(1.0,) * 3) for k in range(40)]
    found = scene((SUN, *lamps)).light_sources()
    of_sun = found.probability[found.light == 0].sum()
    assert 1.0 - of_sun == pytest.approx(0.5 * LEAST_SHARE / (1.0 + 0.5 * LEAST_SHARE), rel=1e-6)
    rest = found.probability[found.light != 0]
    np.testing.assert_allclose(rest, rest.mean(), rtol=1e-12)


def test_shares_that_are_large_enough_stay() -> None:
    lights = [rt.Point(position=(0, 0, k + 2), intensity=(k + 1.0,) * 3) for k in range(4)]
    np.testing.assert_allclose(scene(lights).light_sources().probability, [0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize("dim", [1e-300, 1e-9, 1e-3])
@pytest.mark.parametrize("count", [2, 3, 8])
def test_each_light_with_power_has_its_share(dim: float, count: int) -> None:
    lights = [rt.Point(position=(0, 0, 2.0 + k), intensity=(dim**k,) * 3) for k in range(count)]
    dark = rt.Point(position=(0, 0, 9), intensity=(0.0, 0.0, 0.0))
    probability = scene((*lights, dark)).light_sources().probability
    assert probability.sum() == pytest.approx(1.0, rel=1e-12)
    lit = probability[probability > 0.0]
    powered = sum(1 for light in lights if max(light.intensity) > 0.0)
    assert powered - 1 <= len(lit) <= powered  # a product may underflow
    assert lit.min() >= LEAST_SHARE / len(lit) / (1.0 + LEAST_SHARE) * (1.0 - 1e-12)
