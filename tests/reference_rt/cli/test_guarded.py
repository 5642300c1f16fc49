"""Warnings about scenes, as commands report them."""

import ast
import warnings
from pathlib import Path

import pytest
import typer
from command_line import invoke
from typer.testing import CliRunner

from reference_rt.cli.guarded import MOST_ALIKE, OURS, guarded, our_warnings
from reference_rt.jit.kernel_cache import prepare_folder
from reference_rt.util.errors import SceneWarning

ROOT = Path(__file__).parents[3]

FLAT = "scene.yaml:{}: shapes[{}]: mesh part{}.ply: {} of 1,260 triangles have no area"


def told(*texts: str) -> list[str]:
    found: list[str] = []
    with our_warnings(found.append):
        for text in texts:
            warnings.warn(SceneWarning(text), stacklevel=1)
    return found


def test_warnings_of_one_kind_are_counted():
    many = [FLAT.format(k + 9, k, k, 3 + k % 5) for k in range(400)]
    other = "scene.yaml: camera: the picture is black"
    assert told(*many[:200], other, *many[200:]) == [
        *many[:MOST_ALIKE],
        other,
        f"{many[-1]} ({400 - MOST_ALIKE - 1} more warnings of this kind are left out)",
    ]


@pytest.mark.parametrize("count", range(MOST_ALIKE + 2))
def test_few_warnings_are_all_reported(count):
    some = [FLAT.format(k, k, k, k) for k in range(count)]
    assert told(*some) == some


def test_the_same_warning_is_reported_once():
    assert told(*["scene.yaml: the same"] * 10) == ["scene.yaml: the same"]


def test_all_warnings_of_ours_are_reported(monkeypatch, tmp_path):
    """Each has a class by which commands know it.  Of the cache it has no line of source."""
    packages = (ROOT / "reference_rt", ROOT / "comparisons")
    texts = [path.read_text(encoding="utf-8") for of in packages for path in of.rglob("*.py")]
    calls = [
        ast.unparse(node)
        for text in texts
        if "warnings.warn" in text
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) in ("warnings.warn", "warnings.warn_explicit")
    ]
    assert len(calls) > 5
    named = [any(ours.__name__ in call for ours in OURS) for call in calls]
    assert [call for call, is_ours in zip(calls, named, strict=True) if not is_ours] == []

    monkeypatch.setenv("REFERENCE_RT_CACHE", str(tmp_path))
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels").chmod(0o777)
    program = typer.Typer()
    program.command()(guarded(prepare_folder))
    said = CliRunner().invoke(program, []).stderr
    assert said.startswith(f"warning: kernels are not cached: {tmp_path}/kernels belongs to")
    assert len(said.splitlines()) == 1


def test_other_warnings_are_pythons():
    with pytest.warns(UserWarning, match="another"), our_warnings(pytest.fail):
        warnings.warn("another", UserWarning, stacklevel=1)


def test_they_are_reported_before_an_error():
    found: list[str] = []

    def fail() -> None:
        with our_warnings(found.append):
            for k in range(10):
                warnings.warn(SceneWarning(FLAT.format(k, k, k, k)), stacklevel=1)
            raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        fail()
    assert len(found) == MOST_ALIKE + 1


def test_a_scene_of_many_damaged_meshes(tmp_path):
    mesh = (
        "  - {type: mesh, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]],"
        " faces: [[0, 1, 2], [0, 1, 3]]}\n"
    )
    scene = tmp_path / "scene.yaml"
    scene.write_text("film: {width: 4, height: 4}\nshapes:\n" + 50 * mesh)
    result = invoke("render", scene, "-o", tmp_path / "out.exr")
    assert result.exit_code == 0, result.output
    lines = [line for line in result.stderr.splitlines() if "have no area" in line]
    assert len(lines) == MOST_ALIKE + 1
    assert lines[-1].endswith("(46 more warnings of this kind are left out)")


@pytest.mark.parametrize("width", [50, 200])
def test_help_is_wrapped_where_the_terminal_ends(width, monkeypatch):
    """A paragraph is one line on a wide terminal, however long the lines of the source are."""

    def command() -> None:
        """Do it.

        The first line of a paragraph in the source ends at about its hundredth column, and the
        paragraph goes on.
        """

    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", width)
    program = typer.Typer()
    program.command()(guarded(command))
    lines = CliRunner().invoke(program, ["--help"]).stdout.splitlines()
    (first,) = [k for k, one in enumerate(lines) if "The first" in one]
    (last,) = [k for k, one in enumerate(lines) if "goes on." in one]
    assert max(map(len, lines)) <= width
    # A line ends only where the next word, of ten letters at most, would not fit.
    assert all(len(one.rstrip()) >= width - 12 for one in lines[first:last])
    assert (first == last) == (width == 200)
