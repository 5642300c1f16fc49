"""Scenes read wrongly: the same mistake made in the scene's text is named."""

from pathlib import Path

import pytest

from comparisons.compare import diagnosis
from comparisons.compare.misreadings import misreadings
from comparisons.results.case import Images
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

TEXTURES = Path(__file__).parents[3] / "scenes" / "textures"

SCENE = """\
film: {width: 64, height: 48}
camera: {type: perspective, eye: [0, 0, 5], target: [0, 0, 0], fov: 50}
integrator: {type: whitted}
textures:
  tiles: {type: bitmap, file: tiles.png, uv: &uv {scale: 0.7, offset: [0.1, 0.2]}}
  dents: {type: bitmap, file: tiles_normal.png, uv: *uv, encoding: raw}
materials:
  metal: {type: gltf_pbr, base_color: [0.9, 0.6, 0.3], metallic: 1, roughness: 0.5}
  plastic: {type: gltf_pbr, base_color: 0.2, metallic: 0, roughness: 0.5}
  clay: {type: diffuse, reflectance: tiles}
  dented: {type: normal_map, base: clay, normals: dents}
shapes:
  - {type: sphere, center: [-1.2, 0.8, 0], radius: 0.7, material: metal}
  - {type: sphere, center: [1.2, 0.8, 0], radius: 0.7, material: plastic}
  - {type: rectangle, material: dented, transform: [{translate: [0, -1.1, 0]}]}
lights:
  - {type: point, position: [1, 2, 4], intensity: 20}
  - {type: directional, direction: [1, -1, -1], irradiance: 1}
"""


def picture(text: str) -> tuple[Scene, object]:
    scene = Scene.parse(text, folder=TEXTURES)
    return scene, render(scene).colour


@pytest.mark.cases(3)
@pytest.mark.parametrize(
    ("right", "wrong", "name"),
    [
        ("roughness: 0.5", "roughness: 0.25", "roughness is squared once too often"),
        ("roughness: 0.5", "roughness: 0.70710678118", "roughness is not squared"),
        ("metallic: 1", "metallic: 0", "metals are taken for dielectrics"),
        ("metallic: 0", "metallic: 1", "dielectrics are taken for metals"),
        ("roughness: 0.5}", "roughness: 0.5, ior: 1.789}", "(F0) is 2 times as large"),
        ("roughness: 0.5}", "roughness: 0.5, specular: 0}", "(F0) is 0 times as large"),
        ("scale: 0.7, offset: [0.1, 0.2]", "scale: [0.7, -0.7], offset: [0.1, 0.8]", "upside down"),
        ("tiles.png,", "tiles.png, encoding: raw,", "sRGB textures are taken for linear"),
        ("encoding: raw", "encoding: srgb", "linear textures are taken for sRGB"),
        ("material: dented", "material: clay", "normal maps are ignored"),
        ("[1, -1, -1]", "[-1, 1, 1]", "directions of light are reversed"),
        ("fov: 50", "fov: 50, fov_axis: y", "that of the other axis"),
    ],
)
def test_a_misreading_is_named(right: str, wrong: str, name: str) -> None:
    scene, reference = picture(SCENE)
    _, candidate = picture(SCENE.replace(right, wrong))
    cause = diagnosis.likeliest(Images(candidate, reference), {}, misreadings(scene))
    assert cause is not None
    assert name in cause.name


def test_names_of_textures_are_no_paths() -> None:
    scene, reference = picture(SCENE.replace("dents", "../../dents"))
    found = misreadings(scene)
    assert found is not None
    assert "green of normal maps is flipped" in [h.name for h in found(reference)]


def test_noise_has_no_misreadings() -> None:
    assert misreadings(Scene.parse(SCENE.replace("whitted", "path"), folder=TEXTURES)) is None
