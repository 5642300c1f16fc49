"""Scene: round trips, defaults, freezing, the JSON Schema."""

import json

import pytest
from builders import EVERY_LAW, EVERY_LIGHT, EVERY_SHAPE, SCENES, every_shape
from hypothesis import given, settings
from hypothesis import strategies as st

import reference_rt as rt
from reference_rt.scene import yaml_text
from reference_rt.textures.texture import UvMap

FILES = sorted(SCENES.glob("*.yaml"))

# Names with control characters are tested by themselves.
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
units = st.floats(0, 1)
numbers = st.one_of(units, st.just("t"))
reflectances = st.one_of(colours, st.just("t"))
indices = st.tuples(*[positive] * 3)
uv = st.builds(UvMap, scale=st.tuples(positive, positive), rotate=st.floats(-720, 720))
textures = st.one_of(
    st.builds(rt.Checker, first=colours, second=colours, uv=uv),
    st.builds(rt.Bitmap, file=printable, wrap=st.sampled_from(["repeat", "clamp"]), scale=positive),
    st.builds(rt.VertexColours, without=colours),
)
glasses = {
    "interior_ior": positive,
    "exterior_ior": positive,
    "reflectance": reflectances,
    "transmittance": reflectances,
}
metals = {"eta": indices, "k": colours, "reflectance": reflectances}
plastics = {"reflectance": reflectances, "interior_ior": positive, "nonlinear": st.booleans()}
alphas = st.floats(1e-3, 1)
rough = {
    "distribution": st.sampled_from(["ggx", "beckmann"]),
    "alpha": st.one_of(alphas, st.tuples(alphas, alphas), st.just("t")),
}
materials = st.one_of(
    st.builds(rt.Diffuse, reflectance=reflectances),
    st.builds(rt.Mirror, reflectance=reflectances),
    st.builds(rt.Dielectric, **glasses),
    st.builds(rt.ThinDielectric, **glasses),
    st.builds(rt.RoughDielectric, **glasses, **rough),
    st.builds(rt.Conductor, **metals),
    st.builds(rt.RoughConductor, **metals, **rough),
    st.builds(rt.Plastic, **plastics),
    st.builds(rt.RoughPlastic, **plastics, alpha=alphas),
    st.builds(rt.Principled, base_colour=reflectances, roughness=numbers, eta=positive),
    st.builds(rt.GltfPbr, base_color=reflectances, roughness=numbers, ior=positive),
    st.builds(rt.Phong, diffuse=reflectances, specular=colours, half_vector=st.booleans()),
)
wrappers = st.one_of(
    st.builds(rt.Emissive, radiance=reflectances, base=st.sampled_from([None, "m"])),
    st.builds(rt.Mask, base=st.just("m"), opacity=numbers),
    st.builds(rt.Blend, first=st.just("m"), second=st.just("other"), weight=numbers),
    st.builds(rt.TwoSided, base=st.just("other"), back=st.sampled_from([None, "other"])),
    st.builds(rt.Bump, base=st.just("m"), height=st.just("t"), scale=st.floats(-9, 9)),
    st.builds(rt.NormalMap, base=st.just("m"), normals=st.just("t")),
)
lights = st.one_of(
    st.builds(rt.Point, position=vectors, intensity=colours),
    st.builds(rt.Spot, origin=st.just((0.0, 0, 7e6)), target=vectors, intensity=colours),
    st.builds(rt.Directional, direction=st.just((1.0, 0.5, 1e-300)), irradiance=colours),
    st.builds(rt.Ambient, radiance=colours),
)
skies = st.one_of(
    st.builds(rt.Constant, radiance=colours),
    st.builds(
        lambda file, steps: rt.EnvironmentMap.model_validate({"file": file, "transform": steps}),
        printable,
        steps,
    ),
)
filters = st.one_of(
    st.builds(rt.TentFilter, radius=positive),
    st.builds(rt.GaussianFilter, stddev=positive),
    st.builds(rt.MitchellFilter, b=units, c=units),
    st.builds(rt.CatmullRomFilter),
    st.builds(rt.LanczosFilter, lobes=st.integers(1, 64)),
)
LAYERS = ["albedo", "normal", "position", "depth", "id", "variance"]
names = st.lists(st.sampled_from(LAYERS), unique=True)
integrators = st.one_of(
    st.builds(rt.Direct, light_samples=st.integers(1, 9), bsdf_samples=st.integers(0, 9)),
    st.builds(rt.Path, sampling=st.sampled_from(["both", "lights", "bsdf"])),
)
scenes = st.builds(
    rt.Scene,
    description=printable,
    film=st.builds(rt.Film, width=st.integers(1, 10**6), filter=filters, layers=names.map(tuple)),
    sampler=st.one_of(
        st.none(), st.builds(rt.Sobol, spp=st.integers(1, 2**31), seed=st.integers(0, 2**63 - 1))
    ),
    integrator=integrators,
    textures=st.fixed_dictionaries({"t": textures}),
    materials=st.fixed_dictionaries(
        {"m": materials, "w": wrappers, "other": st.just(rt.Plastic())}
    ),
    shapes=st.lists(shapes, max_size=3).map(tuple),
    lights=st.builds(lambda some, sky: (*some, sky), st.lists(lights, max_size=3), skies),
)


@given(scenes)
@settings(max_examples=25)
def test_round_trips(scene):
    """Every bit of every number comes back, from JSON and from YAML."""
    for text in (scene.to_json(), scene.to_yaml()):
        again = rt.Scene.parse(text)
        assert again == scene
        assert again.to_json() == scene.to_json()
        assert again.digest() == scene.digest()


def test_scene_files_round_trip(tmp_path):
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


def test_schema_allows_the_scenes():
    for text in (EVERY_SHAPE, EVERY_LAW, EVERY_LIGHT, *(file.read_text() for file in FILES)):
        assert problems(yaml_text.load(text), SCHEMA) == []


@given(scenes)
@settings(max_examples=20)
def test_schema_allows_what_is_written(scene):
    assert problems(json.loads(scene.to_json()), SCHEMA) == []


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
    with pytest.raises(rt.SceneError, match="frozen"):
        scene.film = rt.Film()
    with pytest.raises(rt.SceneError, match="frozen"):
        scene.shapes[0].radius = 2.0


def test_changed(tmp_path):
    scene = rt.Scene.load(every_shape(tmp_path))
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
