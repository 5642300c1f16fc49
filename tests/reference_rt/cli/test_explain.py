"""explain: it describes what the tables hold; no feature is both used and left out."""

import numpy as np
import pytest
from builders import SCENES
from command_line import invoke
from galleries import GALLERIES

import reference_rt as rt
from reference_rt.cli.explain import explain
from reference_rt.lights import TABLES as LIGHT_TABLES
from reference_rt.materials.bsdfs.tables import TABLES as LEAVES
from reference_rt.scene import build_hierarchies
from reference_rt.scene.examples import examples
from reference_rt.shapes import TABLES
from reference_rt.textures import TABLES as TEXTURES

FILES = sorted(SCENES.glob("*.yaml"))

SHAPES = tuple(field for _, field, _, _ in TABLES)
MATERIALS = tuple(field for _, field, _, _, _ in LEAVES)
WRAPPERS = ("layers", "shares", "bumps", "normal maps")
LIGHTS = {
    **{f"lights: {field}": field for _, field, _, _ in LIGHT_TABLES},
    "emissive primitives": "areas",
    "environment": "environment",
    "light tree": "tree",
}


def rows(table):
    """Of a table, whose columns may be tables; triangles share points."""
    if isinstance(table, np.ndarray):
        return len(table)
    return len(table.corners) if hasattr(table, "corners") else rows(table[0])


def explained(scene):
    tables = rt.build_tables(scene)
    used, left_out = explain(scene, tables)
    return tables, dict(used), dict(left_out)


@pytest.mark.cases(24)
@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_tables(file):
    scene = rt.Scene.load(file)
    tables, used, left_out = explained(scene)
    for parts, names in ((tables.geometry.shapes, SHAPES), (tables.materials.leaves, MATERIALS)):
        for name in names:
            table = getattr(parts, name)
            assert (name in left_out) == (table is None)
            assert (name in used) == (table is not None)
            if table is not None:
                assert used[name].startswith(f"{rows(table):,}")
    assert ("hierarchy" in used) == (tables.geometry.bvh is not None)
    assert ("hierarchy" in left_out) == (tables.geometry.bvh is None)
    assert ("layers" in used) == (tables.materials.flat_leaves is not None)
    assert ("tangents" in used) == tables.materials.oriented.any()
    for _, name, _, _ in TEXTURES:
        has = tables.textures is not None and getattr(tables.textures, name) is not None
        assert (f"textures: {name}" in used) == has
    if not isinstance(scene.integrator, rt.RayCast):
        for name, field in LIGHTS.items():
            assert (name in used) == (getattr(tables.lights, field) is not None)
    assert ("film layers" in used) == (scene.film.layers != ())
    assert not set(used) & set(left_out)


def test_everything_is_used(tmp_path):
    """By one of the galleries."""
    layers = iter([(), ("albedo", "normal", "position"), ("depth", "id", "variance")])
    scenes = [
        scene.changed(film=scene.film.model_copy(update={"layers": next(layers)}))
        for scene in (gallery(tmp_path) for gallery in GALLERIES)
    ]
    (_, shapes, _), (_, materials, _), (tables, lights, without) = map(explained, scenes)
    assert set(SHAPES) | {"solids", "instances", "hierarchy"} <= set(shapes)
    textures = {f"textures: {name}" for _, name, _, _ in TEXTURES}
    assert {*MATERIALS, *textures, *WRAPPERS, "tangents"} <= set(materials)
    assert set(LIGHTS) <= set(lights)
    assert materials["film layers"] == "albedo, normal, position"
    assert lights["film layers"] == "depth, id, variance"
    assert lights["light tree"].startswith(f"{(tables.lights.tree.trail >= 0).sum()} lights")
    assert lights["environment"].startswith("a map of 4 x 3 pixels")
    assert {"ambient light", "Mitsuba"} <= set(without)


def test_columns_that_a_mesh_lacks():
    _, _, left_out = explained(rt.Scene(shapes=examples(rt.Mesh)[:1]))
    assert {"vertex normals", "vertex colours", "texture coordinates"} <= set(left_out)


def test_nothing_is_used():
    _, used, left_out = explained(rt.Scene())
    lacking = {"hierarchy", "light sampling", "layers", "tangents", "textures", "film layers"}
    assert set(SHAPES) | set(MATERIALS) | lacking <= set(left_out)
    assert set(used) == {"camera", "integrator", "film", "samples"}


def test_the_hierarchy_by_number(monkeypatch):
    scene = rt.Scene(shapes=(rt.Sphere(),) * 3)
    assert "hierarchy" in explained(scene)[2]
    monkeypatch.setattr(build_hierarchies, "BVH_FROM", 3)
    assert "hierarchy" in explained(scene)[1]


def test_whitted_on_a_grid():
    scene = rt.Scene(
        integrator=rt.Whitted(),
        shapes=(rt.Sphere(),),
        lights=(
            rt.Constant(radiance=(1, 1, 1)),
            rt.Ambient(radiance=(1, 1, 1)),
            rt.Point(position=(0, 2, 0), intensity=(1, 1, 1)),
        ),
    )
    _, used, left_out = explained(scene)
    assert "random numbers" in left_out
    assert "light of the environment" in left_out
    assert used["lights: points"] == "1"
    assert "ambient light" in used


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", ["display_modes", "instances", "many_lights", "textured_room"])
def test_command(name):
    """Everything lands on standard output, whatever the width of the terminal."""
    file = SCENES / f"{name}.yaml"
    result = invoke("explain", file, COLUMNS="200")
    assert result.exit_code == 0
    assert result.stderr == ""
    scene = rt.Scene.load(file)
    for lines in explain(scene, rt.build_tables(scene)):
        for what, why in lines:
            assert what in result.stdout
            assert why in result.stdout
