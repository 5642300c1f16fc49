"""The rung of direct light finds small faults where it allows for Mitsuba's errors."""

from pathlib import Path

import numpy as np
import pytest
from builders import SCENES
from counterparts import faulty_counterpart
from PIL import Image

from comparisons.mitsuba.backend import scalar
from comparisons.rungs import direct
from comparisons.shapes.stand_ins import coarser
from comparisons.translator import load
from reference_rt import Scene

SPOT = """
camera: {type: perspective, eye: [0, 1, 6], target: [0, 0, 0], fov: 60}
film: {width: 48, height: 40}
shapes: [{type: rectangle, transform: [{scale: 6}, {rotate: {axis: [1, 2, 0], degrees: 9}}]}]
lights:
  - {type: spot, origin: [0.2, 0.1, 3], target: [0, 0, 0], intensity: 5, cutoff_angle: 30,
     beam_width: 29.9}
"""

FAULTS = {
    "a wider spot": (SPOT, "cutoff_angle: 30,\n     beam_width: 29.9", "cutoff_angle: 31"),
    "a spot with a wider beam": (SPOT, "beam_width: 29.9", "beam_width: 29"),
    "grain across": ("brushed_cone", "alpha: [0.0583, 0.488]", "alpha: [0.488, 0.0583]"),
    "a bit less grain": ("brushed_cone", "alpha: [0.0583, 0.488]", "alpha: [0.059, 0.488]"),
    "another index": ("critical_rough_glass", "exterior_ior: 1.1", "exterior_ior: 1.1005"),
}


def text_of(source: str) -> str:
    path = SCENES / "regressions" / f"{source}.yaml"
    return source if "\n" in source else path.read_text(encoding="utf-8")


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_found(name: str) -> None:
    source, right, wrong = FAULTS[name]
    scene = Scene.parse(text_of(source))
    with scalar(), coarser(0.35):
        faulty = faulty_counterpart(text_of(source), right, wrong)
        assert direct(scene, scene.tables, load(scene), 300).status == "agree"
        assert direct(scene, scene.tables, faulty, 300).status == "differ"


def test_light_beyond_the_edge_of_a_spot_is_found() -> None:
    """As bright as ours within our cone, so that only what lies outside of it tells."""
    wide = "cutoff_angle: 40,\n     beam_width: 39.9"
    with scalar():
        faulty = faulty_counterpart(SPOT, "cutoff_angle: 30,\n     beam_width: 29.9", wide)
        scene = Scene.parse(SPOT)
        found = direct(scene, scene.tables, faulty, 300)
    assert found.status == "differ"


TEXELS = """
camera: {{type: perspective, eye: [0, -6, 3], target: [0, 0, 0], up: [0, 0, 1]}}
film: {{width: 16, height: 12}}
textures: {{tiles: {{type: bitmap, file: tiles.png, filter: nearest{}}}}}
materials: {{lamp: {{type: emissive, radiance: tiles}}}}
shapes:
  - {{type: rectangle, transform: [{{scale: 5}}, {{translate: [0, 0, -2]}}]}}
  - {{{}, material: lamp,
     transform: [{{rotate: {{axis: [1, 0, 0], degrees: 180}}}}, {{scale: 0.5}}]}}
"""

LAMPS = {
    "rectangle": "type: rectangle",
    "disk": "type: disk",
    "sphere": "type: sphere",
    "box": "type: box",
    "triangle": "type: triangle, v0: [-1, -1, 0], v1: [1, -1, 0], v2: [0, 1, 0]",
}


@pytest.mark.cases(2)
@pytest.mark.parametrize("lamp", LAMPS)
def test_edges_of_texels_on_lamps(lamp: str, tmp_path: Path) -> None:
    """float32 takes either texel; a shift by a tenth of a texel elsewhere is found."""
    texels = np.random.default_rng(3).integers(20, 255, (8, 8, 3), dtype=np.uint8)
    Image.fromarray(texels).save(tmp_path / "tiles.png")
    text, wrong = (TEXELS.format(uv, LAMPS[lamp]) for uv in ("", ", uv: {offset: [0.1, 0.1]}"))
    scene = Scene.parse(text, folder=tmp_path)
    with scalar():
        right = direct(scene, scene.tables, load(scene), 100)
        faulty = load(Scene.parse(wrong, folder=tmp_path))
        found = direct(scene, scene.tables, faulty, 100)
    assert right.status in ("agree", "reference-limited"), right.reason
    assert found.status == "differ"


FAR = """
camera: {type: perspective, eye: [0, -6, 3], target: [0, 0, 0], up: [0, 0, 1]}
film: {width: 16, height: 12}
textures: {noise: {type: bitmap, file: noise.png}}
materials: {lamp: {type: emissive, radiance: noise}}
shapes:
  - {type: rectangle, transform: [{scale: 5}, {translate: [0, 0, -2]}]}
  - {type: rectangle, material: lamp, transform: [{rotate: {axis: [1, 0, 0], degrees: 89.7}},
     {scale: 0.3}, {translate: [0, 9, -1.98]}]}
"""


def test_textured_lamps_far_away_at_grazing_angles(tmp_path: Path) -> None:
    """float32 moves the point on the lamp by some texels."""
    texels = np.random.default_rng(4).integers(0, 255, (256, 256, 3), dtype=np.uint8)
    Image.fromarray(texels).save(tmp_path / "noise.png")
    scene = Scene.parse(FAR, folder=tmp_path)
    with scalar():
        found = direct(scene, scene.tables, load(scene), 300)
    assert found.status in ("agree", "reference-limited"), found.reason


IN_ONE_PLACE = {
    "two planes": """
  - {type: plane, material: red, transform: [{rotate: {axis: [1, 0.3, 0], degrees: -70}}]}
  - {type: plane, material: blue, transform: [{scale: [0.7, 0.9, -0.4]},
     {rotate: {axis: [1, 0.3, 0], degrees: -70}}]}""",
    "the lamp's own triangles": """
  - type: mesh
    material: lamp
    smooth: true
    vertices: [[0.97, 0.97, 0.97], [0.98, -0.98, -0.98], [-0.56, 0.56, -0.56], [-0.55, -0.55, 0.55]]
    faces: [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]""",
    "a lamp without thickness": """
  - {type: rectangle, transform: [{scale: 9}, {translate: [0, 0, -2]}]}
  - type: mesh
    material: lamp
    transform: [{rotate: {axis: [1, 2, 0], degrees: 100}}]
    vertices: [[-1, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, 1.0e-12]]
    faces: [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]""",
    "a lamp folded back on itself": """
  - {type: rectangle, transform: [{scale: 9}, {translate: [0, 0, -2]}]}
  - type: mesh
    material: lamp
    transform: [{rotate: {axis: [1, 2, 0.3], degrees: 137}}, {translate: [0.1, 0.2, 0.7]}]
    vertices: [[1, 0, -0.4], [0, 1, -0.0858], [-1, 0, 0.228], [0, -1, 0.542], [1.3, 0, -0.4],
     [-0.3, 1, -0.0858], [-0.7, 0, 0.228], [-0.3, -1, 0.542]]
    faces: [[0, 1, 4], [1, 2, 5], [2, 3, 6], [1, 5, 4], [2, 6, 5], [3, 7, 6]]""",
}


@pytest.mark.cases(2)
@pytest.mark.parametrize("which", IN_ONE_PLACE)
def test_surfaces_in_one_place(which: str) -> None:
    """Of which each renderer may report another one, or another side."""
    scene = Scene.parse(
        "camera: {type: perspective, eye: [2, 1, 3], target: [0, 0, 0]}\n"
        "film: {width: 24, height: 18}\n"
        "materials: {red: {type: diffuse, reflectance: [0.8, 0.1, 0.1]}, blue: {type: diffuse,\n"
        "  reflectance: [0.1, 0.1, 0.8]}, base: {type: principled_thin, diff_trans: 0.4},\n"
        "  lamp: {type: emissive, radiance: 3, base: base}}\n"
        f"shapes:{IN_ONE_PLACE[which]}\n"
        "lights: [{type: constant, radiance: 1}]\n"
    )
    with scalar():
        found = direct(scene, scene.tables, load(scene), 200)
    assert found.status in ("agree", "reference-limited"), found.reason


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    "material",
    [
        "type: principled_thin, base_colour: [0.83, 0.4, 0.01], spec_tint: 0.9, spec_trans: 0.7",
        "type: principled_thin, roughness: 0.08, spec_trans: 0.999",
        "type: principled, metallic: 0.9999, sheen: 0.5, sheen_tint: 1",
        "type: rough_plastic, interior_ior: 1.18, exterior_ior: 1.33, distribution: beckmann",
        "type: rough_plastic, interior_ior: 1.33, exterior_ior: 1.33",
        "type: plastic, interior_ior: 1.1, exterior_ior: 1.4",
    ],
)
def test_materials_that_float32_and_tables_amplify(material: str) -> None:
    scene = Scene.parse(
        "camera: {type: perspective, eye: [0.4, 1, 4], target: [0, 0, 0], fov: 50}\n"
        "film: {width: 24, height: 18}\n"
        f"materials: {{m: {{{material}}}}}\n"
        "shapes: [{type: sphere, material: m}, {type: rectangle, material: m,\n"
        "  transform: [{scale: 3}, {translate: [0, 0, -2]}]}]\n"
        "lights: [{type: constant, radiance: 1},\n"
        "  {type: point, position: [1, 3, 4], intensity: 9}]\n"
    )
    with scalar():
        found = direct(scene, scene.tables, load(scene), 300)
    assert found.status == "agree", found.reason


IN_ITS_PLANE = """
camera: {type: orthographic, eye: [1.6, 0.1, -5], target: [0, 0, 0], width: 5}
film: {width: 12, height: 12}
shapes:
  - SHAPE
  - {type: plane, transform: [{rotate: {axis: [1, 0, 0], degrees: -90}}, {translate: [0, -2.6, 0]}]}
lights:
  - {type: point, position: [3.9, 0.2, -2.3], intensity: 48}
  - {type: constant, radiance: 0.4}
"""
LEVEL = {
    "polygon": "{type: polygon, rings: [[[1.6, -0.9], [1.4, -0.2], [1.3, -1], [1.7, -0.7]]], AT}",
    "rectangle": "{type: rectangle, AT}",
    "triangle": "{type: triangle, v0: [0, 0, 0], v1: [1, 0, 0], v2: [0, 1, 0], AT}",
    "disk": "{type: disk, AT}",
    "box": "{type: box, AT}",
    "cylinder": "{type: cylinder, AT}",
    "mesh": "{type: mesh, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[0, 1, 2]], AT}",
}


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", LEVEL)
def test_rays_in_the_plane_in_which_they_begin(name: str) -> None:
    """Mitsuba's scalar variants let them hit that plane; ours goes on to what lies beyond."""
    shape = LEVEL[name].replace("AT", "transform: [{translate: [0, 0, 0.291]}]")
    scene = Scene.parse(IN_ITS_PLANE.replace("SHAPE", shape))
    with scalar():
        counterpart = load(scene)
        for seed in range(3):
            found = direct(scene, scene.tables, counterpart, 60, seed)
            assert found.status == "agree", found.reason


TUBE_BEFORE_A_LAMP = """
camera: {type: perspective, eye: [97.69622802734375, 2.5210671424865723, -519.0569458007812],
  target: [193.70447516441345, 1.9523029047995806, -491.09102165699005], fov: 0.002}
film: {width: 64, height: 48}
materials:
  lamp: {type: emissive, radiance: 70000}
  tube: {type: diffuse, reflectance: 0}
  ground: {type: diffuse, reflectance: 0.1}
shapes:
  - {type: rectangle, material: lamp, transform: [{scale: 0.1},
     {rotate: {axis: [1, 0, 0], degrees: 90}}, {translate: [-12, 10, 8]}]}
  - {type: rectangle, material: ground, transform: [{scale: 1000},
     {rotate: {axis: [1, 0, 0], degrees: -90}}]}
  - type: cylinder
    material: tube
    capped: false
    transform:
      - matrix:
          - [0.04158750230306614, 0.004900066502461673, -12.713, 0.731]
          - [0.004900066502461673, 0.0471458355658988, 7.404999999999999, 2.595]
          - [0.027321584881992513, -0.015914130107067926, 18.023000000000003, -9.973]
"""
"""A shadow ray of 535 m passes the end of a tube, right before the lamp, at 1.0005 radii."""


def test_an_occluder_within_the_shadow_epsilon_of_a_far_lamp() -> None:
    """Our arbiter's ray meets the tube there, which is not the light that it ends on."""
    scene = Scene.parse(TUBE_BEFORE_A_LAMP)
    with scalar():
        found = direct(scene, scene.tables, load(scene), 300)
        assert found.status == "agree", found.reason
        faulty = faulty_counterpart(TUBE_BEFORE_A_LAMP, "radiance: 70000", "radiance: 75000")
        assert direct(scene, scene.tables, faulty, 300).status == "differ"


PROJECTED = """
camera: {type: perspective, eye: [0, 3, 4], target: [0, 0, 0], fov: 50}
film: {width: 12, height: 8}
textures:
  image: {type: bitmap, file: image.png}
  cut: {type: bitmap, file: image.png, cutoff: 0.2}
  both: {type: product, of: [image, image], factor: [0.9, 0.5, 0.7]}
  checks: {type: checker, first: 0.9, second: [0.1, 0.5, 0.3], uv: {scale: [3, 2]}}
shapes:
  - {type: plane, transform: [{rotate: {axis: [1, 0, 0], degrees: -90}}]}
lights:
  - LIGHT
"""
LIGHTS = {
    "spot": "{type: spot, origin: [0, 4, 1], target: [0, 0, 0], cutoff_angle: 30, intensity: 9, "
    "texture: TEXTURE}",
    "projector": "{type: projector, origin: [0, 4, 1], target: [0, 0, 0], fov: 50, "
    "irradiance: TEXTURE}",
}


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("texture", ["image", "cut", "both", "checks"])
def test_images_that_lights_project(light: str, texture: str, tmp_path: Path) -> None:
    """Of every type: Mitsuba's projected images hang upside down, and its textures are turned."""
    texels = np.random.default_rng(7).integers(0, 256, (5, 4, 3)).astype(np.uint8)
    Image.fromarray(texels).save(tmp_path / "image.png")
    text = PROJECTED.replace("LIGHT", LIGHTS[light].replace("TEXTURE", texture))
    scene = Scene.parse(text, folder=tmp_path)
    rung = direct(scene, scene.tables, load(scene))
    assert rung.status == "agree", rung.reason


EDGE = """
camera: {type: orthographic, eye: [6, 2, 2], target: [0, 0, 0]}
film: {height: 4, width: 4}
materials: {lamp: {type: emissive, radiance: 1}}
shapes:
  - {type: rectangle}
  - {type: box, material: lamp, transform: [{matrix: [[0.2, -0.1, 0.269, 0],
     [0, -0.704, -0.055, 0], [0.311, 0, -0.172, 2]]}]}
"""


def test_a_point_on_an_edge_of_a_box() -> None:
    """The sizes of its faces put it there: from behind its face no light arrives, but a ray towards
    it meets the next face within float32's error."""
    scene = Scene.parse(EDGE)
    with scalar():
        right = direct(scene, scene.tables, load(scene), 144)
        wrong = direct(
            scene,
            scene.tables,
            load(Scene.parse(EDGE.replace("radiance: 1", "radiance: 1.1"))),
            144,
        )
    assert right.status == "reference-limited", right.reason
    assert wrong.status == "differ"
