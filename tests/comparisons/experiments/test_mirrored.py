"""Mistakes on both sides: each is real, the same one twice, and never in what judges."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

from comparisons.experiments.selftest import mirrored_worker
from comparisons.experiments.selftest.mirrored import (
    FOLDERS,
    Seen,
    changes_kernels,
    functions_changed,
    seen,
    summary,
    texts,
    write,
)
from comparisons.experiments.selftest.of_mirrored import MISTAKES, Mistake
from comparisons.truth.case import cases

SCENES = Path(__file__).parents[3] / "scenes" / "truth"
BY_NAME = {mistake.name: mistake for mistake in MISTAKES}

COUNTERPARTS = ("mitsuba/", "materials/", "integrators/", "shapes/")
"""Folders of code that stands on Mitsuba's side."""

JUDGES = (
    *("_crossings", "torus_quartic", "_along", "_features"),
    *("tube_for_raysect", "to_raysect", "tube_for_povray", "_to_povray"),
)
"""Functions in these folders by which exact arithmetic, raysect and POV-Ray decide."""


def test_there_are_enough_of_each_kind() -> None:
    assert len(MISTAKES) >= 24
    assert len(BY_NAME) == len(MISTAKES)
    assert {mistake.case for mistake in MISTAKES} <= set(cases())


@pytest.mark.parametrize("name", BY_NAME)
def test_both_sides_are_changed_and_no_judge_is(name: str) -> None:
    mistake = BY_NAME[name]
    for side, changes in (("ours", mistake.ours), ("theirs", mistake.theirs)):
        assert changes
        for file, right, wrong in texts(FOLDERS[side], changes):
            assert right != wrong
            compile(wrong, file, "exec")
            if side == "theirs":
                assert file.startswith(COUNTERPARTS)
                assert not set(functions_changed(right, wrong)) & set(JUDGES)


def test_the_judges_are_where_they_are_thought_to_be() -> None:
    sources = [path.read_text(encoding="utf-8") for path in FOLDERS["theirs"].rglob("*.py")]
    functions = {
        node.name
        for text in sources
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef)
    }
    fields = {"to_raysect"}  # of `ShapeType`
    assert set(JUDGES) - fields <= functions


def test_a_text_that_is_gone_is_told() -> None:
    with pytest.raises(ValueError, match=r"shapes/csg.py: 'no such text' occurs 0 times"):
        list(texts(FOLDERS["ours"], {"shapes/csg.py": (("no such text", ""),)}))


def test_what_compiles_anew() -> None:
    assert changes_kernels(BY_NAME["the highlight times the cosine"].ours)
    assert not changes_kernels(BY_NAME["Phong's exponent halved"].ours)


def test_modules_are_changed_as_they_are_imported(tmp_path: Path) -> None:
    (tmp_path / "apart").mkdir()
    (tmp_path / "apart" / "__init__.py").write_text("")
    (tmp_path / "apart" / "one.py").write_text("def f():\n    return 1\n")
    code = (
        f"import json, runpy, sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        f"w = runpy.run_path({mirrored_worker.__file__!r})\n"
        "w['plant']({'apart.one': [('return 1', 'return 2')]})\n"
        "import apart.one; print(apart.one.f())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "2\n"
    assert not list(tmp_path.rglob("one*.pyc"))


def one(name: str, alike: str = "agree", truth: str = "off", by: tuple[str, ...] = ()) -> Seen:
    return Seen(name, "slab", 0.5, alike, by, "agree", truth, 1.5, (("solids", "agree", ""),))


def test_what_is_counted(tmp_path: Path) -> None:
    found = [one("a", by=("solids",)), one("b"), one("c", truth="right")]
    assert [each.holds for each in found] == [True, True, False]
    assert not one("d", alike="differ").holds
    text = summary(found)
    assert text.startswith("of 3 mistakes on both sides 3 are `agree` between them; other sources ")
    assert text.endswith("see 1, cases of truth 2; nobody sees 1: c")
    write(found, tmp_path)
    assert "| a | agree | solids | slab, +1.5 % |" in (tmp_path / "mirrored.md").read_text()
    assert len(json.loads((tmp_path / "mirrored.json").read_text())["mistakes"]) == 3


def planted(name: str) -> Seen:
    return seen(BY_NAME[name], SCENES, None, 1)


def test_a_mistake_that_only_truth_sees_without_a_witness() -> None:
    found = planted("k_s and k_d exchanged")
    assert found.holds
    assert (found.alike, found.verdict, found.by) == ("agree", "agree", ())


@pytest.mark.slow
def test_a_mistake_of_one_side_is_not_one_of_both() -> None:
    """The check of the class itself: without the change on Mitsuba's side the two differ."""
    mistake = BY_NAME["k_s and k_d exchanged"]
    alone = Mistake(mistake.name, mistake.case, mistake.ours, {})
    found = seen(alone, SCENES, None, 1)
    assert found.alike == "differ"
    assert not found.holds


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_NAME)
def test_no_mistake_on_both_sides_is_unseen(name: str) -> None:
    found = planted(name)
    assert found.holds, found
