"""The rung of Whitted ray tracing follows every perfect direction of every material."""

from pathlib import Path

import numpy as np
import pytest
from counterparts import every_material
from PIL import Image

from comparisons.mitsuba.backend import scalar
from comparisons.rungs import direct, whitted
from comparisons.shapes.stand_ins import coarser
from comparisons.translator import load
from reference_rt import Scene
from reference_rt.cameras.film import Film
from reference_rt.integrators import Whitted
from reference_rt.lights import Constant
from reference_rt.materials import AnyMaterial, Blend, Mask, TwoSided
from reference_rt.scene.build import build_tables

MATERIALS = (
    "silver", "gold", "glass", "pane", "grey", "floor", "brushed", "cast", "frosted", "coat",
    "dull", "car", "petal", "toy", "wax", "leaf", "mix", "sheet", "dents", "tiles",
)  # fmt: skip

SHAPES = """
camera: {type: perspective, eye: [0.4, 1, 4], target: [0, 0, 0], fov: 50}
materials: {outer: {type: diffuse}, grey: {type: diffuse, reflectance: [0.2, 0.5, 0.7]}}
shapes:
  - {type: rectangle, material: outer, transform: [{rotate: {axis: [1, 2, 0], degrees: 9}}]}
  - {type: sphere, material: grey, transform: [{translate: [0.3, 0, -2]}]}
"""


@pytest.fixture(scope="module")
def scene(image_folder: Path) -> Scene:
    return every_material(image_folder)


def reachable(scene: Scene, *names: str) -> dict[str, AnyMaterial]:
    """These materials and those nested in them alone: of others might be one with more layers."""
    found: dict[str, AnyMaterial] = {}
    for name in names:
        material = scene.materials[name]
        inner = [getattr(material, field, None) for field in ("base", "back", "first", "second")]
        found |= {name: material, **reachable(scene, *(n for n in inner if n is not None))}
    return found


def test_every_material_that_can_be_nested_is_there(scene: Scene) -> None:
    assert {*MATERIALS, "lamp"} == set(scene.materials)


@pytest.mark.cases(3)
@pytest.mark.parametrize("wrapper", ["mask", "blend"])
@pytest.mark.parametrize("name", MATERIALS)
def test_what_lies_behind_is_seen_through_it(scene: Scene, name: str, wrapper: str) -> None:
    """Through a mask over it, and through a clear pane that it is blended with: of the components
    of Mitsuba's BSDF that is the last, or one of the first."""
    outer = {
        "mask": Mask(base=name, opacity=0.3),
        "blend": Blend(first="pane", second=name, weight=0.4),
    }[wrapper]
    shapes = Scene.parse(SHAPES)
    seen = scene.changed(
        camera=shapes.camera,
        film=Film(width=7, height=6),
        integrator=Whitted(max_depth=3),
        materials={**reachable(scene, name, "pane", "grey"), "outer": outer},
        shapes=shapes.shapes,
    )
    with scalar():
        found = whitted(seen, build_tables(seen), load(seen))
    assert found.status == "agree", found.reason


OPAQUE = ("silver", "gold", "grey", "floor", "brushed", "cast", "coat", "dull", "dents", "tiles")


@pytest.mark.cases(3)
@pytest.mark.parametrize("back", OPAQUE)
@pytest.mark.parametrize("front", ["silver", "floor", "dull", "mirrors"])
def test_the_back_of_two_sides(scene: Scene, front: str, back: str) -> None:
    """Mitsuba numbers the components of both sides one after the other, but the front's last one
    selects all of the back's."""
    shapes = Scene.parse(
        SHAPES.replace("axis: [1, 2, 0], degrees: 9", "axis: [1, 2, 0], degrees: 170")
    )
    mirrors = Blend(first="silver", second="gold", weight=0.4)
    seen = scene.changed(
        camera=shapes.camera,
        film=Film(width=7, height=6),
        integrator=Whitted(max_depth=3),
        lights=[Constant(radiance=(0.3, 0.5, 0.4))],
        materials={
            **reachable(scene, *{front, back, "silver", "gold", "grey"} - {"mirrors"}),
            "mirrors": mirrors,
            "outer": TwoSided(base=front, back=back),
        },
        shapes=shapes.shapes,
    )
    with scalar():
        found = whitted(seen, build_tables(seen), load(seen))
    assert found.status == "agree", found.reason


PROJECTED = """
camera: {{type: perspective, eye: [0, 0, 1], target: [0, 0, 0], fov: 90}}
film: {{width: 48, height: 40}}
integrator: {{type: whitted}}
textures: {{image: {{type: bitmap, file: noise.png}}}}
shapes:
  - {{type: rectangle, transform: [{{scale: 3}}, {{rotate: {{axis: [1, 2, 0], degrees: 9}}}}]}}
lights:
  - {}
"""

LIGHTS = {
    "projector": "{type: projector, origin: [0.2, 0.1, 1], target: [0, 0, 0], irradiance: image}",
    "spot": "{type: spot, origin: [0.2, 0.1, 1], target: [0, 0, 0], cutoff_angle: 40, "
    "intensity: 5, texture: image}",
}


@pytest.mark.cases(1)
@pytest.mark.parametrize("light", LIGHTS)
def test_projected_images(light: str, tmp_path: Path) -> None:
    """Whose slopes amplify the error of a point, though the materials are flat."""
    noise = np.random.default_rng(4).integers(0, 255, (512, 512, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    scene = Scene.parse(PROJECTED.format(LIGHTS[light]), folder=tmp_path)
    with scalar():
        counterpart = load(scene)
        for rung in (direct, whitted):
            found = rung(scene, scene.tables, counterpart)
            assert found.status == "agree", found.reason


LAMPS = {
    "sphere": "type: sphere",
    "disk": "type: disk",
    "rectangle": "type: rectangle",
    "box": "type: box",
    "triangle": "type: triangle, v0: [0, 0, 0], v1: [1, 0, 0], v2: [0, 1, 0]",
    "polygon": "type: polygon, rings: [[[0, 0], [1, 0], [0.2, 1]]]",
    "cylinder": "type: cylinder",
    "cone": "type: cone",
    "torus": "type: torus",
    "quadric": "type: quadric, coefficients: [1, 1, 1, 0, 0, 0, 0, 0, 0, -1], "
    "lower: [-1, -1, -1], upper: [1, 1, 1]",
}

MAPS = {
    "as it is": "{scale: 1}",
    "stretched": "{scale: [0.5, 0.8, 0.3]}, {rotate: {axis: [1, 2, 3], degrees: 40}}",
}

UNDER_A_LAMP = """
camera: {{type: perspective, eye: [0, -6, 3], target: [0, 0, 0], up: [0, 0, 1]}}
film: {{width: 12, height: 12}}
integrator: {{type: whitted}}
materials: {{lamp: {{type: emissive, radiance: 2}}}}
shapes:
  - {{type: rectangle, transform: [{{scale: 5}}, {{translate: [0, 0, -2]}}]}}
  - {{{}, material: lamp, transform: [{}]}}
lights: [{{type: point, position: [1, -3, 4], intensity: 3}}]
"""


@pytest.mark.cases(2)
@pytest.mark.parametrize("how", MAPS)
@pytest.mark.parametrize("lamp", LAMPS)
def test_lamps_of_every_shape(lamp: str, how: str) -> None:
    """The same shapes are lights in both; of a mesh that stands in for a lamp no triangle is one,
    and there would be thousands."""
    scene = Scene.parse(UNDER_A_LAMP.format(LAMPS[lamp], MAPS[how]))
    with scalar(), coarser(0.35):
        found = whitted(scene, scene.tables, load(scene))
    assert found.status == "agree", found.reason
    assert found.numbers["explained"] == 0


LOW = """
camera: {{type: perspective, eye: [0, -4, 5], target: [0, 0.5, 0], up: [0, 0, 1], fov: 50}}
film: {{width: 24, height: 20}}
integrator: {{type: whitted}}
materials: {{lamp: {{type: emissive, radiance: 2}}}}
shapes:
  - {{type: rectangle, transform: [{{scale: 5}}]}}
  - {{{}, material: lamp, transform: [{{scale: 0.02}}, {{rotate: {{axis: [1, 0, 0], degrees: 60}}}},
     {{translate: [0.3, 3, {}]}}]}}
lights: [{{type: point, position: [1, -3, 4], intensity: 3}}]
"""


@pytest.mark.cases(2)
@pytest.mark.parametrize("height", [0.03, 0.1, 0.3])
@pytest.mark.parametrize("lamp", ["sphere", "disk", "rectangle", "box", "triangle"])
def test_lamps_low_above_the_ground(lamp: str, height: float) -> None:
    """Shadow rays at grazing angles start a tenth of a pixel away from their surface."""
    scene = Scene.parse(LOW.format(LAMPS[lamp], height))
    with scalar():
        found = whitted(scene, scene.tables, load(scene))
    assert found.status == "agree", found.reason
    assert found.numbers["explained"] <= 3


LAYERS = """
camera: {type: perspective, eye: [0, -6, 3], target: [0, 0, 0], up: [0, 0, 1]}
film: {width: 24, height: 20}
integrator: {type: whitted}
materials: {lamp: {type: emissive, radiance: 2}}
shapes:
  - {type: rectangle, transform: [{scale: 5}, {translate: [0, 0, -2]}]}
  - type: mesh
    material: lamp
    vertices: [[-1, 0, 1], [1, 0, 1], [0, 1, 1],
               [-1, 0, 1.001], [1, 0, 1.001], [0, 1, 1.001],
               [1, 0, 1.5], [1, 1, 1.5], [2, 0, 1.5]]
    faces: [[0, 2, 1], [3, 5, 4], [6, 7, 8]]
"""


def test_triangles_of_a_lamp_that_hide_others_of_it() -> None:
    """By less than Mitsuba's shadow epsilon, a thousandth of the distance."""
    scene = Scene.parse(LAYERS)
    with scalar():
        found = whitted(scene, scene.tables, load(scene))
    assert found.status == "agree", found.reason
    assert found.numbers["explained"] <= 3


VEILS = """
camera: {type: perspective, eye: [0, 0, 4], target: [0, 0, 0], fov: 40}
film: {width: 8, height: 8}
integrator: {type: whitted}
materials:
  black: {type: diffuse, reflectance: 0}
  veil: {type: mask, base: black, opacity: 0.99}
  lamp: {type: emissive, radiance: 1000}
shapes:
  - {type: rectangle, material: veil, transform: [{scale: 3}]}
  - {type: rectangle, material: veil, transform: [{scale: 3}, {translate: [0, 0, -0.5]}]}
  - {type: rectangle, material: lamp, transform: [{scale: 3}, {translate: [0, 0, -1]}]}
"""


@pytest.mark.slow
def test_rays_with_just_the_least_contribution() -> None:
    """0.01 times 0.01, which float32 rounds to less: each of such pixels is explained."""
    scene = Scene.parse(VEILS)
    with scalar():
        found = whitted(scene, scene.tables, load(scene))
        other = load(Scene.parse(VEILS.replace("0.99", "0.98")))
        wrong = whitted(scene, scene.tables, other)
    assert found.status in ("agree", "reference-limited"), found.reason
    assert wrong.status == "differ"


def test_two_planes_in_one_place() -> None:
    """Of which each renderer reports another one, with another material."""
    scene = Scene.parse("""
camera: {type: perspective, eye: [2, 1, 3], target: [0, 0, 0]}
film: {width: 24, height: 18}
materials: {red: {type: diffuse, reflectance: [0.8, 0.1, 0.1]}, blue: {type: diffuse,
  reflectance: [0.1, 0.1, 0.8]}}
shapes:
  - {type: plane, material: red, transform: [{rotate: {axis: [1, 0.3, 0], degrees: -70}}]}
  - {type: plane, material: blue, transform: [{scale: [0.7, 0.9, -0.4]},
     {rotate: {axis: [1, 0.3, 0], degrees: -70}}]}
lights: [{type: point, position: [1, 3, 4], intensity: 9}]
""")
    with scalar():
        found = whitted(scene, scene.tables, load(scene))
    assert found.status in ("agree", "reference-limited"), found.reason


FLATTENED = """
camera: {type: pinhole, eye: [-0.8, 4.8, 2.2], target: [0.2, 0.3, -0.3], film_width: 1.05,
  film_distance: 1}
film: {width: 16, height: 12}
shapes:
  - type: cylinder
    z_min: -0.3
    z_max: 1.2
    radius: 0.8
    transform:
      - matrix: [[0.93, -0.68, -0.2, 0], [0.12, 0.43, -0.24, 0.1], [-0.38, -0.41, 1.23, -0.1]]
      - {rotate: {axis: [0, 0, 1], degrees: -129}}
      - {translate: [0.2, 1.7, 0.2]}
lights: [{type: point, position: [-1.5, 5.5, 0.7], intensity: 11}]
"""
"""A sheared cylinder is an instance in Mitsuba, whose rays must not meet the cylinder again."""


BESIDE_A_WALL = """
camera: {type: orthographic, eye: [-3, 0, 0.3], target: [-0.001, 0, 0], up: [0, 0, 1],
  width: 4.0e-4}
film: {width: 20, height: 15}
integrator: {type: whitted}
materials: {floor: {type: mirror}, wall: {type: diffuse}}
shapes:
  - {type: rectangle, material: floor}
  - {type: rectangle, material: wall, transform: [{scale: 0.004}, {rotate: {axis: [0, 1, 0],
     degrees: -90}}]}
  - {type: plane, transform: [{translate: [0, 0, -1]}]}
lights: [{type: point, position: [-2, 0.3, 1], intensity: 9}, {type: constant, radiance: 0.1}]
"""
"""Rays that leave the mirror at a slope of a tenth meet a wall within 0.003, which some pass if
they start Mitsuba's ray epsilon off it.  The plane is a mesh a million large."""


@pytest.mark.parametrize("scene", [FLATTENED, BESIDE_A_WALL], ids=["flattened", "beside a wall"])
def test_where_rays_start(scene: str) -> None:
    """No pixel needs the arbiter, which would not know of an edge there."""
    parsed = Scene.parse(scene)
    with scalar():
        found = whitted(parsed, parsed.tables, load(parsed), 200)
    assert found.status == "agree", found.reason
    assert found.numbers["explained"] == 0
    assert found.numbers["lit"] > 15


ON_THE_FLOOR = """
camera: {type: perspective, eye: [2.2, 2.6, 5.4], target: [0, 0.5, 0], fov: 20}
film: {width: 24, height: 18}
integrator: {type: whitted}
materials: {glass: {type: dielectric}, felt: {type: diffuse, reflectance: [0.1, 0.4, 0.2]}}
shapes:
  - {type: plane, material: felt, transform: [{rotate: {axis: [1, 0, 0], degrees: -90}}]}
  - {type: box, material: glass, transform: [{scale: 0.7}, {rotate: {axis: [0, 1, 0],
     degrees: 25}}, {translate: [0, 0.7, 0]}]}
lights: [{type: point, position: [-2, 5, 4], intensity: 60}, {type: constant, radiance: 0.4}]
"""


def test_glass_that_stands_on_the_floor() -> None:
    """Of a ray that leaves the glass at the bottom float32 decides whether it meets the floor: the
    arbiter's rays show it, and the tree says why."""
    scene = Scene.parse(ON_THE_FLOOR)
    with scalar():
        found = whitted(scene, scene.tables, load(scene), 200)
        wrong = load(Scene.parse(ON_THE_FLOOR.replace("[0.1, 0.4, 0.2]", "[0.1, 0.4, 0.3]")))
        faulty = whitted(scene, scene.tables, wrong, 200)
    assert found.status in ("agree", "reference-limited"), found.reason
    assert faulty.status == "differ"


def test_a_lamp_folded_back_on_itself() -> None:
    """Two of its triangles lie in one place, with their fronts on either side: the arbiter finds
    Mitsuba's values beside a pixel because of that, not because of a fault."""
    scene = Scene.parse("""
camera: {type: perspective, eye: [2, 1, 3], target: [0, 0, -0.5]}
film: {width: 24, height: 18}
integrator: {type: whitted}
materials: {lamp: {type: emissive, radiance: 3}}
shapes:
  - {type: rectangle, transform: [{scale: 9}, {translate: [0, 0, -2]}]}
  - type: mesh
    material: lamp
    transform: [{rotate: {axis: [1, 2, 0.3], degrees: 137}}, {translate: [0.1, 0.2, 0.7]}]
    vertices: [[1, 0, -0.4], [0, 1, -0.0858], [-1, 0, 0.228], [0, -1, 0.542], [1.3, 0, -0.4],
     [-0.3, 1, -0.0858], [-0.7, 0, 0.228], [-0.3, -1, 0.542]]
    faces: [[0, 1, 4], [1, 2, 5], [2, 3, 6], [1, 5, 4], [2, 6, 5], [3, 7, 6]]
lights: [{type: point, position: [2, 3, 4], intensity: 9}]
""")
    with scalar():
        found = whitted(scene, scene.tables, load(scene), 100)
    assert found.status in ("agree", "reference-limited"), found.reason


FLAT = """
camera: {{eye: [242, -517, 525], target: [272, -559, 506], fov: 1, type: perspective}}
film: {{width: 8, height: 8}}
integrator: {{type: whitted}}
shapes:
  - {{type: sphere, transform: [{{rotate: {{axis: [1, 1, 1], degrees: 1}}}},
     {{scale: [1, {flat}, 1]}}, {turn}{{translate: [34, -70, 63]}}, {{scale: 8}}]}}
lights: [{{type: point, position: [0, 0, 1], intensity: {intensity}}}]
"""


@pytest.mark.parametrize("turn", ["", "{rotate: {axis: [1, 2, 3], degrees: 20}}, "])
@pytest.mark.parametrize("flat", [2e-2, 2e-3, 2e-4, 2e-5])
def test_flat_ellipsoids(flat: float, turn: str) -> None:
    """Mitsuba projects a hit onto the sphere that it made of one, which moves it by much more than
    it is off: by a fifth where float32 resolves 0.001."""
    right, wrong = (
        Scene.parse(FLAT.format(flat=flat, turn=turn, intensity=intensity))
        for intensity in (1.0, 1.3)
    )
    with scalar():
        found = whitted(right, right.tables, load(right))
        faulty = whitted(right, right.tables, load(wrong))
    assert found.status in ("agree", "reference-limited"), found.reason
    assert found.status == "agree" or flat < 1e-3
    assert faulty.status == "differ"
