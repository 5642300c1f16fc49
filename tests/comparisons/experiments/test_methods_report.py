"""`reference-rt methods`: the command, and what it writes."""

import csv
import json
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from comparisons.commands import register
from comparisons.experiments.methods import run
from comparisons.experiments.methods.costs import stated
from comparisons.experiments.methods.page import write_page
from comparisons.experiments.methods.pictures import failures
from comparisons.experiments.methods.run import FAMILIES, Effort
from comparisons.experiments.methods.summary import of_method, series_of, total
from comparisons.experiments.methods.wording import sentences, units
from comparisons.experiments.methods.written import columns, write
from reference_rt import textbook as ways

TINY = Effort(rays=256, checked=64, runs=3)


@pytest.fixture(scope="module")
def rows():
    def nothing(_what, _fraction):
        pass

    return [r for name in ("sphere", "box") for r in run.run(FAMILIES[name], TINY, 5, nothing)]


def test_a_seed_gives_the_same_rows_but_for_the_time(rows):
    def without_time(row):
        return {k: v for k, v in columns(row).items() if k not in ("ns", "ns_low", "ns_high")}

    again = run.run(FAMILIES["box"], TINY, 5, lambda *_: None)
    assert [without_time(r) for r in again] == [without_time(r) for r in rows if r.family == "box"]
    other = run.run(FAMILIES["box"], TINY, 6, lambda *_: None)
    assert [r.errors for r in other] != [r.errors for r in again]
    for row in rows:
        assert 0.0 < row.time.low <= row.time.median <= row.time.high


def test_json_and_csv_agree(rows, tmp_path):
    write(tmp_path, rows, TINY, 5, {"machine": "here"})
    document = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert (document["schema"], document["seed"]) == (1, 5)
    assert document["effort"] == {"rays": 256, "checked": 64, "runs": 3}
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == len(document["rows"]) == len(rows) > 100
    assert set(document["meaning"]) <= set(lines[0])
    for line, row in zip(lines, document["rows"], strict=True):
        assert list(line) == list(row)
        for name, value in row.items():
            assert line[name] == ("" if value is None else str(value)), name
    assert {row["x"] for row in document["rows"] if row["series"] == "along axes"} == {None}


def test_totals_add_up(rows):
    robust = of_method(rows, "sphere.robust")
    some = total(row for row in robust if row.extreme)
    assert some.settings == 6 + 5 + 6
    assert some.decided == sum(r.errors.decided for r in robust if r.extreme)
    assert total([]) is None
    assert set(series_of(robust)) == {"distance", "rim", "surface"}


def test_the_page_can_be_read_by_everybody(rows, tmp_path, check_page):
    write_page(tmp_path / "methods.html", rows, TINY, 5, {})
    check_page(tmp_path / "methods.html")


def test_the_page_stands_alone(rows, tmp_path):
    write_page(tmp_path / "methods.html", rows, TINY, 5, {"machine": "<here>"})
    page = (tmp_path / "methods.html").read_text(encoding="utf-8")
    assert "&lt;here&gt;" in page
    assert "<script" not in page
    assert 'src="http' not in page
    assert page.count("<svg") > 10
    assert page.count("data:image/png") == 3
    for text in ("13 +, 16 ×, 2 /, 1 sqrt", "A sphere seen from 10⁷ radii"):
        assert text in page


def test_sentences_follow_the_numbers(rows):
    said = sentences([r for r in rows if r.family == "sphere"])
    assert said[0].startswith("Time per ray at an ordinary setting (distance / radius 10;")
    assert "robust never, in 640 rays" in said[1]
    assert "algebraic is wrong from 10⁷ on" in said[1]
    right = [
        replace(r, errors=replace(r.errors, lost=0, false=0, misplaced=0, ties=0)) for r in rows
    ]
    said = sentences([r for r in right if r.family == "sphere"])
    assert "no method is wrong for any of 640 rays" in said[1]
    assert [units(v) for v in (None, 0.0, 3.14, 123.4, 2e7)] == ["–", "0", "3.1", "123", "2 × 10⁷"]


def test_pictures_show_who_fails(rows):
    found = failures(rows)
    captions = {name: caption for name, _, caption in found["sphere"].views}
    assert "in shadow" in captions["algebraic"]
    assert captions["robust"] == ""
    assert set(found) == {"sphere"}
    everyone = failures([replace(rows[0], family=name) for name in ("triangle", "csg")])
    assert {name: caption == "" for name, _, caption in everyone["triangle"].views} == {
        "two step": False,
        "Cramer": False,
        "LU": False,
        "Möller-Trumbore": False,
        "watertight": True,
    }
    assert [caption == "" for _, _, caption in everyone["csg"].views] == [False, False, True]


def test_costs_are_those_of_the_docstrings():
    assert stated("sphere.algebraic")["cost"] == "13 +, 16 ×, 2 /, 1 sqrt"
    assert stated("triangle.moller_trumbore")["fails"] == "as cramer does."
    assert stated("hierarchy.sah") == {}
    with_cost = [n for n in ways.names() if "cost" in stated(n)]
    assert len(with_cost) == len(ways.names()) - len(ways.names("hierarchy"))


# ---- the command ---------------------------------------------------------------------------------


@pytest.fixture
def program(monkeypatch):
    """The command with a small effort."""
    monkeypatch.setattr(run, "QUICK", TINY)
    app = register.typer.Typer()
    register.register(app)
    return lambda *words: CliRunner().invoke(app, ["methods", *words])


def test_the_command_writes_all(program, tmp_path):
    result = program("--family", "box", "-o", str(tmp_path / "out"), "--seed", "2")
    assert result.exit_code == 0, result.output
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "results.json",
        "results.csv",
        "methods.html",
    }
    assert "six planes" in result.output
    document = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    assert {row["family"] for row in document["rows"]} == {"box"}


def test_unknown_families_are_refused(program, tmp_path):
    result = program("--family", "cube", "-o", str(tmp_path))
    assert result.exit_code == 2
    assert (
        "expected one of sphere, triangle, box, polygon, csg, hierarchy, got 'cube'"
        in result.output
    )


def test_interrupted_it_keeps_what_is_finished(program, tmp_path, monkeypatch):
    measure_all = run.run

    def until_box(family, *rest):
        if family.name == "box":
            raise KeyboardInterrupt
        return measure_all(family, *rest)

    monkeypatch.setattr(run, "run", until_box)
    result = program("--family", "sphere", "--family", "box", "-o", str(tmp_path))
    assert result.exit_code == 130
    document = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert {row["family"] for row in document["rows"]} == {"sphere"}
