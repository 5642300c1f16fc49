"""explain: what it says is what the tables hold; nothing is both used and left out."""

import pytest
from builders import SCENES, everything
from typer.testing import CliRunner

import reference_rt as rt
from reference_rt import trees
from reference_rt.cli import app
from reference_rt.explain import explain
from reference_rt.shapes import TABLES

FILES = sorted(SCENES.glob("*.yaml"))

SHAPES = tuple(field for _, field, _, _ in TABLES)
MATERIALS = ("diffuses", "mirrors", "dielectrics")


def explained(scene):
    tables = rt.build_tables(scene)
    used, left_out = explain(scene, tables)
    return tables, dict(used), dict(left_out)


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_tables(file):
    scene = rt.Scene.load(file)
    tables, used, left_out = explained(scene)
    for parts, names in ((tables.geometry.shapes, SHAPES), (tables.materials, MATERIALS)):
        for name in names:
            table = getattr(parts, name)
            assert (name in left_out) == (table is None)
            assert (name in used) == (table is not None)
            if table is not None:
                assert used[name].startswith(f"{len(table[0]):,}")
    assert ("hierarchy" in used) == (tables.geometry.bvh is not None)
    assert ("hierarchy" in left_out) == (tables.geometry.bvh is None)
    if not isinstance(scene.integrator, rt.RayCast):
        assert ("environment" in used) == (tables.lights.environment is not None)
        assert ("point lights" in used) == (tables.lights.points is not None)
        assert ("emissive primitives" in used) == (tables.lights.areas is not None)
    assert not set(used) & set(left_out)


def test_everything_is_used(tmp_path):
    _, used, left_out = explained(rt.Scene.load(everything(tmp_path)))
    assert set(SHAPES) | set(MATERIALS) | {"solids", "instances"} <= set(used)
    assert set(left_out) == {"vertex normals", "vertex colours", "texture coordinates", "Mitsuba"}


def test_nothing_is_used():
    _, used, left_out = explained(rt.Scene())
    assert set(SHAPES) | set(MATERIALS) | {"hierarchy", "light sampling"} <= set(left_out)
    assert set(used) == {"camera", "integrator", "film", "samples"}


def test_the_hierarchy_by_number(monkeypatch):
    scene = rt.Scene(shapes=(rt.Sphere(),) * 3)
    assert "hierarchy" in explained(scene)[2]
    monkeypatch.setattr(trees, "BVH_FROM", 3)
    assert "hierarchy" in explained(scene)[1]


def test_whitted_on_a_grid():
    scene = rt.Scene(
        integrator=rt.Whitted(),
        shapes=(rt.Sphere(),),
        lights=(rt.Constant(radiance=(1, 1, 1)), rt.Point(position=(0, 2, 0), intensity=(1, 1, 1))),
    )
    _, used, left_out = explained(scene)
    assert "random numbers" in left_out
    assert "light of the environment" in left_out
    assert used["point lights"] == "1"


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_command(file):
    """Everything lands on standard output, whatever the width of the terminal."""
    result = CliRunner().invoke(app, ["explain", str(file)], env={"COLUMNS": "200"})
    assert result.exit_code == 0
    assert result.stderr == ""
    scene = rt.Scene.load(file)
    for lines in explain(scene, rt.build_tables(scene)):
        for what, why in lines:
            assert what in result.stdout
            assert why in result.stdout
