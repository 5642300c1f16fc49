"""Random scenes: valid, lit, a function of their number, of all types of the schema."""

from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field

from comparisons.experiments.fuzz import assets, fields, schema
from comparisons.experiments.fuzz.coverage import coverage
from comparisons.experiments.fuzz.data import shapes_of, text_of
from comparisons.experiments.fuzz.fields import Draw, Names
from comparisons.experiments.fuzz.finding import Grammar
from comparisons.experiments.fuzz.generate import generate, parse
from comparisons.experiments.fuzz.meshes import CLOSED, DAMAGES, OPEN, mesh
from comparisons.experiments.fuzz.schema import GROUPS, all_types, possible_pairs, types_in
from reference_rt.core.model import Positive
from reference_rt.materials import Diffuse, Mirror
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.scene.model import json_schema
from reference_rt.shapes.meshes.mesh import Mesh
from reference_rt.shapes.shape import TabulationContext
from reference_rt.util.errors import UsageError

pytestmark = pytest.mark.filterwarnings("ignore::reference_rt.util.errors.SceneWarning")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return assets.write(tmp_path_factory.mktemp("files"))


@pytest.fixture
def dark(monkeypatch):
    """No picture is rendered, to see whether it shows light: each scene is mended, as often as it
    can be."""
    monkeypatch.setattr("comparisons.experiments.fuzz.generate._shows_light", lambda *_: False)


def test_every_type_of_the_schema_is_known():
    defined = {
        part["properties"]["type"]["const"]
        for part in json_schema()["$defs"].values()
        if "const" in part.get("properties", {}).get("type", {})
    }
    # `light` refuses many lamps and scenes.
    assert defined - {"light"} == {name for kind, name in all_types() if kind != "step"}


@pytest.mark.usefixtures("dark")
def test_a_scene_is_a_function_of_its_seed_and_number(files):
    first, again = (generate(5, 3, Grammar(), files) for _ in range(2))
    assert first == again
    assert generate(5, 4, Grammar(), files) != first
    assert generate(6, 3, Grammar(), files) != first


@pytest.mark.cases(1)
@pytest.mark.parametrize("extreme", [False, True])
def test_scenes_are_valid_and_survive_their_text(files, extreme):
    for number in range(12):
        data = generate(11, number, Grammar(extreme=extreme), files)
        scene = parse(data, number, files)
        build_tables(scene)
        assert parse(data, number, files).digest() == scene.digest()
        for text in (scene.to_json(), scene.to_yaml()):  # every bit of every number comes back
            again = Scene.parse(text, folder=files)
            assert again == scene
            assert again.digest() == scene.digest()
        assert text_of(data).count("\n") < 60


@pytest.mark.usefixtures("dark")
def test_features_are_in_every_scene(files):
    for number in range(4):
        names = {n for _, n in types_in(generate(1, number, Grammar(("csg", "glass")), files))}
        assert names & set(GROUPS["csg"])
        assert names & set(GROUPS["glass"])
    with pytest.raises(UsageError, match=r"no 'glas'.*did you mean 'glass'"):
        schema.features(("glas",))


def test_what_a_type_needs_no_line_for(monkeypatch):
    """A type that is new in the schema is drawn from its fields alone."""

    class Velvet(Diffuse):
        type: Literal["velvet"] = "velvet"
        pile: Positive = 1.0
        tint: Annotated[float, Field(ge=0.0, le=1.0)]

    monkeypatch.setitem(
        schema.KINDS, "material", Annotated[Mirror | Velvet, Field(discriminator="type")]
    )
    schema.types.cache_clear()
    try:
        assert schema.types("material")["velvet"] is Velvet
        draw = Draw(np.random.default_rng(0))
        drawn = [fields.values(Velvet, draw, Names(textures=["t"])) for _ in range(40)]
    finally:
        schema.types.cache_clear()
    for one in drawn:
        Velvet.model_validate(one)
    assert {key for one in drawn for key in one} == {"type", "pile", "tint", "reflectance"}
    assert any(one.get("reflectance") == "t" for one in drawn)


def test_meshes_whole_and_damaged_can_be_tabulated():
    draw = Draw(np.random.default_rng(1))
    for make in (*CLOSED, *OPEN):
        for damage in (None, *DAMAGES):
            vertices, faces = make(draw)
            if damage is not None:
                vertices, faces = damage(draw, vertices, faces)
            fields_of = {"type": "mesh", "vertices": vertices.tolist(), "faces": faces.tolist()}
            assert Mesh.model_validate(fields_of).tabulate(TabulationContext()) is not None
    kept = [mesh(draw) for _ in range(60)]
    assert {key for one in kept for key in one} >= {"uv", "colours", "normals", "smooth"}
    assert all(set(mesh(draw, closed=True)) == {"type", "vertices", "faces"} for _ in range(9))


def test_walks_find_shapes_in_groups_and_solids():
    scene = {
        "shapes": [{"type": "union", "of": [{"type": "box"}, {"type": "sphere"}]}],
        "groups": {"g": [{"type": "disk"}]},
    }
    assert [s["type"] for s in shapes_of(scene)] == ["union", "box", "sphere", "disk"]


def test_coverage_counts_types_and_pairs():
    found = coverage([["shape:sphere", "material:mirror"], ["shape:sphere", "shape:box"]])
    assert found.types["shape:sphere"] == 2
    assert found.types["shape:torus"] == 0
    assert found.pairs == 2
    assert found.possible == len(possible_pairs())
    assert ("shape:box", "shape:sphere") not in found.missing
    of_spheres = ("shape:sphere", 2, pytest.approx(2 / (len(all_types()) - 1)))
    assert of_spheres in found.rows()
    kinds = [{a[0], b[0]} for a, b in possible_pairs()]
    assert {"camera"} not in kinds
    assert {"shape"} in kinds


@pytest.mark.slow
def test_many_scenes_are_valid_lit_and_of_all_types(files):
    seen, lit, count = [], 0, 1000
    for number in range(count):
        data = generate(77, number, Grammar(), files)
        scene = parse(data, number, files)  # valid, or it raises
        build_tables(scene)
        if number % 10 == 0:
            lit += bool(render(scene, size=(8, 6), spp=4, threads=1).layers)
        seen.append({f"{kind}:{name}" for kind, name in types_in(data)})
    found = coverage(seen)
    assert min(found.types.values()) > 0
    assert found.share > 0.9


def test_numbers_are_not_rounded_to_the_ends_of_open_ranges():
    """Three digits of 179.97 are 180; a range of a thousandth has its ends in half of the draws."""
    part = {"exclusiveMinimum": 1.0, "exclusiveMaximum": 1.02}
    draw = Draw(np.random.default_rng(2))
    found = {fields._number(part, draw) for _ in range(50)}
    assert found == {1.01}
