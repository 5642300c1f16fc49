"""What of glTF is missing in our scenes, and wrong or damaged files: a line each, never a crash."""

import json
from contextlib import suppress

import numpy as np
import pytest
from gltf_scenes import GltfScene, full_scene, load, refused
from mesh_writers import written

import reference_rt as rt


def test_every_missing_part_has_a_line(tmp_path):
    file = GltfScene(alphaMode="BLEND")
    file.material["extensions"] = {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}
    file.material["pbrMetallicRoughness"] = {"baseColorFactor": [1, 1, 1, 0.5]}
    file.material["occlusionTexture"] = {"index": file.texture()}
    file.primitive["attributes"]["COLOR_0"] = file.add(np.full((4, 4), 99, np.uint8))
    file.primitive["targets"] = [{}]
    file.root |= {"animations": [{}], "skins": [{}]}
    file.root["nodes"][0]["skin"] = 0
    lines = refused(tmp_path, file)
    for line, part in zip(lines, ("KHR_materials_clearcoat", "opacities of vertices"), strict=True):
        assert part in line
        assert line.startswith(f"{tmp_path / 'model.glb'}: ")
    assert "--allow-missing" in lines[0]
    scene, said = load(tmp_path, file, allow_missing=True)
    assert scene.allows_missing
    for part in ("clearcoat", "opacities", "animations", "skins", "morph", "occlusion"):
        assert part in said
    file.root["extensionsRequired"] = ["KHR_materials_clearcoat"]
    (line,) = refused(tmp_path, file, allow_missing=True)
    assert 'requires the extension "KHR_materials_clearcoat", which is unknown; expected' in line


def test_extensions_of_vendors_are_left_out(tmp_path):
    """Those that are not required, with one line for all; wherever they are."""
    file = GltfScene()
    expected, before = load(tmp_path, file)
    file.material["extensions"] = {"XYZ_materials_of_ours": {"strength": 3}}
    file.primitive["extensions"] = {"ABC_geometry": {}, "EXT_mesh_shading": {"x": [1]}}
    file.root["extensions"] = {f"XYZ_{k:02d}": {} for k in range(20)}
    file.root["extensionsUsed"] = ["XYZ_materials_of_ours", "ABC_geometry"]
    scene, said = load(tmp_path, file)
    assert scene.materials == expected.materials
    assert scene.shapes == expected.shapes
    lines = [line for line in said.splitlines() if line not in before]
    (line,) = lines
    assert line.startswith(
        f"{tmp_path / 'model.glb'}: extensions of vendors that the file does not"
    )
    assert '"ABC_geometry", "EXT_mesh_shading", "XYZ_00"' in line
    assert line.endswith(" and 11 more")
    for name in ("ABC_geometry", "XYZ_unused"):
        file.root["extensionsRequired"] = [name]
        (line,) = refused(tmp_path, file, allow_missing=True)
        assert f'requires the extension "{name}", which is unknown; expected' in line


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["asset", "version"], "1.0", "asset.version: expected version 2.0 of glTF"),
        (["materials", 0, "alphaMode"], "GLASS", "materials[0].alphaMode: expected 'OPAQUE', "),
        (["materials", 0, "emissiveFactor"], [1, 0], "materials[0].emissiveFactor: expected at"),
        (["meshes", 0, "primitives"], [], "meshes[0].primitives: expected at least 1 item"),
        (["nodes", 0, "mesh"], 7, "there is no meshes[7]; expected one of 1"),
        (["meshes", 0, "primitives", 0, "material"], 3, "there is no materials[3]; expected"),
        (["nodes", 0, "camera"], 0, "there is no cameras[0]; expected one of 0"),
        (["nodes", 0, "scale"], [1, 2], "is malformed: a node's 'scale' is not 3 finite numbers"),
        (["accessors", 2, "count"], 99, "is malformed: accessors[2] reaches beyond its view"),
        (["nodes", 0, "children"], [0], "is malformed: nodes[0] has two parents"),
    ],
)
def test_wrong_files(tmp_path, path, value, message):
    file = GltfScene()
    file.root["asset"] = {"version": "2.0"}
    part = file.root
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    (line, *_) = refused(tmp_path, file)
    assert line.startswith(f"{tmp_path / 'model.glb'}: {message}")


def read_or_refused(folder, content, form):
    path = written(folder, content, f"damaged.{form}")
    with suppress(rt.SceneError):
        rt.Scene.load(path, allow_missing=True)
    path.unlink()


WRONG = (None, True, -1, 0, 1e308, "", "a", [], {}, [[]], [None], {"index": 0}, 10**30)


def parts_of(value, path=()):
    yield path
    if not isinstance(value, dict | list):
        return
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        yield from parts_of(inner, (*path, key))


@pytest.mark.parametrize("seed", [0, pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore")
def test_any_part_of_any_type(tmp_path, seed):
    """Every value of the JSON replaced by every other kind; unless slow, some of them."""
    whole = json.loads(full_scene().gltf())
    changes = [(path, wrong) for path in parts_of(whole) if path for wrong in WRONG]
    if seed is not None:
        rng = np.random.default_rng(seed)
        changes = [changes[k] for k in rng.choice(len(changes), 150, replace=False)]
    for (*path, last), wrong in changes:
        copy = json.loads(json.dumps(whole))
        part = copy
        for key in path:
            part = part[key]
        part[last] = wrong
        read_or_refused(tmp_path, json.dumps(copy).encode(), "gltf")


@pytest.mark.parametrize("step", [23, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore")
def test_damaged_files(tmp_path, step):
    """Cut anywhere, and with any bit flipped; unless slow, every so many."""
    for form in ("gltf", "glb"):
        content = getattr(full_scene(), form)()
        for length in range(0, len(content), 4 * step):
            read_or_refused(tmp_path, content[:length], form)
        for bit in range(0, 8 * len(content), 13 * step):
            data = bytearray(content)
            data[bit // 8] ^= 1 << bit % 8
            read_or_refused(tmp_path, bytes(data), form)
