"""The benchmark: its arithmetic on made-up times, its rows and its table."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from bench_rows import FIELDS, a_table, made_up

from comparisons.experiments.bench import equal
from comparisons.experiments.bench.row import (
    LIMIT,
    Setting,
    against,
    alternate,
    ratios,
    row_from,
    seconds,
    spread,
    within,
)
from comparisons.experiments.bench.run import machine

SCENES = Path(__file__).parents[3] / "scenes"


# ---- arithmetic ---------------------------------------------------------------------------------


def test_a_spread_is_median_and_quartiles() -> None:
    assert spread([5.0, 1.0, 2.0, 4.0, 3.0]) == (2.0, 3.0, 4.0)
    with pytest.raises(ValueError, match="nothing"):
        spread([])


def test_ratios_are_taken_round_by_round() -> None:
    # The machine is ten times slower in one round, for both: the ratio does not see it.
    ours, peer = [1.0, 10.0, 1.1, 0.9, 1.0], [2.0, 20.0, 2.2, 1.8, 2.0]
    assert ratios(ours, peer) == pytest.approx((0.5, 0.5, 0.5), abs=1e-15)


def test_rounds_of_different_number_are_refused() -> None:
    with pytest.raises(ValueError, match="zip"):
        ratios([1.0], [1.0, 2.0])


def test_measures_alternate_and_every_other_round_is_reversed() -> None:
    calls: list[str] = []

    def measure(name: str) -> float:
        calls.append(name)
        return float(len(calls))

    told: list[tuple[str, float]] = []
    found = alternate(
        {"a": lambda: measure("a"), "b": lambda: measure("b")},
        3,
        lambda what, fraction: told.append((what, fraction)),
    )
    assert calls == ["a", "b", "b", "a", "a", "b"]
    assert found == {"a": [1.0, 4.0, 5.0], "b": [2.0, 3.0, 6.0]}
    assert [fraction for _, fraction in told] == pytest.approx([k / 6 for k in range(6)])


def test_a_linear_drift_favours_nobody() -> None:
    clock = iter(range(100))
    found = alternate({"a": lambda: next(clock) + 0.0, "b": lambda: next(clock) + 0.0}, 8)
    assert sum(found["a"]) == sum(found["b"])


def test_seconds_are_those_of_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([10.0, 12.5])
    monkeypatch.setattr("comparisons.experiments.bench.row.time.perf_counter", lambda: next(clock))
    assert seconds(lambda: None) == 2.5


# ---- rows ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("better", "ratio", "met"),
    [
        ("lower", 0.79, True),
        ("lower", 0.8, True),
        ("lower", 0.81, False),
        ("higher", 0.79, False),
        ("higher", 0.8, True),
        ("higher", 0.81, True),
        ("lower", math.nan, False),
        ("higher", math.nan, False),
    ],
)
def test_a_goal_is_met_on_its_side(better: Any, ratio: float, met: bool) -> None:
    row = against("x", "x", [ratio] * 7, ("y", [1.0] * 7), 0.8, better=better)
    assert row.met is met


def test_a_row_has_all_fields() -> None:
    ours, peer = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], [2.0] * 7
    row = against("x", "what", ours, ("peer", peer), 2.0, unit="Mray/s", better="higher")
    document = row.as_json()
    assert set(document) >= FIELDS
    assert (row.ours, row.peer, row.ratio) == (4.0, 2.0, 2.0)
    assert row.spread == {"ours": [2.5, 5.5], "peer": [2.0, 2.0], "ratio": [1.25, 2.75]}
    assert document["met"] is True


def test_a_row_under_a_limit_is_a_ratio_to_it() -> None:
    row = within("x", "what", [3.0, 4.0, 5.0], 8.0, unit="MB")
    assert (row.ours, row.peer, row.peer_name, row.ratio, row.goal) == (4.0, 8.0, LIMIT, 0.5, 1.0)
    assert row.spread["ratio"] == [3.5 / 8.0, 4.5 / 8.0]
    assert row.met
    assert not within("x", "what", [8.1], 8.0).met


def test_a_row_survives_json() -> None:
    row = against("x", "what", [1.0] * 7, ("y", [3.0] * 7), 0.8, details={"a": {"b": [1, 2]}})
    assert row_from(json.loads(json.dumps(row.as_json(), allow_nan=False))) == row


def test_what_is_no_number_is_null() -> None:
    document = within("x", "what", [math.nan], 8.0, details={"inf": math.inf}).as_json()
    assert document["ours"] is None
    assert document["details"]["inf"] is None
    assert math.isnan(row_from(json.loads(json.dumps(document))).ours)


# ---- error at equal time ------------------------------------------------------------------------


def test_equal_error_takes_the_median_of_the_scenes_ratios() -> None:
    times = {
        "a": {"ours": 1.0, "mitsuba_llvm": 4.0, "mitsuba_llvm_best": 2.0},
        "b": {"ours": 1.0, "mitsuba_llvm": 2.0, "mitsuba_llvm_best": 1.0, "cycles": 5.0},
        "c": {"ours": 3.0, "mitsuba_llvm": 1.5},
        "d": {"mitsuba_llvm": 1.5},
    }
    median, worst, best, cycles = equal.rows(times, {"e": "why"})
    assert (cycles.name, cycles.ratio) == ("error_cycles", 0.2)
    assert (median.ratio, median.met) == (0.5, True)
    assert (worst.ratio, worst.met, worst.details["worst"]) == (2.0, False, "c")
    assert (best.ratio, best.met) == (0.75, True)
    assert median.details["ratios"] == {"a": 0.25, "b": 0.5, "c": 2.0}
    assert median.details["left_out"] == {"e": "why"}


def test_who_never_reaches_the_error_takes_infinitely_long() -> None:
    never = math.inf
    times = {
        "a": {"ours": 1.0, "mitsuba_llvm": never, "mitsuba_llvm_best": never},
        "b": {"ours": never, "mitsuba_llvm": 1.0, "mitsuba_llvm_best": never},
        "c": {"ours": never, "mitsuba_llvm": never, "mitsuba_llvm_best": 1.0},
    }
    median, worst, best = equal.rows(times, {})
    assert median.details["ratios"] == {"a": 0.0, "b": never}
    assert not worst.met
    assert best.details["ratios"] == {"a": 0.0, "c": never}
    for row in (median, worst, best):
        again = row_from(json.loads(json.dumps(row.as_json(), allow_nan=False)))
        assert again.title in a_table([again])


def test_equal_error_of_nothing_meets_no_goal() -> None:
    assert not any(row.met for row in equal.rows({}, {}))


@pytest.mark.slow
def test_only_path_traced_scenes_of_the_standard_suite_count() -> None:
    names = set(equal.path_traced(Setting(scenes=SCENES, quick=True)))
    assert names == set(equal.QUICK)


# ---- table --------------------------------------------------------------------------------------


def test_the_table_says_what_when_and_where() -> None:
    text = a_table([made_up(), made_up("two|three", ratio=0.9)])
    assert f"Measured: {machine()['date'][:10]}" in text
    assert "| the row one | 0.5 s | 1 s (another) | 0.50 | 0.50 to 0.50 | ≤ 0.8 | yes |" in text
    assert "two\\|three" in text
    assert "Not measured: cold (no time)" in text
