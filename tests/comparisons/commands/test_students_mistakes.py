"""The mistakes of a first scene and of a first call: each is answered with what to write."""

import re
import warnings

import pytest
from command_line import invoke

from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.scene.likely_mistakes import likely_mistakes
from reference_rt.util.errors import SceneError

BALL = "shapes:\n  - type: sphere\n    "
METAL = "materials: {m: {type: rough_conductor, eta: 1, k: 1, "
LAMP = "lights: [{type: point, position: [0, 0, 3], intensity: 1}]\n"

# A scene, and what its message says to write.
SCENES = {
    "lights: [{type: area, radiance: 1}]": "material has the type 'emissive'",
    "camera: {type: perspective, position: [0, 0, 1]}": "'eye'",
    "camera: {type: perspective, look_at: [0, 0, 0]}": "'target'",
    METAL + "roughness: 0.2}}": "'alpha'",
    METAL + "alpha: yes}}": "expected numbers",
    BALL + "material: {type: diffuse}": "the name of one of 'materials'",
    'materials: {m: {type: diffuse, reflectance: "#aabbcc"}}': "[0.402, 0.497, 0.604]",
    'lights: [{type: point, position: [0, 0, 0], intensity: "#ff0000"}]': "[1, 0, 0]",
    "film: {filter: tent}": "{type: tent}",
    "integrator: path": "{type: path}",
    "sampler: sobol": "{type: sobol}",
    "camera: perspective": "{type: perspective}",
    BALL + "transform: {translate: [0, 0, 1]}": "[{'translate': [0, 0, 1]}]",
    BALL + "transform: [{rotate: [0, 90, 0]}]": "axis, degrees",
    "shapes:\n\t- type: sphere": "spaces",
    "camera:\n  type: perspective\n   fov: 30": "below each other",
    "shapes: [{type: cube}]": "'box'",
    "shapes: [{type: obj, file: a.obj}]": "'mesh'",
    "shapes: [{type: mesh, filename: a.obj}]": "'file'",
    BALL + "center: 1, 2, 3": "[x, y, z]",
    BALL + "position: [1, 2, 3]": "'center'",
    "lights: {type: constant, radiance: 1}": "[{'radiance': 1, 'type': 'constant'}]",
    "shapes: {ball: {type: sphere}}": "[{'type': 'sphere'}]",
    "materials: [{name: red, type: diffuse}]": "{a: {type: diffuse}}",
    "materials: {m: {type: diffuse, color: [1, 0, 0]}}": "'reflectance'",
    "materials: {m: {type: glass}}": "'dielectric'",
    "materials: {m: {type: dielectric, ior: 1.5}}": "'interior_ior'",
    "film: {resolution: [640, 480]}": "'width' and 'height'",
    "film: {width: 4, spp: 16}": "'sampler', such as {type: sobol, spp: 64}",
    "sampler: {type: sobol, samples: 16}": "'spp'",
    "integrator: {type: path, max_bounces: 5}": "'max_depth'",
    "camera: {type: perspective, fov: 1.2}\n" + BALL + "\n" + LAMP: "68.75",
    BALL + "material: gold": "'materials' describes them",
    "camera: {type: perspective, from: [0, 0, 5], to: [0, 0, 0]}": "'eye'",
    "camera: {type: perspective, aspect: 1.5}": "the width and height of 'film'",
    "camera: {type: thin_lens, aperture: 0.1, focus_distance: 2}": "'aperture_radius'",
    "camera: {type: pinhole, fov: 40}": "the type 'perspective'",
    "film: {gamma: 2.2}": ".png files have the sRGB curve",
    "sampler: {type: random, spp: 4}": "'independent'",
    "sampler: {type: sobol, spp: 1e2}": "a whole number",
    BALL + "color: [1, 0, 0]": "its 'material' has it",
    BALL + "scale: 2": "'transform', such as [{scale: 2}]",
    BALL + "transform: [{rotate: {axis: [0, 1, 0], angle: 90}}]": "'degrees'",
    "shapes: [{type: plane, normal: [0, 1, 0]}]": "'transform' places, turns and scales it",
    "shapes: [{type: box, size: [1, 2, 3]}]": "'transform' places, turns and scales it",
    "shapes: [{type: triangle, vertices: [0, 1, 2]}]": "'v0' and 'v1' and 'v2'",
    "shapes: [{type: difference, children: []}]": "'of'",
    "shapes: [{type: instance, of: ball}]": "'group'",
    "lights: [{type: point, intensity: 1}]": "expected a value: where it is",
    "lights: [{type: point, position: [0, 0, 3], power: 100}]": "'intensity'",
    "lights: [{type: spot, position: [0, 0, 3], intensity: 1}]": "'origin'",
    "materials: {m: {type: emissive, color: 1, strength: 5}}": "'radiance'",
    "materials: {m: {type: mirror, roughness: 0.1}}": "'rough_conductor'",
    "materials: {m: {type: phong, shininess: 20}}": "'exponent'",
    "materials: {m: {type: diffuse, texture: wood}}": "'reflectance'",
    "materials: {m: {type: diffuse, reflectance: wood.png}}": "'textures' describes them",
    "textures: {wood: {type: image, file: wood.png}}": "'bitmap'",
    "textures: {c: {type: checker, color1: 0.2, color2: 0.8}}": "'first'",
    "media: {fog: {type: homogeneous, density: 0.5, albedo: 1}}": "'sigma_t'",
    "media: {fog: {type: homogeneous, sigma_s: 0.5}}": "sigma_t is sigma_s + sigma_a",
    "media: {fog: {type: homogeneous, sigma_t: 1, albedo: 1, g: 0.5}}": "{type: hg, g: 0.5}",
}


def message_of(text):
    """What is said of a scene: its error, or its warnings."""
    try:
        with warnings.catch_warnings(record=True):
            scene = Scene.parse(text, "x.yaml")
            found = likely_mistakes(scene, build_tables(scene))
    except SceneError as error:
        return str(error)
    (only,) = found
    return str(scene.error(only.message, *only.path))


@pytest.fixture
def run():
    def said(*arguments):
        lines = invoke(*arguments).stderr.splitlines()
        return "\n".join(one for one in lines if re.search("warning: |error: |No such", one))

    return said


def test_each_is_answered_with_what_to_write(wording, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failures = []

    def check(said, expected):
        wording(said)
        if expected not in said:
            failures.append((said, expected))

    for text, expected in SCENES.items():
        check(message_of(text), expected)
    camera = "camera: {type: perspective, eye: [0, 0, 5]}\nfilm: {width: 4, height: 4}\n"
    write_scene = (tmp_path / "ball.yaml").write_text
    write_scene(camera + BALL)
    dark = run("render", "ball.yaml", "-o", "x.exr", "--spp", "1")
    check(dark, "expected a light")
    assert dark.count("warning") == 1
    check(run("render", "bal.yaml", "-o", "x.exr"), "did you mean 'ball.yaml'?")
    check(run("render", "ball.yaml", "-o", "x.exr", "--samples", "4"), "--spp")
    write_scene(camera + BALL + "radius: 9\nlights: [{type: constant, radiance: 1}]\n")
    inside = run("render", "ball.yaml", "-o", "x.exr", "--spp", "1")
    check(inside, "the eye is inside shapes[0]")
    copies = 'cp x.exr "{output}"'
    check(run("gate", "--scene", "ball.yaml", "--size", "8x8", "--command", copies), "{width}")
    assert not failures
    assert len(SCENES) + 5 >= 60
