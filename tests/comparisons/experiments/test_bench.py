"""The benchmark: its arithmetic on made-up times, its rows and its table."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_rows import FIELDS, a_table, made_up

from comparisons.experiments.bench import scenes, solids
from comparisons.experiments.bench.outputs import tables_of
from comparisons.experiments.bench.row import (
    LIMIT,
    Row,
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
from comparisons.experiments.convergence.best_sampler import Taken
from reference_rt.rendering.scene import Scene

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


# ---- scenes -------------------------------------------------------------------------------------


def taken(seconds: float, noise: float, pictures: int = 6) -> Taken:
    """Pictures of a method; the first takes a hundred times as long."""
    times = np.full(pictures, seconds)
    times[0] *= 100.0
    return Taken(times, np.full(pictures, noise), np.ones((2, 3, 3)))


def of_scene(name: str, ours: float, default: float, best: float) -> list[Row]:
    """The rows of a scene that one of these takes so many seconds to render, all as noisily."""
    methods = {"ours": taken(ours, 0.5), "default": taken(default, 0.5), "best": taken(best, 0.5)}
    return scenes.rows(name, (3, 2), "multijitter", methods)


def test_a_scene_has_a_row_of_time_and_two_of_error_times_time() -> None:
    methods = {"ours": taken(2.0, 0.1), "default": taken(1.0, 0.4), "best": taken(4.0, 0.2)}
    rows = scenes.rows("x", (3, 2), "multijitter", methods)
    assert [row.name for row in rows] == ["x.samples", "x.default", "x.best"]
    assert [row.ratio for row in rows] == pytest.approx([2.0, 0.5, 0.25], rel=1e-12)
    assert rows[1].spread["ratio"] == pytest.approx([0.5, 0.5], rel=1e-12)
    assert all(row_from(json.loads(json.dumps(row.as_json()))) == row for row in rows)


def test_no_scene_is_left_out_of_median_and_worst() -> None:
    rows = [r for k in (1.0, 8.0, 2.0, 3.0) for r in of_scene(f"s{k:g}", k, 2.0, 4.0)]
    found = {row.name: row for row in scenes.summary(rows)}
    assert [found[f"{k}_median"].ratio for k in scenes.KINDS] == [1.25, 1.25, 0.625]
    assert [found[f"{k}_worst"].ratio for k in scenes.KINDS] == [4.0, 4.0, 2.0]
    assert all("(s8)" in found[f"{kind}_worst"].title for kind in scenes.KINDS)
    assert [line[0] for line in tables_of(rows)[1].cells] == ["s8", "s3", "s2", "s1"]
    far = of_scene("far", 100.0, 2.0, 4.0)
    for row in far:
        row.details["difference_default"] = 0.6  # more than Mitsuba's noise
    again = {row.name: row for row in scenes.summary([*rows, *far])}
    assert [row.ratio for row in again.values()] == [row.ratio for row in found.values()]
    assert "4 scenes (not far: " in again["best_median"].title
    assert tables_of([*rows, *far])[1].cells[0][-1] == "multijitter, another picture"
    text = a_table([*scenes.summary(rows), *rows])
    assert text.count("| s3 |") == 1
    assert scenes.summary([made_up()]) == []


def test_a_difference_is_that_of_expectations() -> None:
    """Means whose difference is their noise have no other, on average: here over many pixels."""
    rng = np.random.default_rng(1)
    shape, n, sigma = (100, 100, 3), 6, 0.3
    one, two = (
        Taken(np.ones(n), np.full(n, sigma**2), 1.0 + sigma / n**0.5 * rng.standard_normal(shape))
        for _ in range(2)
    )
    # Its standard error is 2 sigma² / n sqrt(2 / 30,000), and weights add a percent to its scale.
    error = 2.0 * sigma**2 / n * (2.0 / 30_000) ** 0.5
    assert abs(scenes.difference(one, two)) < 0.1 * sigma**2 / n + 4.0 * error
    other = two._replace(mean=two.mean * 1.5)
    assert scenes.difference(one, other) > 0.1


def test_pictures_are_as_large_as_the_time_allows() -> None:
    most, fewest = scenes.PIXELS, scenes.FEWEST
    assert scenes.affordable(0.01, 0.01 * most / fewest) == most
    assert scenes.affordable(0.01, 0.009 * most / fewest) == most // 2
    assert scenes.affordable(1e9, 1.0) == fewest
    film = scenes.sized(Setting(scenes=SCENES).load("environment"), 4000).film
    assert (film.width, film.height) == (80, 50)


@pytest.mark.slow
def test_scenes_without_noise_and_those_that_the_suite_skips_have_no_rows() -> None:
    names = scenes.names(Setting(scenes=SCENES))
    assert {"cornell_box", "environment", "materials_200"} < set(names)
    assert not {"whitted_classic", "quadrics", "csg_lens"} & set(names)


@pytest.mark.parametrize("name", ["spheres_10000", "materials_200"])
def test_kinds_of_scenes_that_suites_lack(name: str, tmp_path: Path) -> None:
    scene = scenes.STRANGERS[name](tmp_path)
    assert len(scene.shapes) > int(name.rpartition("_")[2])
    assert len(set(map(repr, scene.materials.values()))) == len(scene.materials)


def test_solids_of_few_and_of_many_operands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of about the same size in the picture; times are made up."""
    rendered: list[Scene] = []
    monkeypatch.setattr(solids, "render", rendered.append)
    monkeypatch.setattr(solids, "alternate", lambda measures, say: {"few": [1.0], "many": [5.0]})
    found = solids.measure(Setting(scenes=SCENES, threads=1))
    assert [row.name for row in found] == ["solids_union", "solids_difference"]
    assert [(row.ratio, row.met) for row in found] == [(5.0, False)] * 2
    seen = [scene.intersect(*scene.camera_rays()).hit.mean() for scene in rendered]
    assert [len(scene.shapes[0].of) for scene in rendered] == [solids.FEW, solids.MANY] * 2
    for few, many in (seen[:2], seen[2:]):
        assert 0.5 < few / many < 2.0


# ---- table --------------------------------------------------------------------------------------


def test_the_table_says_what_when_and_where() -> None:
    text = a_table([made_up(), made_up("two|three", ratio=0.9)])
    assert f"Measured: {machine()['date'][:10]}" in text
    assert "| the row one | 0.5 s | 1 s (another) | 0.50 | 0.50 to 0.50 | ≤ 0.8 | yes |" in text
    assert "two\\|three" in text
    assert "Not measured: cold (no time)" in text
