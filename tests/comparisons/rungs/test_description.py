"""The second reading of scene files: its table is what the documentation says and has every field;
right scenes are as it says; and of faults in validators and defaults, which both renderers share,
the rung `files` names the place."""

import json
import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest
from builders import SCENES
from faulty_sources import plant

from comparisons.experiments.fuzz import assets, generate
from comparisons.experiments.fuzz.data import text_of
from comparisons.experiments.fuzz.finding import Grammar
from comparisons.experiments.selftest import SourceFault
from comparisons.rungs import files
from comparisons.rungs.files.description import (
    MOST_TEXT,
    Description,
    documented,
    fields_of,
    second_reading,
)
from reference_rt.cameras import AnyCamera, Orthographic, Perspective, Pinhole, ThinLens
from reference_rt.cameras.film import AnyFilter, Film, GaussianFilter
from reference_rt.core.model import Description as Model
from reference_rt.core.model import name_of, types_of
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate, Turn
from reference_rt.integrators import AnyIntegrator, Direct
from reference_rt.integrators import Path as PathTracing
from reference_rt.lights import AnyLight, Projector, Spot
from reference_rt.materials import (
    AnyMaterial,
    Dielectric,
    Diffuse,
    GltfPbr,
    Mask,
    RoughConductor,
)
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import AnySampler, Sobol
from reference_rt.scene.examples import NAMED, examples
from reference_rt.scene.model import SceneModel
from reference_rt.shapes import Cone, Cylinder, Polygon, Sphere, Torus
from reference_rt.shapes.csg import AnyShape, Difference, Intersection, Union
from reference_rt.textures import AnyTexture, Checker, VertexColours
from reference_rt.textures.texture import UvMap

# ---- the table ----------------------------------------------------------------------------------

PAGE = (Path(__file__).parents[3] / "docs" / "scene_reference.md").read_text(encoding="utf-8")

SECTIONS = {
    "Cameras": "cameras", "Filters": "filters", "Samplers": "samplers",
    "Integrators": "integrators", "Shapes": "shapes", "Solids": "shapes",
    "Transforms": "transforms", "Materials": "materials", "Textures": "textures",
    "Materials made of others": "materials", "Lights": "lights",
}  # fmt: skip
"""The table's name of each of the page's sections."""

KINDS = {
    "number": r"number( .*)?", "integer": r"integer .*", "flag": r"`true`, `false`",
    "text": r"text|(`\w+`, )+`\w+`", "text or texts": r".* or a list of (`\w+`, )+`\w+`",
    "texts": r"a list of .*", "vector": r"3 numbers", "numbers": r"(4|10) numbers",
    "colour": r"colour [^a-z]*( to 1)?|colour from 0 to 1", "factors": "number or a list",
    "pair": r"number or 2 numbers", "pair or texture": r"number .*2 numbers or a texture's name",
    "number or texture": r"number .*or a texture's name",
    "colour or texture": r"colour .*or a texture's name", "turn": "keys below",
    "rows": r"a list of [23] (numbers|integers)|2 rows of 3 numbers|a list",
    "rings": r"a list of a list of 2 or 3 numbers", "transform": r"a list of \[transforms\].*",
    "uv": r"\[uv\].*", "film": r"\[film\].*",
}  # fmt: skip
"""What the page says of the values of each kind."""


def page() -> dict[tuple[str, str], dict[str, tuple[str, str]]]:
    """What the page says of each field's values and default, by section and type."""
    found: dict[tuple[str, str], dict[str, tuple[str, str]]] = {}
    section, fields, shared = "", {}, {}
    for line in PAGE.splitlines():
        if line.startswith("## "):
            section = SECTIONS.get(title := line.removeprefix("## "), title)
            fields = shared = {}
            if title == "The scene":
                found[section, ""] = fields
        elif line.startswith("### "):
            fields = dict(shared)
            found[section, line.removeprefix("### ")] = fields
        elif row := re.fullmatch(r"\| `([\w.]+)` \| (.*?) \| (.*?) ?\| .* \|", line):
            fields[row[1]] = row[2], row[3]
    return found


def table() -> dict[tuple[str, str], Any]:
    """The same of documented.toml: kind and default."""
    whole = documented()
    turn = {f"rotate.{name}": value for name, value in whole["turn"].items()}
    found = {
        (section, word): fields_of(section, word)
        for section in dict.fromkeys(SECTIONS.values())
        for word in whole[section]
    }
    found["transforms", "rotate"] = {**whole["transforms"]["rotate"], **turn}
    found |= {("The scene", ""): whole["scene"], ("Film", "film"): whole["film"]}
    return found | {("textures", "uv"): whole["uv"]}


def as_on_the_page(default: list[Any]) -> str:
    if not default:
        return "required"
    (value,) = default
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f"`{value}`" if value else ""
    if isinstance(value, list):
        return f"[{', '.join(f'{x:.4g}' for x in value)}]"
    return f"{value:.4g}"


def test_the_table_is_what_the_documentation_says() -> None:
    said, ours = page(), table()
    assert {key: [*fields] for key, fields in said.items()} == {
        key: [*fields] for key, fields in ours.items()
    }
    for key, fields in said.items():
        for field, (values, default) in fields.items():
            kind, *value = ours[key][field]
            assert as_on_the_page(value) == default, (key, field)
            if " of " not in kind and not kind.endswith("by name"):
                assert re.fullmatch(KINDS[kind], values), (key, field, kind, values)


UNIONS: dict[str, Any] = {
    "cameras": AnyCamera, "filters": AnyFilter, "samplers": AnySampler, "lights": AnyLight,
    "integrators": AnyIntegrator, "shapes": AnyShape, "materials": AnyMaterial,
    "textures": AnyTexture,
}  # fmt: skip
OTHERS = {"scene": SceneModel, "film": Film, "uv": UvMap, "turn": Turn}
STEPS = {"translate": Translate, "scale": Scale, "rotate": Rotate, "matrix": Matrix}


def test_the_table_has_every_type_and_every_field() -> None:
    for section, union in UNIONS.items():
        types = {name_of(one): one for one in types_of(union)}
        assert {*documented()[section]} == {*types}, section
        for name, one in types.items():
            found = fields_of(section, name)
            assert found is not None
            assert {*found, "type"} == {*one.model_fields}, name
    for name, one in (OTHERS | STEPS).items():
        where = documented()["transforms"] if name in STEPS else documented()
        assert {*where[name]} == {*one.model_fields}, name
    deterministic = {name_of(one): one().deterministic for one in types_of(AnyIntegrator)}
    by_default = {name: "grid" if it else "sobol" for name, it in deterministic.items()}
    assert documented()["sampler_of"] == by_default


# ---- right scenes -------------------------------------------------------------------------------


def read_again(scene: Scene, text: str) -> Description:
    found = Description(scene, second_reading(text))
    assert found.differences == []
    return found


@pytest.mark.filterwarnings("ignore")
def test_every_scene_is_as_it_says() -> None:
    values = 0
    for path in sorted(SCENES.rglob("*.yaml")):
        scene, text = Scene.load(path), path.read_text(encoding="utf-8")
        values += read_again(scene, text).values
        read_again(Scene.parse(json.dumps(second_reading(text)), folder=path.parent), text)
        fields = {name: getattr(scene, name) for name in scene.model_fields_set}
        assert Description(Scene(**fields)).differences == []
    assert values > 9_000


@pytest.mark.filterwarnings("ignore")
def test_random_scenes_are_as_they_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assets.write(tmp_path)
    monkeypatch.setattr(generate, "_shows_light", lambda data, folder: True)  # not rendered here
    for number in range(60):
        grammar = Grammar(extreme=number % 3 == 0)
        data = generate.generate(54, number, grammar, tmp_path)
        scene = Scene.parse(text_of(data), folder=tmp_path)
        read_again(scene, text_of(data))
        read_again(scene, json.dumps(data))


def example_texts() -> Iterator[tuple[str, str, str]]:
    """Texts with each example of each type; the key of the scene and the name or number there."""
    rest = {key: {name: _plain(one) for name, one in of.items()} for key, of in NAMED.items()}
    alone = {"cameras": "camera", "samplers": "sampler", "integrators": "integrator"}
    for section, union in UNIONS.items():
        for one in examples(union):
            data = one.model_dump(mode="json", exclude_unset=True) | {"type": one.type}
            more: dict[str, Any] = {}
            if one.type == "grid":
                more = {"integrator": {"type": "whitted"}}
            if section == "filters":
                yield json.dumps(rest | {"film": {"filter": data}}), "film", "filter"
            elif section in alone:
                yield json.dumps(rest | more | {alone[section]: data}), alone[section], ""
            elif section in ("materials", "textures"):
                named = rest[section] | {"this": data}
                yield json.dumps(rest | {section: named}), section, "this"
            else:
                yield json.dumps(rest | {section: [data]}), section, "0"


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return value.model_dump(mode="json")


def test_every_example_of_every_type_is_as_it_says() -> None:
    for text, _, _ in example_texts():
        read_again(Scene.parse(text), text)


def test_another_value_of_any_field_is_seen() -> None:
    """Of each example: each field, one after another, that is set or that has its default."""
    seen = set()
    for text, key, name in example_texts():
        scene, said = Scene.parse(text), second_reading(text)
        of = getattr(scene, key)
        one = of.filter if name == "filter" else of[int(name)] if name == "0" else of
        one = of[name] if name == "this" else one
        for field in type(one).model_fields:
            changed = one.model_copy(update={field: _other(getattr(one, field))})
            if field not in one.model_fields_set:
                changed.__pydantic_fields_set__.discard(field)
            put: Any = {"filter": lambda c, of: of.model_copy(update={"filter": c})}
            put |= {"0": lambda c, of: (c,), "this": lambda c, of: {**of, "this": c}}
            part = put[name](changed, of) if name else changed
            other = scene.model_copy(update={key: part})
            assert any(f".{field}" in one for one in Description(other, said).differences), field
            if field not in one.model_fields_set:
                assert Description(other).differences, field
            seen.add((one.type, field))
    assert len(seen) > 200


def _other(value: Any) -> Any:
    if isinstance(value, bool | str):
        return not value if isinstance(value, bool) else f"{value}?"
    if isinstance(value, int | float):
        return value + 1
    if isinstance(value, Model):
        return Perspective()
    return value[:-1] if value is not None and len(value) else (0.125,)


SMALL = "film: {width: 8, height: 6}\nsampler: {type: sobol, spp: 4}\n"


def test_what_options_and_python_change_is_no_difference() -> None:
    text = f"{SMALL}shapes: [{{type: sphere, radius: 2}}]\n"
    scene = Scene.parse(text)
    film = scene.film.model_copy(update={"width": 16})
    sampler = scene.resolved_sampler.model_copy(update={"spp": 16})
    for changed in (
        scene.changed(film=film, sampler=sampler),
        scene.changed(shapes=[*scene.shapes, {"type": "disk"}]),
        scene.changed(shapes=[{"type": "sphere", "radius": 3.0}], lights=[]),
    ):
        assert files(changed).status == "agree", files(changed).reason
        assert Description(changed, second_reading(text)).differences


def test_what_is_not_read_again_is_named() -> None:
    long = f"{SMALL}# {'x' * MOST_TEXT}\n"
    found = files(Scene.parse(long))
    assert found.status == "agree"
    assert "more than 65,536 characters" in found.reason
    assert "values and defaults" in found.reason
    # JSON of any length is read.
    text = json.dumps({"description": "x" * MOST_TEXT, "film": {"width": 7}})
    assert files(Scene.parse(text)).numbers["unread"] == []


# ---- faults that both renderers share -----------------------------------------------------------


Planted = AbstractContextManager[None]
SOLIDS = (Union, Intersection, Difference)
HOLDERS = (Film, Checker, *SOLIDS, Scene)
"""What has other descriptions as fields."""


@contextmanager
def default(cls: Any, field: str, value: Any) -> Iterator[None]:
    """Another default of a field, in this process."""

    def build() -> None:
        for solid in SOLIDS:
            del solid.__pydantic_core_schema__  # it has the schemas of all shapes
        for one in dict.fromkeys((cls, *HOLDERS)):
            one.model_rebuild(force=True)

    info = cls.__pydantic_fields__[field]
    right = info.default
    try:
        info.default = value
        build()
        yield
    finally:
        info.default = right
        build()


@contextmanager
def code(file: str, old: str, new: str) -> Iterator[None]:
    """Another code of a function."""
    with pytest.MonkeyPatch.context() as patch:
        plant(patch, SourceFault("", "", file, old, new))
        yield


MODEL, MAPS, TEXTURE = "core/model.py", "core/transform.py", "textures/texture.py"
BALL = "shapes: [{type: sphere, center: [1, 2, 3]}]"
TURNED = "{scale: [1, 2, 3]}, {rotate: {axis: [1, 2, 2], degrees: 30}}, {translate: [1, 2, 3]}"
PLACED = f"shapes: [{{type: plane, transform: [{TURNED}]}}]"
ROWS = "[[1, 2, 0, 4], [0, 1, 3, 5], [0, 0, 1, 6]]"
METAL = "materials: {a: {type: rough_conductor, eta: [0.2, 0.9, 1.1], k: 3"

VALIDATORS: dict[str, tuple[str, str, Callable[[], Planted]]] = {
    "one factor of a scale leaves z": (
        "shapes: [{type: box, transform: [{translate: [0, 0, 1]}, {scale: 0.5}]}]",
        "shapes[0].transform[1].scale: the description says 0.5 0.5 0.5, the rendered scene has "
        "0.5 0.5 1",
        lambda: code(MAPS, "return (value,) * 3 if", "return (value, value, 1.0) if"),
    ),
    "y and z of vectors exchanged": (
        BALL,
        "shapes[0].center: the description says 1 2 3, the rendered scene has 1 3 2",
        lambda: code(
            MODEL, "tuple(float(x) for x in value)", "tuple(float(value[k]) for k in (0, 2, 1))"
        ),
    ),
    "green and blue of colours exchanged": (
        "lights: [{type: constant, radiance: [1, 0.8, 0.5]}]",
        "lights[0].radiance: the description says 1 0.8 0.5, the rendered scene has 1 0.5 0.8",
        lambda: code(
            MODEL, "    return rgb\n\n\ndef refl", "    return rgb[::2] + rgb[1:2]\n\n\ndef refl"
        ),
    ),
    "one number for a colour is red alone": (
        "lights: [{type: point, position: [0, 0, 0], intensity: 2}]",
        "lights[0].intensity: the description says 2 2 2, the rendered scene has 2 0 0",
        lambda: code(MODEL, "value = (value, value, value)", "value = (value, 0, 0)"),
    ),
    "reflectances decoded as sRGB": (
        "materials: {a: {type: diffuse, reflectance: [0.5, 0.25, 1]}}",
        "materials.a.reflectance: ",
        lambda: code(
            MODEL,
            'would create energy")\n    return rgb',
            'would create energy")\n    return tuple(x**2.2 for x in rgb)',
        ),
    ),
    "directions reversed": (
        "lights: [{type: directional, direction: [-1, -2, 0.5], irradiance: 1}]",
        "lights[0].direction: the description says -1 -2 0.5, the rendered scene has 1 2 -0.5",
        lambda: code(MODEL, "    return v\n", "    return tuple(-x for x in v)\n"),
    ),
    "steps of a transform in reverse": (
        PLACED,
        "shapes[0].transform[0]",
        lambda: code(
            MAPS,
            '({"matrix": value},)\n    return value',
            '({"matrix": value},)\n    return value[::-1]',
        ),
    ),
    "the last step of a transform lost": (
        PLACED,
        "shapes[0].transform: the description says 3 steps, the rendered scene has 2",
        lambda: code(
            MAPS,
            '({"matrix": value},)\n    return value',
            '({"matrix": value},)\n    return value[:-1]',
        ),
    ),
    "a matrix read by columns": (
        f"shapes: [{{type: plane, transform: {ROWS}}}]",
        "shapes[0].transform[0].matrix[0]: the description says 1 2 0 4, the rendered scene has "
        "1 0 0 4",
        lambda: code(
            MAPS,
            "return tuple(map(tuple, rows))",
            "return tuple((*(r[k] for r in rows), rows[k][3]) for k in range(3))",
        ),
    ),
    "a matrix without its offset": (
        f"shapes: [{{type: plane, transform: [{{matrix: {ROWS}}}]}}]",
        "shapes[0].transform[0].matrix[0]",
        lambda: code(
            MAPS, "return tuple(map(tuple, rows))", "return tuple((*r[:3], 0.0) for r in rows)"
        ),
    ),
    "one number for u and v is u's": (
        "textures: {a: {type: checker, uv: {scale: 4}}}",
        "textures.a.uv.scale: the description says 4 4, the rendered scene has 4 1",
        lambda: code(TEXTURE, "value = (value, value)", "value = (value, 1.0)"),
    ),
    "u and v of pairs exchanged": (
        "textures: {a: {type: checker, uv: {offset: [0.25, 0]}}}",
        "textures.a.uv.offset: the description says 0.25 0, the rendered scene has 0 0.25",
        lambda: code(TEXTURE, "value = tuple(value)", "value = tuple(value[::-1])"),
    ),
    "alpha squared": (
        f"{METAL}, alpha: 0.5}}}}",
        "materials.a.alpha: the description says 0.5 0.5, the rendered scene has 0.25 0.25",
        lambda: code(
            "materials/microfacet/ggx_and_smith.py", "else float(a) for", "else float(a) ** 2 for"
        ),
    ),
    "alpha along u for both": (
        f"{METAL}, alpha: [0.5, 0.1]}}}}",
        "materials.a.alpha: the description says 0.5 0.1, the rendered scene has 0.5 0.5",
        lambda: code(
            "materials/microfacet/ggx_and_smith.py",
            "float(a) for a in both)",
            "float(a) for a in both[:1] * 2)",
        ),
    ),
    "a matrix alone applied twice": (
        f"shapes: [{{type: plane, transform: {ROWS}}}]",
        "shapes[0].transform: the description says 1 steps, the rendered scene has 2",
        lambda: code(MAPS, 'return ({"matrix": value},)', 'return ({"matrix": value},) * 2'),
    ),
    "a view upside down": (
        "camera: {type: perspective, view: [-1, 1, -0.5, 1]}",
        "camera.view: the description says -1 1 -0.5 1, the rendered scene has -1 1 -1 0.5",
        lambda: code("cameras/view_rectangle.py", "return l, r, b, t", "return l, r, -t, -b"),
    ),
    "points of two numbers at z = 1": (
        "shapes: [{type: polygon, rings: [[[0, 0], [1, 0], [0, 1]]]}]",
        "shapes[0].rings",
        lambda: code("shapes/flat/polygon.py", "(*value, 0.0)", "(*value, 1.0)"),
    ),
}
"""Text, what the rung says of the place, and the fault."""

DEFAULTS: tuple[tuple[Any, str, Any, str], ...] = (
    (Perspective, "near", 0.5, "camera: {type: perspective}"),
    (Perspective, "up", (0.0, -1.0, 0.0), "camera: {type: perspective, fov: 30}"),
    (Perspective, "fov_axis", "y", "camera: {type: perspective, fov: 30}"),
    (Orthographic, "width", 1.0, "camera: {type: orthographic}"),
    (Pinhole, "film_distance", 2.0, "camera: {type: pinhole}"),
    (ThinLens, "focus_distance", 1.0, "camera: {type: thin_lens, aperture_radius: 0.1}"),
    (GaussianFilter, "stddev", 0.6, "film: {filter: {type: gaussian}}"),
    (Sobol, "seed", 1, "sampler: {type: sobol}"),
    (PathTracing, "max_depth", 3, "integrator: {type: path}"),
    (Direct, "shadows", False, "integrator: {type: direct}"),
    (Torus, "minor_radius", 0.2525, "shapes: [{type: torus}]"),
    (Cone, "height", 2.0, "shapes: [{type: cone}]"),
    (Cylinder, "capped", False, "groups: {a: [{type: cylinder}]}"),
    (Sphere, "radius", 0.5, "shapes: [{type: union, of: [{type: sphere}]}]"),
    (Polygon, "fill", "nonzero", "shapes: [{type: polygon, rings: [[[0, 0], [1, 0], [0, 1]]]}]"),
    (Diffuse, "reflectance", (0.5, 0.5, 0.4), "materials: {a: {type: diffuse}}"),
    (RoughConductor, "alpha", (0.12, 0.12), f"{METAL}}}}}"),
    (Dielectric, "interior_ior", 1.45, "materials: {a: {type: dielectric}}"),
    (GltfPbr, "metallic", 0.0, "materials: {a: {type: gltf_pbr}}"),
    (GltfPbr, "ior", 1.45, "materials: {a: {type: gltf_pbr}}"),
    (Mask, "opacity", 1.0, "materials: {b: {type: mirror}, a: {type: mask, base: b}}"),
    (Checker, "second", (0.0, 0.0, 0.0), "textures: {a: {type: checker}}"),
    (VertexColours, "without", (1.0, 1.0, 1.0), "textures: {a: {type: vertex_colours}}"),
    (UvMap, "rotate", 90.0, "textures: {a: {type: checker, uv: {scale: 2}}}"),
    (
        Spot, "cutoff_angle", 21.0,
        "lights: [{type: spot, origin: [0, 0, 1], target: [0, 0, 0], intensity: 1}]",
    ),
    (
        Spot, "beam_width", 20.0,
        "lights: [{type: spot, origin: [0, 0, 1], target: [0, 0, 0], intensity: 1}]",
    ),
    (
        Projector, "fov", 90.0,
        "lights: [{type: projector, origin: [0, 0, 1], target: [0, 0, 0], irradiance: 1}]",
    ),
)  # fmt: skip
"""A field, another default, and a text that leaves it out."""


@pytest.mark.parametrize("name", VALIDATORS)
def test_faults_of_validators(name: str) -> None:
    text, place, planted = VALIDATORS[name]
    assert files(Scene.parse(text)).status == "agree"
    with planted():
        found = files(Scene.parse(text))
    assert found.status == "differ"
    assert place in found.reason
    assert files(Scene.parse(text)).status == "agree"


@pytest.mark.parametrize("fault", DEFAULTS, ids=lambda fault: f"{fault[0].__name__}.{fault[1]}")
def test_faults_of_defaults(fault: tuple[Any, str, Any, str]) -> None:
    cls, field, value, text = fault
    assert files(Scene.parse(text)).status == "agree"
    with default(cls, field, value):
        read = files(Scene.parse(text))
        kept = Scene.parse(text)
        python = files(Scene(**{name: getattr(kept, name) for name in kept.model_fields_set}))
    for found in (read, python):
        assert found.status == "differ", found.reason
        assert re.search(rf"[.\]\w]\.{field}: the documented default is ", found.reason)
