"""The second reading of scene files: its table is what the documentation says and has every field;
right scenes are as it says; and of faults in validators and defaults, which both renderers share,
the rung `files` names the place."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from builders import SCENES

from comparisons.experiments.fuzz import assets, generate
from comparisons.experiments.fuzz.data import text_of
from comparisons.experiments.fuzz.finding import Grammar
from comparisons.rungs import files
from comparisons.rungs.files.description import (
    MOST_TEXT,
    Description,
    documented,
    fields_of,
    second_reading,
)
from reference_rt.cameras import AnyCamera, Perspective
from reference_rt.cameras.film import AnyFilter, Film
from reference_rt.core.model import Description as Model
from reference_rt.core.model import name_of, types_of
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate, Turn
from reference_rt.integrators import AnyIntegrator
from reference_rt.lights import AnyLight
from reference_rt.materials import (
    AnyMaterial,
)
from reference_rt.media import AnyMedium, AnyPhase
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import AnySampler
from reference_rt.scene.examples import NAMED, examples
from reference_rt.scene.model import SceneModel
from reference_rt.shapes.csg import AnyShape
from reference_rt.textures import AnyTexture
from reference_rt.textures.texture import UvMap

# ---- the table ----------------------------------------------------------------------------------

PAGE = (Path(__file__).parents[3] / "docs" / "scene_reference.md").read_text(encoding="utf-8")

SECTIONS = {
    "Cameras": "cameras", "Filters": "filters", "Samplers": "samplers",
    "Integrators": "integrators", "Shapes": "shapes", "Solids": "shapes",
    "Transforms": "transforms", "Materials": "materials", "Textures": "textures",
    "Materials made of others": "materials", "Lights": "lights", "Media": "media",
    "Phase functions": "phases",
}  # fmt: skip
"""The table's name of each of the page's sections."""

KINDS = {
    "number": r"number( .*)?", "integer": r"integer .*", "flag": r"`true`, `false`",
    "text": r"text|(`\w+`, )+`\w+`", "text or texts": r".* or a list of (`\w+`, )+`\w+`",
    "texts": r"a list of .*", "vector": r"3 numbers",
    "numbers": r"(4|10) numbers|a list of (a list of )?numbers",
    "colour": r"colour [^a-z]*( to 1)?|colour from 0 to 1", "factors": "number or a list",
    "pair": r"number or 2 numbers", "pair or texture": r"number .*2 numbers or a texture's name",
    "number or texture": r"number .*or a texture's name",
    "colour or texture": r"colour .*or a texture's name", "turn": "keys below",
    "rows": r"a list of [23] (numbers|integers)( or more)?|2 rows of 3 numbers|a list",
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
    "textures": AnyTexture, "media": AnyMedium, "phases": AnyPhase,
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


def agrees(scene: Scene, said: Any = None) -> int:
    """The number of values that were compared."""
    found = Description(scene, said)
    assert found.differences == []
    return found.values


@pytest.mark.filterwarnings("ignore")
def test_every_scene_is_as_it_says() -> None:
    """As YAML, as JSON, and made in Python of the same fields."""
    values = 0
    for path in sorted(SCENES.rglob("*.yaml")):
        scene, said = Scene.load(path), second_reading(path.read_text(encoding="utf-8"))
        values += agrees(scene, said)
        agrees(Scene.parse(json.dumps(said), folder=path.parent), said)
        agrees(Scene(**{name: getattr(scene, name) for name in scene.model_fields_set}))
    assert values > 9_000


@pytest.mark.filterwarnings("ignore")
def test_random_scenes_are_as_they_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assets.write(tmp_path)
    monkeypatch.setattr(generate, "_shows_light", lambda *given: True)  # not rendered here
    for number in range(30):
        grammar = Grammar(extreme=number % 3 == 0)
        data = generate.generate(54, number, grammar, tmp_path)
        scene = Scene.parse(text_of(data), folder=tmp_path)
        agrees(scene, second_reading(text_of(data)))
        agrees(scene, second_reading(json.dumps(data)))


def example_texts() -> Iterator[tuple[str, str, str]]:
    """Texts with each example of each type; the key of the scene and the name or number there."""
    whole = {key: {name: _plain(one) for name, one in of.items()} for key, of in NAMED.items()}
    without_media = {key: of for key, of in whole.items() if key != "media"}
    alone = {"cameras": "camera", "samplers": "sampler", "integrators": "integrator"}
    for section, union in UNIONS.items():
        rest = without_media if section in ("samplers", "integrators") else whole
        for one in examples(union):
            data = one.model_dump(mode="json", exclude_unset=True) | {"type": one.type}
            more: dict[str, Any] = {}
            if one.type == "grid":
                more = {"integrator": {"type": "whitted"}}
            if section == "filters":
                yield json.dumps(rest | {"film": {"filter": data}}), "film", "filter"
            elif section in alone:
                yield json.dumps(rest | more | {alone[section]: data}), alone[section], ""
            elif section == "phases":
                medium = _plain(NAMED["media"]["medium"]) | {"phase": data}
                yield json.dumps(rest | {"media": {"medium": medium}}), "media", "phase"
            elif section in ("materials", "textures", "media"):
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
        agrees(Scene.parse(text), second_reading(text))


def test_another_value_of_any_field_is_seen() -> None:
    """Of each example: each field, one after another, that is set or that has its default."""
    seen = set()
    for text, key, name in example_texts():
        scene, said = Scene.parse(text), second_reading(text)
        of = getattr(scene, key)
        one = of.filter if name == "filter" else of[int(name)] if name == "0" else of
        one = of[name] if name == "this" else one
        one = of["medium"].phase if name == "phase" else one
        for field in type(one).model_fields:
            changed = one.model_copy(update={field: _other(getattr(one, field))})
            if field not in one.model_fields_set:
                changed.__pydantic_fields_set__.discard(field)
            put: Any = {"filter": lambda c, of: of.model_copy(update={"filter": c})}
            put |= {"phase": lambda c, of: {"medium": of["medium"].model_copy(update={"phase": c})}}
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


@pytest.mark.parametrize(
    "text",
    [
        *("shapes: 5", "shapes: [5]", "shapes: [{type: 5}]", "camera: [1]", "film: 7", "film: [a]"),
        *("textures: [a]", "materials: {a: 5}", "materials: {}", "groups: {a: 5}", "sampler: 5"),
        *("shapes: [{type: sphere, center: {}}]", "shapes: [{type: sphere, transform: 5}]"),
        *("shapes: [{type: sphere, transform: [5]}]", "shapes: [{type: sphere, transform: [{}]}]"),
        *("shapes: [{type: sphere, transform: [{matrix: 5}]}]", "film: {filter: 5}"),
    ],
)
def test_another_form_is_a_difference(text: str) -> None:
    """Whatever another reader finds: no error of the comparison."""
    scene = Scene.parse(
        "materials: {a: {type: mirror}}\nshapes: [{type: sphere, transform: [{scale: 2}]}]\n"
        "groups: {a: [{type: disk}]}\ntextures: {a: {type: checker}}\n"
    )
    assert Description(scene, second_reading(text)).differences


def test_words_of_yaml_that_others_read_otherwise() -> None:
    text = """
description: 2026-11-28
shapes: [{type: sphere, radius: .5e3, material: =}, {type: mesh, file: ".5e3"}]
materials: {=: {type: mirror}, 2001-09-09: {type: diffuse, reflectance: +.5}, "1e3": {type: mirror}}
lights: [{type: point, position: [1_0, 0x10, 1.E-1], intensity: 0o17}]
sampler: &it {type: sobol, spp: 4}
"""
    assert agrees(Scene.parse(text), second_reading(text)) > 20


def test_what_is_not_read_again_is_named() -> None:
    long = f"{SMALL}# {'x' * MOST_TEXT}\n"
    found = files(Scene.parse(long))
    assert found.status == "agree"
    assert "more than 65,536 characters" in found.reason
    assert "values and defaults" in found.reason
    found = files(Scene.parse("%YAML 1.1\n---\nfilm: {width: 010}"))
    assert (found.status, found.numbers["unread"]) == (
        "agree",
        ["descriptions with a directive %YAML"],
    )
    # JSON of any length is read.
    text = json.dumps({"description": "x" * MOST_TEXT, "film": {"width": 7}})
    assert files(Scene.parse(text)).numbers["unread"] == []
