"""Single lights in Mitsuba."""

import numpy as np
import pytest

import reference_rt as rt
from comparisons.lights.constant import ambient_of
from comparisons.mitsuba.backend import mitsuba
from comparisons.translator import load
from reference_rt.lights import Point
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Sphere


def test_ambient_lights_add_up() -> None:
    lights = (rt.Ambient(radiance=(1.0, 0.2, 0.0)), Point(position=(0, 0, 0), intensity=9.0))
    assert ambient_of((*lights, rt.Ambient(radiance=0.5))) == [1.5, 0.7, 0.5]
    assert ambient_of(lights[1:]) == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, -1), (0.3, -0.9, 0.3)])
def test_a_spot_along_any_axis_lights_what_lies_there(axis: tuple[float, float, float]) -> None:
    """Mitsuba's map of a light has no inverse where `up` is along its axis."""
    spot = rt.Spot(origin=(0, 0, 0), target=axis, intensity=1.0, cutoff_angle=20)
    scene = Scene(shapes=(Sphere(center=(9, 9, 9)),), lights=(spot,))
    mi = mitsuba()
    (light,) = load(scene).mi_scene.emitters()
    it = mi.SurfaceInteraction3f()
    direction = np.array(axis) / np.linalg.norm(axis)
    it.p = mi.Point3f(*(2.0 * direction).tolist())
    _, weight = light.sample_direction(it, mi.Point2f(0.5, 0.5))
    np.testing.assert_allclose(np.ravel(weight), 0.25, rtol=1e-5)
