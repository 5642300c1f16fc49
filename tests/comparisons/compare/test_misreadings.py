"""Scenes read wrongly: the same mistake made in the scene's text is named."""

from pathlib import Path

import numpy as np
import pytest

import comparisons
from comparisons.compare import diagnosis
from comparisons.compare.misreadings import misreadings
from comparisons.compare.path_length import path_lengths
from comparisons.results.case import Images
from reference_rt.core.arrays import FloatArray
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


@pytest.mark.parametrize("alpha", ["0.3", "[0.3, 0.2]", "[rough, 0.2]"])
def test_roughness_of_two_axes(alpha: str) -> None:
    """Numbers are changed, textures not."""
    text = SCENE.replace("textures:\n", "textures:\n  rough: {type: checker}\n").replace(
        "{type: diffuse, reflectance: tiles}",
        f"{{type: rough_conductor, eta: 0.2, k: 4, alpha: {alpha}}}",
    )
    scene, reference = picture(text.replace("whitted", "direct"))
    found = misreadings(scene)
    assert found is not None
    assert "alpha is squared" in [one.name for one in found(reference)]


def test_names_of_textures_are_no_paths() -> None:
    scene, reference = picture(SCENE.replace("dents", "../../dents"))
    found = misreadings(scene)
    assert found is not None
    assert "green of normal maps is flipped" in [h.name for h in found(reference)]


WHITTED = """\
film: {width: 64, height: 48}
camera: {type: perspective, eye: [0, 0.6, 3], target: [0, 0.4, 0], fov: 45}
integrator: {type: whitted, max_depth: 2}
materials:
  floor: {type: phong, diffuse: 0.6, ambient: 0.6}
  ball: {type: phong, ambient: 0.1, diffuse: [0.7, 0.3, 0.2], specular: 0.4, exponent: 20}
  chrome: {type: phong, ambient: 0.05, diffuse: 0.1, mirror: 0.7}
shapes:
  - type: rectangle
    material: floor
    transform: [{scale: 3}, {rotate: {axis: [1, 0, 0], degrees: -90}}]
  - {type: sphere, material: ball, center: [-0.6, 0.5, 0.3], radius: 0.5}
  - {type: sphere, material: chrome, center: [0.5, 0.5, 0.3], radius: 0.5}
lights:
  - {type: ambient, radiance: 0.3}
  - {type: point, position: [2, 3, 2], intensity: 20}
"""


@pytest.mark.cases(4)
@pytest.mark.parametrize(
    ("right", "wrong", "name"),
    [
        ("exponent: 20", "exponent: 40", "the highlight's exponent is 2 times as large"),
        ("exponent: 20", "exponent: 20, half_vector: true", "half vectors and mirrored directions"),
        ("specular: 0.4", "specular: 4.4", "the highlight is multiplied by (p + 2) / 2"),
        ("specular: 0.4", "specular: 0", "without highlights"),
        ("mirror: 0.7", "mirror: 0", "without reflections and refractions, or without mirrored"),
        ("max_depth: 2", "max_depth: 1", "one reflection fewer"),
        ("max_depth: 2", "max_depth: 3", "one reflection more"),
        ("  - {type: ambient, radiance: 0.3}\n", "", "without ambient light"),
        ("radiance: 0.3", "radiance: 0.6", "ambient light is counted twice"),
        ("intensity: 20", "intensity: 62.8318530718", "lights without extent are pi times"),
    ],
)
def test_a_mistake_of_the_textbooks_shading_is_named(right: str, wrong: str, name: str) -> None:
    assert right in WHITTED
    facing = WHITTED.replace("ball: {type: phong,", "ball: {type: phong, mirror: 0.5,")
    text = facing if "max_depth" in right else WHITTED  # two mirrors, which see each other
    scene, reference = picture(text)
    _, candidate = picture(text.replace(right, wrong))
    cause = diagnosis.likeliest(Images(candidate, reference), {}, misreadings(scene))
    assert cause is not None
    assert cause.name.startswith(name)


def test_whitted_without_shadows() -> None:
    """A floor without shadows is one without the ball, where no ball hides it."""
    text = "".join(line for line in WHITTED.splitlines(keepends=True) if "chrome" not in line)
    scene, reference = picture(text)
    _, alone = picture("".join(x for x in text.splitlines(keepends=True) if "sphere" not in x))
    o, d, *_ = scene.camera_rays()
    candidate = np.where((scene.intersect(o, d).shape == 0)[..., None], alone, reference)
    assert (candidate != reference).any()
    cause = diagnosis.likeliest(Images(candidate, reference), {}, path_lengths(scene))
    assert cause is not None
    assert cause.name == "without shadows"


NOISY = """\
film: {width: 32, height: 24}
camera: {type: perspective, eye: [0, 1.2, 4], target: [0, 0.5, 0], fov: 45}
sampler: {type: independent, spp: 64}
integrator: {type: path, max_depth: 5}
textures:
  tiles: {type: checker, first: [0.7, 0.6, 0.5], second: [0.2, 0.1, 0.1], uv: {scale: [2, 3]}}
materials:
  floor: {type: diffuse, reflectance: tiles}
  glass: {type: dielectric, interior_ior: 1.5}
  metal: {type: rough_conductor, eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.2], alpha: 0.4}
shapes:
  - type: rectangle
    material: floor
    transform: [{scale: 3}, {rotate: {axis: [1, 0, 0], degrees: -90}}]
  - {type: sphere, material: glass, center: [-0.6, 0.5, 0.3], radius: 0.5}
  - {type: sphere, material: metal, center: [0.7, 0.5, -0.4], radius: 0.5}
lights:
  - {type: constant, radiance: [0.3, 0.4, 0.6]}
  - {type: point, position: [2, 3, 1], intensity: [20, 15, 9]}
"""


def replicates(text: str, seed: int) -> FloatArray:
    scene = Scene.parse(text)
    sampler = scene.resolved_sampler
    return np.stack(
        [
            render(scene.changed(sampler=sampler.model_copy(update={"seed": seed + k}))).colour
            for k in range(8)
        ]
    )


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("right", "wrong", "name"),
    [
        ("scale: [2, 3]", "scale: [2, -3]", "textures are upside down, or textures are mirrored"),
        ("scale: [2, 3]", "matrix: [[0, 2, 0], [3, 0, 0]]", "u and v of surfaces are exchanged"),
        ("[0.7, 0.6, 0.5]", "[0.4479, 0.3185, 0.2140]", None),  # one colour: no usual mistake
        (
            "first: [0.7, 0.6, 0.5], second: [0.2, 0.1, 0.1]",
            "first: [0.44799, 0.31855, 0.21404], second: [0.03310, 0.01002, 0.01002]",
            "colours of materials and textures are decoded from sRGB",
        ),
        ("interior_ior: 1.5", "exterior_ior: 1.5, interior_ior: 1", "indices of refraction are"),
        ("alpha: 0.4", "alpha: 0.16", "alpha is squared"),
    ],
)
def test_a_misreading_is_named_in_noise(right: str, wrong: str, name: str | None) -> None:
    """By the gate, beside the lengths of paths."""
    assert right in NOISY
    case = comparisons.gate(
        list(replicates(NOISY.replace(right, wrong), 100)), scene=Scene.parse(NOISY)
    )
    assert case.verdict == "differ"
    if name is None:
        assert case.cause is None or "read so" not in case.cause.evidence
    else:
        assert case.cause is not None
        assert case.cause.name.startswith(name)


def test_light_of_particles_has_no_misreadings() -> None:
    """The same seed is no other picture of the same particles."""
    assert misreadings(Scene.parse(NOISY.replace("path", "light"))) is None
