"""Light on the counterparts of shapes that Mitsuba has in other ways: proxies, instances, disks."""

from typing import Any

import pytest
from counterparts import coarse_meshes, faulty_counterpart

from comparisons.mitsuba.translate import load
from comparisons.rungs import direct, whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.scene import Scene

TEXT = """
camera: {type: perspective, eye: [0.3, 2.2, 8], target: [0, 0.5, 0], fov: 40}
film: {width: 48, height: 32}
integrator: {type: whitted, max_depth: 4}
materials:
  floor: {type: diffuse, reflectance: [0.8, 0.7, 0.6]}
  red: {type: diffuse, reflectance: [0.7, 0.2, 0.1]}
  mirror: {type: mirror, reflectance: [0.9, 0.8, 0.7]}
  glass: {type: dielectric, interior_ior: 1.5}
  lamp: {type: emissive, radiance: [9, 8, 7], base: floor}
groups:
  g: [{type: box, material: red, transform: [{scale: 0.2}]},
      {type: sphere, radius: 0.2, center: [0, 0.4, 0]}]
shapes:
  - {type: plane, material: floor, transform: [{rotate: {axis: [1, 0, 0], degrees: -90}}]}
  - {type: disk, material: lamp,
     transform: [{scale: [0.6, 0.4, 1]}, {rotate: {axis: [1, 0, 0], degrees: 90}},
       {translate: [0, 3.5, 0]}]}
  - {type: sphere, radius: 0.5, material: red,
     transform: [{scale: [1, 1.4, 0.7]}, {translate: [-2.5, 0.8, 0]}]}
  - {type: cylinder, radius: 0.4, material: floor,
     transform: [{rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [-1.2, 0, 0.5]}]}
  - {type: cone, radius: 0.5, material: red,
     transform: [{rotate: {axis: [1, 0, 0], degrees: -90}}]}
  - {type: torus, major_radius: 0.5, minor_radius: 0.2, material: mirror,
     transform: [{rotate: {axis: [1, 0, 0], degrees: 40}}, {translate: [1.5, 0.7, 0]}]}
  - {type: polygon, material: red,
     rings: [[[0, 1], [0.6, -0.8], [-1, 0.3], [1, 0.3], [-0.6, -0.8]]],
     transform: [{scale: 0.6}, {translate: [2.7, 0.8, -0.5]}]}
  - {type: instance, group: g, transform: [{scale: [1, 1.5, 1]}, {translate: [0.8, 0.3, 1.5]}]}
  - {type: quadric, capped: true, material: glass,
     coefficients: [1, 1, -1, 0, 0, 0, 0, 0, 0, -0.2],
     lower: [-0.6, -0.6, -0.6], upper: [0.6, 0.6, 0.6],
     transform: [{rotate: {axis: [1, 0, 0], degrees: -70}}, {translate: [-0.5, 0.7, 1.8]}]}
lights:
  - {type: point, position: [3, 4, 4], intensity: [10, 11, 12]}
"""


@pytest.fixture(scope="module", autouse=True)
def coarse() -> Any:
    with coarse_meshes(512, 256):
        yield


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.parse(TEXT)


def test_the_same_light(scene: Scene, tables: SceneTables) -> None:
    counterpart = load(scene)
    assert counterpart.no_light_reason == ""
    names = {s.name for found in counterpart.stand_ins().values() for s in found}
    assert names == {"cone", "torus", "quadric"}
    assert len(counterpart.notes()) == 3
    for rung, pixels in ((direct, 300), (whitted, 800)):
        result = rung(scene, tables, counterpart, pixels)
        # In mirrors and glass that are meshes, edges are a little wider.
        assert result.status in ("agree", "reference-limited"), result.reason
        assert result.numbers["explained"] < 0.03 * result.numbers.get(
            "pixels", result.numbers.get("rays")
        )


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("{scale: [0.6, 0.4, 1]}", "{scale: [0.603, 0.4, 1]}"),  # the lamp's area
        ("degrees: 90}}", "degrees: -90}}"),  # it shines upwards
        ("[9, 8, 7]", "[9, 8, 7.1]"),
    ],
)
def test_another_lamp_is_distinguished(
    scene: Scene, tables: SceneTables, right: str, wrong: str
) -> None:
    other = faulty_counterpart(TEXT, right, wrong)
    assert whitted(scene, tables, other, 200).status == "differ"
