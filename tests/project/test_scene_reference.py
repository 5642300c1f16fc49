"""docs/scene_reference.md is what its script writes, and its examples are scenes."""

import json
import re
import sys
from pathlib import Path

import yaml

from reference_rt import build_tables

DOCS = Path(__file__).parents[2] / "docs"
sys.path.append(str(DOCS))
import make_reference  # noqa: E402
from reference_scenes import EXAMPLES, PICTURES, VALUES, scene_of, scene_of_value  # noqa: E402

TEXT = make_reference.PAGE.read_text(encoding="utf-8")
AGAIN = "run `python docs/make_reference.py` (with `text`: without the pictures)"


def test_the_page_is_current():
    assert make_reference.page() == TEXT, AGAIN


def test_every_type_has_a_heading_or_is_part_of_one():
    inner = set(make_reference.TYPES) - make_reference.LISTED
    assert inner == {"Turn"}  # `rotate.axis`, `rotate.degrees`
    for name in make_reference.LISTED:
        assert f"\n### {make_reference.word(name)}\n" in TEXT
    for field in ("rotate.axis", "rotate.degrees"):
        assert f"| `{field}` |" in TEXT


def test_every_field_is_there():
    parts = {"Scene": make_reference.SCHEMA, **make_reference.TYPES}
    rows = set(re.findall(r"^\| `(?:\w+\.)?(\w+)` \|.*\| (.*) \|$", TEXT, re.MULTILINE))
    for part in parts.values():
        for field, value in part["properties"].items():
            if "const" not in value:
                assert (field, " ".join(value["description"].split())) in rows


def test_every_link_leads_to_a_heading():
    headings = re.findall(r"^#+ (.*)$", TEXT, re.MULTILINE)
    anchors = {make_reference.anchor(heading) for heading in headings}
    assert set(re.findall(r"\]\(#([^)]*)\)", TEXT)) <= anchors


def test_every_type_has_an_example_and_a_picture():
    assert set(EXAMPLES) == make_reference.LISTED, "reference_examples.yaml"
    assert {path.stem for path in PICTURES.glob("*.jpg")} == set(EXAMPLES), AGAIN


def test_every_value_that_is_a_word_has_a_picture_beside_those_of_the_others():
    """A value that is added to a type fails here until its picture is made."""
    fields = make_reference.FIELDS
    assert set(VALUES) == set(fields), "`values` of reference_examples.yaml"
    assert {"Bitmap.wrap", "RoughConductor.distribution", "Film.layers"} <= set(fields)
    files = {f"{field}.{word}" for field, words in fields.items() for word in words}
    assert {path.stem for path in (PICTURES / "values").iterdir()} == files, AGAIN
    assert sum(path.stat().st_size for path in (PICTURES / "values").iterdir()) < 400_000
    for field, words in fields.items():
        name = field.partition(".")[2]
        shown = [f"![{name}: {w}](pictures/reference/values/{field}.{w}.jpg)" for w in words]
        places = [TEXT.index(text) for text in shown]
        assert places == sorted(places)
        assert "\n\n" not in TEXT[places[0] : places[-1]]


def test_a_value_is_that_of_its_scene():
    def found(part, field):
        if isinstance(part, dict):
            yield from (value for key, value in part.items() if key == field)
        if isinstance(part, dict | list):
            for inner in part.values() if isinstance(part, dict) else part:
                yield from found(inner, field)

    for field, words in make_reference.FIELDS.items():
        for word in words:
            scene = json.loads(scene_of_value(field, word).to_json())
            values = list(found(scene, field.partition(".")[2]))
            assert word in values or [word] in values, (field, word)


def test_what_the_page_shows_is_the_example():
    shown = re.findall(r"^```yaml\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
    assert len(shown) == len(EXAMPLES)
    for text in shown:
        assert all(len(line) <= make_reference.LONGEST_LINE for line in text.splitlines())
    read = [yaml.safe_load(text) for text in shown]
    assert all(yaml.safe_load(example["yaml"]) in read for example in EXAMPLES.values())


def test_an_example_is_a_scene_with_the_type():
    for name, example in EXAMPLES.items():
        assert build_tables(scene_of(name)), name
        assert re.search(rf"\b{make_reference.word(name)}\b", example["yaml"])
