"""Lamps that are narrower than float32's error: Mitsuba's shadow rays pass them by, and its corners
are rounded.  And lamps right in front of another one, within its shadow epsilon."""

import pytest

from comparisons.rungs.direct import direct
from comparisons.rungs.whitted import whitted
from comparisons.translator import load
from reference_rt.rendering.scene import Scene

SCENE = """
camera: {{type: perspective, eye: [0, 3, 4], target: [0, 0, 0], fov: 30}}
film: {{width: 12, height: 8}}
integrator: {{type: whitted}}
materials: {{lamp: {{type: emissive, radiance: [0, 0, {radiance}]}}}}
shapes:
  - {{type: plane, transform: [{{rotate: {{axis: [1, 0, 0], degrees: -90}}}}]}}
  - {lamp}
lights: [{{type: constant, radiance: 0.5}}]
"""
LAMPS = {
    "triangle": "{{type: triangle, material: lamp, v0: [0.3, 1.71, -0.4], "
    "v1: [-0.8, 1.33, 0.27], v2: [-0.8, {end!r}, 0.27]}}",
    "rectangle": "{{type: rectangle, material: lamp, transform: [{{scale: [{width}, 0.6, 1]}}, "
    "{{rotate: {{axis: [1, 0.3, 0.2], degrees: 70}}}}, {{translate: [0.1, 1.6, 0.2]}}]}}",
    "box": "{{type: box, material: lamp, transform: [{{scale: [{width}, 0.6, {width}]}}, "
    "{{rotate: {{axis: [1, 0.3, 0.2], degrees: 70}}}}, {{translate: [0.1, 1.6, 0.2]}}]}}",
    "disk": "{{type: disk, material: lamp, transform: [{{scale: [{width}, 0.6, 1]}}, "
    "{{rotate: {{axis: [1, 0.3, 0.2], degrees: 70}}}}, {{translate: [0.1, 1.6, 0.2]}}]}}",
}


def scene_of(lamp: str, width: float, radiance: float = 9.0) -> Scene:
    text = LAMPS[lamp].format(width=width, end=1.33 - width)
    return Scene.parse(SCENE.format(lamp=text, radiance=radiance))


@pytest.mark.parametrize("width", [1e-7, 1e-5])
@pytest.mark.parametrize("lamp", LAMPS)
def test_a_lamp_that_shadow_rays_pass_by_is_no_fault(lamp: str, width: float) -> None:
    scene = scene_of(lamp, width)
    counterpart = load(scene)
    for found in (
        direct(scene, scene.tables, counterpart, 200),
        whitted(scene, scene.tables, counterpart),
    ):
        assert found.status in ("agree", "reference-limited"), f"{found.name}: {found.reason}"


@pytest.mark.parametrize("lamp", LAMPS)
def test_a_lamp_that_is_wide_enough_is_judged(lamp: str) -> None:
    scene, brighter = scene_of(lamp, 0.01), scene_of(lamp, 0.01, radiance=9.02)
    for rung, rays in ((direct, 200), (whitted, 96)):
        assert rung(scene, scene.tables, load(scene), rays).status == "agree"
        assert rung(scene, scene.tables, load(brighter), rays).status == "differ"


BEFORE = """
camera: {type: perspective, eye: [-300, 0, 40], target: [-200, 0, 0], fov: 30}
film: {width: 12, height: 8}
materials: {lamp: {type: emissive, radiance: 1}, other: {type: emissive, radiance: 5}}
shapes:
  - {type: plane}
  - {type: rectangle, material: lamp,
     transform: [{rotate: {axis: [0, 1, 0], degrees: -90}}, {translate: [0, 0, 2]}]}
  - {type: SHAPE, material: other,
     transform: [{scale: 3}, {rotate: {axis: [0, 1, 0], degrees: -90}}, {translate: [-GAP, 0, 2]}]}
"""
"""On the plane 250 units away a shadow ray ends 0.2 before the lamp, behind the other one."""


@pytest.mark.parametrize("shape", ["rectangle", "disk"])
@pytest.mark.parametrize("gap", [0.05, 2.0])
def test_a_lamp_in_front_is_not_taken_for_the_one_behind(shape: str, gap: float) -> None:
    scene = Scene.parse(BEFORE.replace("SHAPE", shape).replace("GAP", str(gap)))
    found = direct(scene, scene.tables, load(scene), 200)
    assert found.status in ("agree", "reference-limited"), found.reason
