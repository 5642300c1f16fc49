"""The rung `files` on glTF: the file's numbers by a second reading of its JSON, and what they are
where it has none by the specification."""

import copy
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from gltf_scenes import GltfScene, full_scene, load

from comparisons.rungs import files
from reference_rt.gltf import document, read

SPECULAR, IOR = "KHR_materials_specular", "KHR_materials_ior"
LIGHTS = ("extensions", "KHR_lights_punctual", "lights")
PAINT, PBR = ("materials", 0), ("materials", 0, "pbrMetallicRoughness")


def plain() -> GltfScene:
    """A file that leaves out what has a default."""
    file = GltfScene(emissiveFactor=[0.5, 0.25, 1.0])
    file.light(type="spot")
    file.light(type="point")
    file.light(type="directional")
    view = {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}
    file.root["cameras"] = [view]
    file.node(camera=0, translation=[0, 0, 5])
    return file


FAULTS: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "metallic": ((*PBR, "metallicFactor"), 0.0, "metallicFactor: model.glb says (1)"),
    "roughness": ((*PBR, "roughnessFactor"), 0.5, "roughnessFactor: model.glb says (1)"),
    "base colour": ((*PBR, "baseColorFactor"), [1.0, 1.0, 0.5, 1.0], "baseColorFactor: "),
    "index": ((*PAINT, "extensions", IOR, "ior"), 1.45, "ior: model.glb says (1.5)"),
    "specular": ((*PAINT, "extensions", SPECULAR, "specularFactor"), 0.5, "specularFactor: "),
    "colour of specular": (
        (*PAINT, "extensions", SPECULAR, "specularColorFactor"), [1.0, 0.5, 1.0], "specularColor"
    ),
    "sides": ((*PAINT, "doubleSided"), True, "doubleSided: model.glb says no"),
    "opacity": ((*PAINT, "alphaMode"), "MASK", "opacity: model.glb says (1)"),
    "strength": (
        (*PAINT, "extensions", "KHR_materials_emissive_strength", "emissiveStrength"), 2.0,
        "emissiveFactor: model.glb says (0.5, 0.25, 1), the rendered scene has (1, 0.5, 2)",
    ),
    "outer cone": ((*LIGHTS, 0, "spot", "outerConeAngle"), 0.35, "and cone: model.glb says "),
    "inner cone": ((*LIGHTS, 0, "spot", "innerConeAngle"), 0.1, "and cone: model.glb says "),
    "intensity": ((*LIGHTS, 1, "intensity"), 2.0, "colour times intensity"),
    "colour of light": ((*LIGHTS, 2, "color"), [1.0, 0.5, 1.0], "colour times intensity"),
    "near": (("cameras", 0, "perspective", "znear"), 1.0, "znear: model.glb says (0.1)"),
    "far": (("cameras", 0, "perspective", "zfar"), 9.0, "zfar: model.glb says nothing"),
}  # fmt: skip
"""What a reader of ours would take for the file's: where, the value, and what the rung says."""


def changed(root: Any, place: tuple[Any, ...], value: Any) -> Any:
    found = part = copy.deepcopy(root)
    for key, following in pairwise(place):
        if isinstance(part, dict):
            part = part.setdefault(key, [] if isinstance(following, int) else {})
        else:
            part = part[key]
    part[place[-1]] = value
    if value == "MASK":
        part["alphaCutoff"] = 2.0
    return found


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_the_reader(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place, value, said = FAULTS[name]
    scene, _ = load(tmp_path, plain())
    found = files(scene)
    assert found.status == "agree", found.reason
    assert found.numbers["checked"]["values of glTF"] > 15
    right = document.Document.model_validate

    class Wrong:
        model_validate = staticmethod(lambda root: right(changed(root, place, value)))

    monkeypatch.setattr(read, "Document", Wrong)
    scene, _ = load(tmp_path, plain())
    found = files(scene)
    assert found.status == "differ", found.reason
    assert said in found.reason


@pytest.mark.parametrize("form", ["glb", "gltf"])
def test_right_files(form: str, tmp_path: Path) -> None:
    scene, _ = load(tmp_path, full_scene(), form, allow_missing=True)
    found = files(scene)
    assert found.status == "agree", found.reason
    # What Python changes afterwards is no difference.
    material = scene.materials["paint"].model_copy()
    assert files(scene.changed(lights=[], materials={**scene.materials, "x": material})).status == (
        "agree"
    )
    silver = {name: _shiny(one) for name, one in scene.materials.items()}
    assert files(scene.changed(materials=silver)).status == "agree"


def _shiny(material: Any) -> Any:
    return material.model_copy(update={"ior": 2.0}) if material.type == "gltf_pbr" else material


def test_the_default_material(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = GltfScene()
    del file.primitive["material"]
    scene, _ = load(tmp_path, file)
    assert files(scene).numbers["checked"]["values of glTF"] > 5
    assert json.loads(scene.materials["default"].model_dump_json())["metallic"] == 1.0
