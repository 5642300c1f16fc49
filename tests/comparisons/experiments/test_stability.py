"""Runs of families with known outcomes: what is told, kept, and done again."""

import csv
import json
import math
import os
import sys

import numpy as np
import pytest
import stability_fakes
from builders import HELPERS
from command_line import invoke

from comparisons.experiments.stability.harness import outputs, run, series
from comparisons.experiments.stability.harness.outcomes import OURS, Outcome, outcome
from comparisons.experiments.stability.harness.points import Found, summarise
from comparisons.experiments.stability.harness.series import Family, Series, Sweep


@pytest.fixture
def alone(monkeypatch):
    """No families."""
    monkeypatch.setattr(series, "_REGISTERED", {})
    before = dict(series.MODULES)
    modules = set(sys.modules)
    yield
    series.MODULES.clear()
    series.MODULES.update(before)
    for name in set(sys.modules) - modules:
        if name.startswith(f"{series.FAMILIES}.T"):
            del sys.modules[name]


@pytest.fixture
def fakes(alone, monkeypatch):
    monkeypatch.setattr(run, "WORKER", ("stability_fakes",))
    before = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", f"{HELPERS}{os.pathsep}{before}".rstrip(os.pathsep))
    stability_fakes.install()


def stability(out, *options):
    """The command's exit code and what it printed."""
    found = invoke("stability", "-o", out, "--jobs", "1", *options)
    return found.exit_code, found.output


def test_limits_and_ratios(fakes, tmp_path):
    plots = tmp_path / "plots"
    code, told = stability(tmp_path, "--family", "T1", "--full", "--plots", str(plots))
    assert code == 0, told
    assert [file.name for file in plots.iterdir()] == ["T1-far.svg"]  # the other has one point
    results = json.loads((tmp_path / "results.json").read_text())
    (one,) = results["families"]
    assert (one["id"], one["limit_ours"], one["limit_mitsuba"]) == ("T1", 1e9, 1e4)
    assert one["ours"]["failures"] == 4 * 200  # beyond what must hold
    far, alone = one["series"]
    assert far["further"] == pytest.approx(1e5)
    assert far["settings"][3]["outcomes"]["ours"]["worst"] == 1e3
    assert far["settings"][3]["outcomes"]["mitsuba"]["worst"] == 2.0**29 * 1e3
    assert alone["limit_ours"] is None
    assert one["cases"] == 14 * 2000
    rows = list(csv.DictReader((tmp_path / "results.csv").read_text().splitlines()))
    assert len(rows) == 14 * 3
    page = (tmp_path / "stability.html").read_text()
    assert "growing &lt;errors&gt;" in page
    assert "&lt;grey&gt;" in page
    assert page.count("data:image/png") == 2  # Mitsuba's first failure, and ours there


def test_the_page_can_be_read_by_everybody(fakes, tmp_path, check_page):
    stability(tmp_path, "--family", "T1", "--family", "T3")
    check_page(tmp_path / "stability.html")


def test_failures_of_ours_fail_and_are_told(fakes, tmp_path):
    code, told = stability(tmp_path, "--family", "T3")
    assert code == 1
    assert "again: reference-rt stability --family T3 --series near --at 1000000000.0" in told
    assert (0.1).hex() in told
    assert "--at 100000000.0" not in told


@pytest.mark.slow
def test_a_setting_that_kills_its_process(fakes, tmp_path):
    code, told = stability(tmp_path, "--family", "T2")
    assert code == 1
    assert "SIGABRT" in told
    assert "ValueError: of no use" in told
    (one,) = json.loads((tmp_path / "results.json").read_text())["families"]
    assert not one["holds"]
    first, died, raised = one["series"][0]["settings"]
    assert first["outcomes"]["ours"]["worst"] == "inf"
    assert "SIGABRT" in died["broken"]
    assert raised["outcomes"] == {}
    # It is tried again next time; what was found is not.
    _, told = stability(tmp_path, "--family", "T2")
    assert told.count("measured before") == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--family", "T9"), "expected one of T1"),
        (("--series", "far"), "expected one --family"),
        (("--family", "T1", "--series", "near"), "expected one of far, alone"),
        (("--family", "T1", "--at", "3"), "expected a --series"),
    ],
)
def test_usage(fakes, tmp_path, options, said):
    code, told = stability(tmp_path, *options)
    assert code == 2
    assert said in told


def test_the_csv_has_a_row_for_each_contestant_and_infinity_in_words(tmp_path):
    outcomes = {"a_method": Outcome(2, 1, 0.5), OURS: Outcome(3, 0, math.inf, 1)}
    found = [Found("T1", "far", 10.0, outcomes, 1.0), Found("T1", "far", 20.0, {}, 1.0, "broke")]
    outputs.rows_of(found).write_csv(tmp_path / "results.csv")
    assert (tmp_path / "results.csv").read_text().splitlines() == [
        "family,series,x,contestant,cases,failures,worst,open",
        "T1,far,10.0,ours,3,0,inf,1",
        "T1,far,10.0,a_method,2,1,0.5,0",
    ]


def test_outcomes_add_up_and_refuse_nonsense():
    both = Outcome(3, 1, 2.0, 1, ({"a": 1},)) + Outcome(4, 0, None, 2)
    assert both == Outcome(7, 1, 2.0, 3, ({"a": 1},))
    with pytest.raises(ValueError, match="NaN"):
        Outcome(1, 0, math.nan)
    with pytest.raises(ValueError, match="2 failures of 1"):
        Outcome(1, 2)


def test_series_refuse_an_end_without_a_law():
    with pytest.raises(ValueError, match="law"):
        Series("s", Sweep("x", (1.0, 2.0), (1.0,), 1, 1), "", lambda *_: {}, holds_to=1.0)
    with pytest.raises(ValueError, match="increase"):
        Series("s", Sweep("x", (2.0, 1.0), (), 1, 1), "", lambda *_: {})


def test_a_function_becomes_a_series_of_its_family(alone):
    def near_by(draw, x):
        """What is near
        is drawn."""

    near_by.__module__ = f"{series.FAMILIES}.T.near"
    sweep = Sweep("x", (1.0, 2.0), (1.0,), 1, 1)
    assert series.series(sweep, unit="u")(near_by) is near_by
    series.series(sweep, "by name", "About.")(near_by)
    series.MODULES["T"] = "T"
    one, other = Family("T", "", "").series
    assert (one.name, one.about, one.unit) == ("near by", "What is near is drawn.", "u")
    assert (other.name, other.about, other.measure) == ("by name", "About.", near_by)
    near_by.__module__ = f"{series.FAMILIES}.T.far"
    with pytest.raises(ValueError, match="two series of the name 'near by'"):
        series.series(sweep)(near_by)


def test_rows_of_the_first_failures_are_shown():
    wrong, undecided = np.array([False, True, True, True, True, True]), np.arange(6) == 2
    found = outcome(
        wrong,
        {"t": np.arange(6.0), "o": np.ones((6, 3)), "number": lambda k: k, "law": "none"},
        undecided,
        worst=2.0,
    )
    assert (found.cases, found.failures, found.open, found.worst) == (5, 4, 1, 2.0)
    one = (1.0).hex()
    assert found.examples[0] == {"t": one, "o": [one] * 3, "number": 1, "law": "none"}
    assert [example["number"] for example in found.examples] == [1, 3, 4]


def test_a_lead_that_is_too_small_must_be_explained(alone, monkeypatch):
    """Ours twice as far as Mitsuba is less than 29 bits allow."""
    found = [
        Found("T", "far", x, {OURS: Outcome(1, int(x > 4)), "mitsuba": Outcome(1, int(x > 2))}, 0.0)
        for x in (1.0, 2.0, 4.0, 8.0)
    ]
    for explained in ("", "since it is so"):
        sweep = Sweep("x", (1.0, 2.0, 4.0, 8.0), (), 1, 1)
        end = {"holds_to": 4.0, "law": "four", "explained": explained}
        monkeypatch.setattr(series, "_REGISTERED", {})
        family = Family("T", "", "")
        stability_fakes.install({family: (Series("far", sweep, "", lambda *_: {}, **end),)})
        (one,) = summarise(family, found)
        assert one.further == 2.0
        assert one.holds
        assert one.unexplained == (not explained)
        assert outputs.where(one, OURS) == "holds to float64's end, 4"
        assert outputs.where(one, "mitsuba") == "fails from 4 on"
