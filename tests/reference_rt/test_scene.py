"""Scene: round trips, defaults, freezing, the JSON Schema."""

import json

import pytest
from builders import EVERYTHING, SCENES, everything
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

import reference_rt as rt

FILES = sorted(SCENES.glob("*.yaml"))

# Control characters are not YAML, and ruamel.yaml does not escape all of them.
printable = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Zl", "Zp"]))
positive = st.floats(1e-6, 1e6)
vectors = st.tuples(*[st.floats(-1e6, 1e6)] * 3)
colours = st.tuples(*[st.floats(0, 1)] * 3)
steps = st.lists(
    st.one_of(
        st.builds(lambda v: {"translate": list(v)}, vectors),
        st.builds(lambda s: {"scale": s}, positive),
        st.builds(lambda d: {"rotate": {"axis": [1, 2, 3], "degrees": d}}, st.floats(-720, 720)),
    ),
    max_size=3,
)
shapes = st.one_of(
    st.builds(rt.Sphere, center=vectors, radius=positive, material=st.sampled_from([None, "m"])),
    st.builds(lambda t: rt.Box.model_validate({"transform": t}), steps),
    st.builds(lambda t: rt.Rectangle.model_validate({"transform": t}), steps),
    st.builds(rt.Triangle, v0=vectors, v1=vectors, v2=vectors),
    st.builds(rt.Mesh, file=printable, face_normals=st.booleans()),
)
materials = st.one_of(
    st.builds(rt.Diffuse, reflectance=colours),
    st.builds(rt.Mirror, reflectance=colours),
    st.builds(rt.Dielectric, interior_ior=positive, exterior_ior=positive),
    st.builds(rt.Emissive, radiance=colours),
)
scenes = st.builds(
    rt.Scene,
    description=printable,
    film=st.builds(
        rt.Film, width=st.integers(1, 10**6), filter=st.builds(rt.TentFilter, radius=positive)
    ),
    sampler=st.one_of(
        st.none(), st.builds(rt.Sobol, spp=st.integers(1, 2**31), seed=st.integers(0, 2**63 - 1))
    ),
    materials=st.fixed_dictionaries({"m": materials}),
    shapes=st.lists(shapes, max_size=4).map(tuple),
    lights=st.lists(st.builds(rt.Point, position=vectors, intensity=colours), max_size=2).map(
        tuple
    ),
)


@given(scenes)
@settings(max_examples=60)  # ruamel.yaml takes its time
def test_round_trips(scene):
    """Every bit of every number comes back, from JSON and from YAML."""
    for text in (scene.to_json(), scene.to_yaml()):
        again = rt.Scene.parse(text)
        assert again == scene
        assert again.to_json() == scene.to_json()
        assert again.digest() == scene.digest()


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_scene_files_round_trip(file, tmp_path):
    scene = rt.Scene.load(file)
    for name, text in (("a.json", scene.to_json()), ("a.yaml", scene.to_yaml())):
        (tmp_path / name).write_text(text)
        assert rt.Scene.load(tmp_path / name) == scene
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


def data_of(text):
    from ruamel.yaml import YAML

    return YAML(typ="safe", pure=True).load(text)


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_schema_allows_the_scenes(file):
    assert problems(data_of(file.read_text()), SCHEMA) == []


def test_schema_allows_everything():
    assert problems(data_of(EVERYTHING), SCHEMA) == []


@pytest.mark.parametrize(
    "text",
    [
        "colour: 1",
        "film: {width: 0}",
        "film: {width: 1.5}",
        "shapes: [{type: sphere, radius: -1}]",
        "shapes: [{type: teapot}]",
        "materials: {a: {type: diffuse, reflectance: 2}}",
        "lights: [{type: point}]",
    ],
)
def test_schema_refuses_what_the_scene_refuses(text):
    assert problems(data_of(text), SCHEMA) != []
    with pytest.raises(rt.SceneError):
        rt.Scene.parse(text)


def test_schema_says_what_things_are():
    """An editor shows these: every part and every unit."""
    assert SCHEMA["$defs"]["Sphere"]["description"].startswith("A sphere")
    assert "degrees" in SCHEMA["$defs"]["Perspective"]["properties"]["fov"]["description"]
    json.dumps(SCHEMA)


# ---- defaults, freezing, change -----------------------------------------------------------------


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


def test_frozen():
    scene = rt.Scene(shapes=(rt.Sphere(),))
    with pytest.raises(ValidationError, match="frozen"):
        scene.film = rt.Film()
    with pytest.raises(ValidationError, match="frozen"):
        scene.shapes[0].radius = 2.0


def test_changed(tmp_path):
    scene = rt.Scene.load(everything(tmp_path))
    before = scene.to_json()
    other = scene.changed(film=rt.Film(width=3))
    assert other.film.width == 3
    assert other.folder == tmp_path
    assert other.changed(film=scene.film) == scene
    assert scene.to_json() == before
    assert other != scene
    with pytest.raises(rt.SceneError, match="random numbers"):
        scene.changed(sampler=rt.Grid())
    with pytest.raises((rt.SceneError, ValidationError)):
        scene.changed(materials={})


def test_json_is_read_as_json():
    text = '{\n\t"film": {"width": 4},\n\t"description": "a: b # \\u00e9 \\n \\/",\n"shapes": []}'
    scene = rt.Scene.parse(text)
    assert scene.description == json.loads(text)["description"]
    assert rt.Scene.parse('{"description": "\\ud83d\\ude00\x7f"}').description == "\U0001f600\x7f"
    numbers = '{"shapes": [{"type": "sphere", "center": [1e5, -2E-3, 0], "radius": 1E+2}]}'
    assert rt.Scene.parse(numbers).shapes[0] == rt.Sphere(center=(1e5, -2e-3, 0), radius=100.0)
