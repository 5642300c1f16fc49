"""results.json: strict JSON, complete, and written as a whole or not at all."""

import json
import math

import numpy as np
import pytest

from comparisons.report.page import SCHEMA, write_results
from comparisons.results.case import Case, Cause, ImageRegion, Metrics, RungResult


def case(**numbers):
    return Case(
        "scene",
        "differ",
        "geometry: differs",
        (RungResult("geometry", "differ", "why", numbers),),
        Metrics(math.nan, 0.25, math.inf, 0.5, 0.125, (0.0, math.inf, -0.01), 0),
        {"candidate": {"load": 0.5}, "reference": {"render": math.nan}},
        None,
        ("note",),
        ("yours", "the baseline's"),
        Cause("gain", "1.02 times", 0.99),
        (ImageRegion(1, 2, 3, 4, "darker"),),
        ("lights: none",),
        "reference-rt gate x.exr",
    )


def written(path, *cases, **more):
    def refuse(name):
        raise AssertionError(f"not JSON: {name}")

    write_results(path, cases, {"date": "2025-11-21"}, **more)
    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


def test_everything_is_reported(tmp_path):
    found = written(
        tmp_path / "results.json",
        case(rays=np.int64(5), worst=np.float32(0.5), by_kind={"t": np.arange(2)}),
        suite="smoke",
        missing=["left"],
        not_run={"other": "no reference for it"},
    )
    assert found == {
        "schema": SCHEMA,
        "suite": "smoke",
        "asked": 2,
        "missing": ["left"],
        "provenance": {"date": "2025-11-21"},
        "not_run": {"other": "no reference for it"},
        "cases": [
            {
                "scene": "scene",
                "verdict": "differ",
                "headline": "likeliest cause: gain; why",
                "reason": "geometry: differs",
                "sides": {"candidate": "yours", "reference": "the baseline's"},
                "tiers": {
                    "geometry": {
                        "status": "differ",
                        "reason": "why",
                        "rays": 5,
                        "worst": 0.5,
                        "by_kind": {"t": [0, 1]},
                    }
                },
                "metrics": {
                    "ssim": None,
                    "flip": 0.25,
                    "psnr": None,
                    "rmse": 0.5,
                    "relmse": 0.125,
                    "mean_bias": [0.0, None, -0.01],
                    "nonfinite": 0,
                },
                "cause": {"name": "gain", "evidence": "1.02 times", "explained": 0.99},
                "worst": [{"x": 1, "y": 2, "width": 3, "height": 4, "what": "darker"}],
                "seconds": {"candidate": {"load": 0.5}, "reference": {"render": None}},
                "notes": ["note"],
                "left_out": ["lights: none"],
                "again": "reference-rt gate x.exr",
            }
        ],
    }


def test_what_is_not_there_is_null(tmp_path):
    bare = Case("scene", "agree", "geometry: agrees", (), None, {})
    found = written(tmp_path / "results.json", bare)
    assert found["suite"] is None
    assert found["not_run"] == {}
    assert found["cases"][0]["metrics"] is found["cases"][0]["cause"] is None
    assert found["cases"][0]["worst"] == []


@pytest.mark.parametrize("name", ["status", "reason"])
def test_a_number_may_not_hide_the_status(tmp_path, name):
    with pytest.raises(ValueError, match=name):
        write_results(tmp_path / "results.json", [case(**{name: 1})], {})
    assert not list(tmp_path.iterdir())


def test_two_rungs_of_one_name_are_a_mistake(tmp_path):
    rung = RungResult("geometry", "agree", "")
    twice = Case("scene", "agree", "", (rung, rung), None, {})
    with pytest.raises(ValueError, match="two rungs"):
        write_results(tmp_path / "results.json", [twice], {})


def test_text_that_is_not_unicode_is_kept(tmp_path):
    bare = Case("scene\udc80", "agree", "é", (), None, {})
    assert written(tmp_path / "results.json", bare)["cases"][0]["scene"] == "scene\udc80"
    assert "é" in (tmp_path / "results.json").read_text(encoding="utf-8")
