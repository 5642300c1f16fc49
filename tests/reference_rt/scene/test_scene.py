"""Scene: round trips, defaults, the JSON Schema."""

import json

import pytest
from builders import SCENES
from galleries import GALLERIES, gallery_of_shapes

import reference_rt as rt
from reference_rt.util import yaml_text

FILES = sorted(SCENES.glob("*.yaml"))


def test_scene_files_round_trip(tmp_path):
    """Random scenes: `tests/comparisons/experiments/test_fuzz_generate.py`."""
    for file in FILES:
        scene = rt.Scene.load(file)
        for name, text in (("a.json", scene.to_json()), ("a.yaml", scene.to_yaml())):
            (tmp_path / name).write_text(text)
            assert rt.Scene.load(tmp_path / name) == scene, file
        assert scene.name == file.stem
        assert scene.folder == SCENES


# ---- the schema ---------------------------------------------------------------------------------

SCHEMA = rt.json_schema()
KINDS = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
    "null": type(None),
}


def problems(value, schema, where="scene"):
    """What of `value` the schema does not allow: the keywords that the schema uses."""
    if "$ref" in schema:
        schema = SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]]
    for word in ("anyOf", "oneOf"):
        if word in schema:
            found = [problems(value, one, where) for one in schema[word]]
            if not any(f == [] for f in found):
                return [f"{where}: none of {len(found)} fits: {found}"]
            return []
    if "const" in schema and value != schema["const"]:
        return [f"{where}: not {schema['const']}"]
    if "enum" in schema and value not in schema["enum"]:
        return [f"{where}: not one of {schema['enum']}"]
    if "type" in schema and not isinstance(value, KINDS[schema["type"]]):
        return [f"{where}: not {schema['type']}"]
    out = []
    for word, wrong in (
        ("minimum", lambda v, limit: v < limit),
        ("maximum", lambda v, limit: v > limit),
        ("exclusiveMinimum", lambda v, limit: v <= limit),
        ("exclusiveMaximum", lambda v, limit: v >= limit),
        ("minItems", lambda v, limit: len(v) < limit),
        ("maxItems", lambda v, limit: len(v) > limit),
    ):
        if word in schema and wrong(value, schema[word]):
            out.append(f"{where}: {word} {schema[word]}")
    if isinstance(value, list) and "items" in schema:
        for i, item in enumerate(value):
            out += problems(item, schema["items"], f"{where}[{i}]")
    if isinstance(value, dict):
        known, other = schema.get("properties", {}), schema.get("additionalProperties", True)
        out += [f"{where}: missing {key}" for key in schema.get("required", []) if key not in value]
        for key, item in value.items():
            if key in known:
                out += problems(item, known[key], f"{where}.{key}")
            elif other is False:
                out.append(f"{where}: unknown {key}")
            elif isinstance(other, dict):
                out += problems(item, other, f"{where}.{key}")
    return out


def test_schema_allows_the_scenes(tmp_path):
    texts = [gallery(tmp_path).to_json() for gallery in GALLERIES]
    for text in (*texts, *(file.read_text() for file in FILES)):
        assert problems(yaml_text.load(text), SCHEMA) == []


def test_schema_refuses_what_the_scene_refuses():
    for text in (
        "colour: 1",
        "film: {width: 0}",
        "film: {width: 1.5}",
        "shapes: [{type: sphere, radius: -1}]",
        "shapes: [{type: teapot}]",
        "materials: {a: {type: diffuse, reflectance: 2}}",
        "lights: [{type: point}]",
        "lights: [{type: laser}]",
        "materials: {a: {type: conductor, eta: 1}}",
        "materials: {a: {type: mask, base: b, opacity: 1.5}, b: {type: mirror}}",
        "materials: {a: {type: principled, metallic: -0.1}}",
        "materials: {a: {type: rough_plastic, alpha: 0}}",
        "materials: {a: {type: rough_conductor, eta: 1, k: 1, distribution: phong}}",
        "textures: {a: {type: bitmap, file: b.png, filter: cubic}}",
        "film: {layers: [albedo, ghosts]}",
        "film: {filter: {type: lanczos, lobes: 0}}",
    ):
        assert problems(yaml_text.load(text), SCHEMA) != [], text
        with pytest.raises(rt.SceneError):
            rt.Scene.parse(text)


def test_schema_says_what_things_are():
    """An editor shows these: every part and every unit."""
    assert SCHEMA["$defs"]["Sphere"]["description"].startswith("A sphere")
    assert "degrees" in SCHEMA["$defs"]["Perspective"]["properties"]["fov"]["description"]
    json.dumps(SCHEMA)


# ---- defaults, change ---------------------------------------------------------------------------


def test_defaults():
    scene = rt.Scene()
    assert scene == rt.Scene.parse("{}")
    assert scene.film == rt.Film(width=256, height=256, filter=rt.BoxFilter())
    assert isinstance(scene.integrator, rt.Path)
    assert scene.resolved_sampler == rt.Sobol()
    assert rt.Scene(integrator=rt.Whitted()).resolved_sampler == rt.Grid()
    assert (scene.shapes, scene.lights, scene.materials) == ((), (), {})


def test_a_number_is_grey():
    scene = rt.Scene.parse("materials: {a: {type: diffuse, reflectance: 0.25}}")
    assert scene.materials["a"] == rt.Diffuse(reflectance=(0.25, 0.25, 0.25))


def test_changed(tmp_path):
    scene = gallery_of_shapes(tmp_path)
    before = scene.to_json()
    other = scene.changed(film=rt.Film(width=3))
    assert other.film.width == 3
    assert other.folder == tmp_path
    assert other.changed(film=scene.film) == scene
    assert scene.to_json() == before
    assert other != scene
    with pytest.raises(rt.SceneError, match="random numbers"):
        scene.changed(sampler=rt.Grid())
    with pytest.raises(rt.SceneError):
        scene.changed(materials={})


def test_json_is_read_as_json():
    text = '{\n\t"film": {"width": 4},\n\t"description": "a: b # \\u00e9 \\n \\/",\n"shapes": []}'
    scene = rt.Scene.parse(text)
    assert scene.description == json.loads(text)["description"]
    assert rt.Scene.parse('{"description": "\\ud83d\\ude00\x7f"}').description == "\U0001f600\x7f"
    numbers = '{"shapes": [{"type": "sphere", "center": [1e5, -2E-3, 0], "radius": 1E+2}]}'
    assert rt.Scene.parse(numbers).shapes[0] == rt.Sphere(center=(1e5, -2e-3, 0), radius=100.0)
