"""`reference-rt methods`: the command, and what it writes."""

import json
from fractions import Fraction

import numpy as np
import pytest
from command_line import invoke

from comparisons.experiments.methods import outputs, run
from comparisons.experiments.methods.errors import barycentric_error, exact
from comparisons.experiments.methods.run import FAMILIES, SERIES, Draw, Effort, methods
from reference_rt import textbook

TINY = Effort(rays=256, runs=3)


def nothing(_what, _fraction):
    pass


@pytest.fixture(scope="module")
def rows():
    return [r for name in ("sphere", "polygon") for r in run.run(name, TINY, 5, nothing)]


@pytest.fixture
def program(monkeypatch):
    """The command with a small effort."""
    monkeypatch.setattr(run, "QUICK", TINY)
    return lambda *words: invoke("methods", *words)


@pytest.mark.cases(1)
@pytest.mark.parametrize("series", SERIES, ids=lambda one: f"{one.family} {one.name}")
def test_all_methods_find_the_same_hits(series, tmp_path):
    """Else their times are not those of the same work.  Some rays hit and some miss."""
    rng = np.random.default_rng(2)
    (trial, *_) = series.make(Draw(rng, 512, tmp_path), series.values[:3][-1])
    found = []
    for method in methods(series.family).values():
        t = np.empty(len(trial.o))
        with np.errstate(all="ignore"):
            method.run(method.prepare(trial.part), trial.o, trial.d, t)
        found.append(np.isfinite(t))
    assert 0.05 < found[0].mean() < 0.95
    assert all((hit == found[0]).all() for hit in found)


def test_every_method_of_the_textbook_is_timed():
    assert {m for family in FAMILIES for m in methods(family)} == {
        *textbook.METHODS,
        "csg.renderer",
    }


def test_barycentrics_of_slivers_by_rational_arithmetic(tmp_path):
    """By areas the point is rounded first: its error grows with the square of length over height,
    that of all others with length over height itself."""
    grown = {}
    for name in textbook.names("triangle"):
        found = []
        for aspect in (1e2, 1e6):
            rng = np.random.default_rng(4)
            trials = run.slivers(Draw(rng, 1024, tmp_path), aspect)
            found.append(barycentric_error(name, trials))
        grown[name] = None if found[0] is None else np.log10(found[1] / found[0]) / 4.0
    assert grown.pop("triangle.two_step") is None
    for name in ("triangle.areas", "triangle.projected_areas"):
        assert 1.8 < grown.pop(name) < 2.2
    assert len(grown) == 4
    assert all(0.9 < power < 1.1 for power in grown.values())


def test_exact_barycentrics():
    """(1/3, 1/4) of a triangle, met at t = 1 and at 8/5."""
    corners = np.array([[1.0, 2.0, 3.0], [13.0, 2.0, 3.0], [1.0, 14.0, 3.0]])
    d = np.array([2.0, 3.0, 5.0])
    o = np.array([5.0, 5.0, 3.0]) - d
    assert exact(corners, o, d) == [1, Fraction(1, 3), Fraction(1, 4)]
    assert exact(corners, o, d * 0.625) == [Fraction(8, 5), Fraction(1, 3), Fraction(1, 4)]


def test_json_and_csv_agree(rows, tmp_path):
    outputs.write(tmp_path, rows, TINY, 5, {"machine": "here"})
    document = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert (document["schema"], document["seed"]) == (2, 5)
    assert document["effort"] == {"rays": 256, "runs": 3}
    head, *lines = (tmp_path / "results.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == len(document["rows"]) == len(rows) == 3 + 5 * 4
    assert set(document["meaning"]) <= set(head.split(","))
    for row in document["rows"]:
        assert 0.0 < row["ns_low"] <= row["ns"] <= row["ns_high"]
        assert (row["x"] is None) == (row["family"] == "sphere")


def test_the_page_stands_alone(rows, tmp_path, check_page):
    outputs.write_page(tmp_path / "methods.html", rows, TINY, 5, {"machine": "<here>"})
    page = (tmp_path / "methods.html").read_text(encoding="utf-8")
    for text in ("&lt;here&gt;", "13 +, 16 ×, 2 /, 1 sqrt", "gears, 16 vertices"):
        assert text in page
    assert "<script" not in page
    assert 'src="http' not in page
    assert page.count("<svg") == 1
    check_page(tmp_path / "methods.html")


def test_costs_are_those_of_the_docstrings():
    assert outputs.stated("triangle.moller_trumbore")["fails"] == "as cramer does."
    assert outputs.stated("hierarchy.sah") == outputs.stated("picture.cast_hierarchy") == {}
    with_cost = [n for n in textbook.names() if "cost" in outputs.stated(n)]
    assert len(with_cost) == len(textbook.names()) - len(textbook.names("hierarchy")) - 1


def test_the_command(program, tmp_path):
    result = program("--family", "box", "-o", str(tmp_path / "out"), "--seed", "2")
    assert result.exit_code == 0, result.output
    names = {"results.json", "results.csv", "methods.html"}
    assert {p.name for p in (tmp_path / "out").iterdir()} == names
    assert "six planes" in result.output
    result = program("--family", "cube", "-o", str(tmp_path))
    assert result.exit_code == 2
    assert f"expected one of {', '.join(FAMILIES)}, got 'cube'" in result.output


def test_interrupted_it_keeps_what_is_finished(program, tmp_path, monkeypatch):
    measure_all = run.run

    def until_box(family, *rest):
        if family == "box":
            raise KeyboardInterrupt
        return measure_all(family, *rest)

    monkeypatch.setattr(run, "run", until_box)
    result = program("--family", "sphere", "--family", "box", "-o", str(tmp_path))
    assert result.exit_code == 130
    document = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert {row["family"] for row in document["rows"]} == {"sphere"}
