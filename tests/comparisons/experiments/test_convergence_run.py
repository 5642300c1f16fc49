"""`reference-rt converge` as a whole, and what a second run reuses."""

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from convergence_fakes import EXACT, TRUE, Fake

from comparisons.experiments import convergence
from comparisons.experiments.convergence.findings import Curves, findings_of
from comparisons.experiments.convergence.methods import (
    METHODS,
    Climb,
    Stable,
    chosen,
    climb,
    with_sampler,
)
from comparisons.experiments.convergence.outputs import RUNGS, write_results, write_table
from comparisons.experiments.convergence.page import write_page
from comparisons.experiments.convergence.run import converge, prepared
from comparisons.experiments.convergence.store import (
    COUNT,
    Settings,
    Store,
    reference_of,
    run_key,
    size_within,
    weights,
)
from comparisons.translator import to_mitsuba
from reference_rt.cameras.film import BoxFilter, Film
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError

SCENES = Path(__file__).parents[3] / "scenes"


# ---- the reference ------------------------------------------------------------------------------


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(convergence.store, "cache_folder", lambda: tmp_path / "references")


def test_reference_is_kept_and_added_to(own_cache):
    scene = prepared(Scene.load(SCENES / "cornell_box.yaml"), Settings(size=(12, 12)))
    few = reference_of(scene, 16)
    kept = reference_of(scene, 8)
    more = reference_of(scene, 64)
    assert few.seconds > 0.0 == kept.seconds
    np.testing.assert_array_equal(few.mean, kept.mean)
    assert (few.spp, kept.spp, more.spp, more.count) == (16, 16, 64, COUNT)
    # Over 80 seeds, which follow the sources, four times the samples have 0.27 of the variance, as
    # 16 pictures tell it, with a standard deviation of 0.044: four of these.
    assert more.relmse < 0.45 * few.relmse
    assert not np.array_equal(few.mean, more.mean)
    off = (few.mean - more.mean) / np.sqrt(few.variance + 1e-12)
    assert 0.5 < np.sqrt((off**2).mean()) < 2.0  # of one picture, by its own standard error


# ---- whole runs ---------------------------------------------------------------------------------


def program(*arguments: object):
    return invoke("converge", *arguments)


FAST = ("--size", "16x12", "--time-limit", "3600", "--max-spp", "16")


@pytest.mark.slow
def test_scenes_with_chance_and_without(tmp_path, own_cache):
    """A ladder for one, a grid for the other; JSON, CSV and page agree; a second run is quick."""
    scenes = [SCENES / f"{name}.yaml" for name in ("cornell_box", "whitted_classic")]
    only = [x for name in ("ours", "mitsuba_llvm") for x in ("--only", name)]
    result = program(*scenes, "-o", tmp_path, *FAST, *only)
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "results.json").read_text())
    assert (found["schema"], found["kind"]) == (1, "convergence")
    ladder_, grid = found["scenes"]
    assert ladder_["size"] == [16, 12]
    assert "converge" in ladder_["again"]
    assert "16x12" in ladder_["again"]
    ours = ladder_["contestants"]["ours"]
    assert [rung["asked_spp"] for rung in ours["rungs"]][:2] == [4, 8]
    assert all(rung["replicates"] == 8 for rung in ours["rungs"])
    assert ladder_["reference"]["pictures"] == COUNT
    assert not ours["relative_bias"]["seen"]
    assert {crops["kind"] for crops in ladder_["crops"]} <= {"time", "error"}
    assert grid["contestants"] == {}
    errors = [step["relmse"] for step in grid["grids"]["steps"]]
    assert errors[0] > errors[-1]
    assert grid["grids"]["mitsuba"][0]["relmse"] < 1e-4  # float32, here and there an edge

    rows = list(csv.DictReader((tmp_path / "results.csv").read_text().splitlines()))
    assert list(rows[0]) == [column.key for column in RUNGS if column.key]
    told = {
        (scene["scene"], name, rung["asked_spp"]): rung
        for scene in found["scenes"]
        for name, one in scene["contestants"].items()
        for rung in one["rungs"]
    }
    of_rungs = [row for row in rows if row["sampler"] != "grid"]
    assert len(of_rungs) == len(told)
    assert len(rows) - len(of_rungs) == len(grid["grids"]["steps"])
    for row in of_rungs:
        rung = told[row["scene"], row["contestant"], int(row["asked_spp"])]
        assert float(row["relmse"]) == rung["relmse"]["value"]
        assert float(row["mse_high"]) == rung["mse"]["high"]
        assert float(row["seconds"]) == rung["seconds"]["median"]

    page = (tmp_path / "report.html").read_text()
    assert page.count("<svg") == 8
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)
    assert "<script" not in page

    text = tmp_path / "page.md"
    text.write_text("<!-- convergence -->\n<!-- end -->\n")
    more = "--markdown", text, "--plots", tmp_path / "plots"
    again = program(*scenes, "-o", tmp_path, *FAST, *only, *more)
    assert again.exit_code == 0
    assert "| ours, Sobol' (default and best) | " in text.read_text()
    expected = [f"{path.stem}-{over}.svg" for path in scenes for over in ("samples", "time")]
    assert sorted(file.name for file in (tmp_path / "plots").iterdir()) == expected
    same = json.loads((tmp_path / "results.json").read_text())
    assert [r["seconds"] for r in same["scenes"][0]["contestants"]["ours"]["rungs"]] == [
        r["seconds"] for r in ours["rungs"]
    ]
    assert same["scenes"][1]["grids"] == grid["grids"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--only", "mine"), "--only"),
        (("--targets", "0.1,x"), "--targets"),
        (("--targets", "-1"), "--targets"),
        (("--size", "12"), "--size"),
        (("--size", "0x4"), "--size"),
    ],
)
def test_wrong_usage(arguments, said, tmp_path):
    result = program(SCENES / "cornell_box.yaml", "-o", tmp_path / "out", *arguments)
    assert result.exit_code == 2
    assert said in result.output
    assert not (tmp_path / "out").exists()


def test_a_scene_that_is_none(tmp_path):
    assert program(tmp_path / "none.yaml", "-o", tmp_path / "out").exit_code == 3
    twice = (SCENES / "cornell_box.yaml", SCENES / "cornell_box.yaml")
    assert program(*twice, "-o", tmp_path / "out").exit_code == 2


START, PER_SAMPLE = 0.001, 0.0001
"""Seconds of a picture, and of a sample per pixel, in `counted_time`."""


@pytest.fixture
def counted_time(monkeypatch):
    """Pictures whose seconds are a start and a share for each sample, whatever else the machine
    does: of measured times of small pictures, some do not rise with their samples."""
    ready = Stable.ready

    def counted(*arguments):
        renderer = ready(*arguments)

        def shot(spp, replicate):
            made = renderer(spp, replicate)
            return made._replace(seconds=START + PER_SAMPLE * made.spp)

        return shot

    monkeypatch.setattr(Stable, "ready", counted)


@pytest.mark.slow
def test_times_to_an_error(own_cache, counted_time):
    scene = Scene.load(SCENES / "cornell_box.yaml")
    asked = {"only": ("ours", "mitsuba_llvm"), "crops": False}
    settings = Settings(time_limit=1.0, size=(16, 12), targets=(0.3,), **asked)
    found = converge(scene, settings).findings
    assert "ours" in found
    for one in (finding.targets[0] for finding in found.values()):
        # Between two rungs, the line through logarithms lies above the seconds of the samples.
        assert one.seconds.value == pytest.approx(START + PER_SAMPLE * one.spp, rel=0.1)


# ---- parts --------------------------------------------------------------------------------------


def test_scenes_are_rendered_small_and_through_a_box():
    scene = Scene.load(SCENES / "filter_gaussian.yaml")
    assert isinstance(prepared(scene, Settings()).film.filter, BoxFilter)
    assert size_within(Film(width=320, height=240), 128) == (128, 96)
    assert size_within(Film(width=96, height=72), 128) == (96, 72)


def test_key_changes_with_what_matters():
    scene = Scene.load(SCENES / "cornell_box.yaml")
    small = prepared(scene, Settings(size=(12, 12)))
    keys = [run_key(small, 8), run_key(small, 9), run_key(prepared(scene, Settings()), 8)]
    assert len(set(keys)) == 3
    assert run_key(small, 8) == keys[0]


def test_methods_by_name():
    assert [c.name for c in chosen(("mitsuba_llvm", "ours"))] == ["ours", "mitsuba_llvm"]
    assert chosen(()) == METHODS
    with pytest.raises(UsageError, match="mine"):
        chosen(("mine",))
    best = with_sampler(METHODS[3], "ldsampler")
    assert (best.title, best.factor, best.is_independent) == (
        "Mitsuba llvm, ldsampler (best)",
        4,
        False,
    )
    assert METHODS[2].is_independent


def test_page_escapes_what_comes_from_outside(tmp_path):
    one = Climb(lambda: Fake(), (4, 8), 100.0)
    climb({"ours": one}, EXACT, 8, Store(None, ""))
    found = {"ours": findings_of(one.rungs, EXACT, (0.1, 1e-6), False)}
    curves = Curves(
        "<script>alert(1)</script>",
        (16, 12),
        {"ours": METHODS[0]},
        found,
        EXACT,
        left_out=("a & b",),
    )
    settings = Settings(targets=(0.1, 1e-6))
    write_page(tmp_path / "page.html", [curves], settings, {"machine": "<b>"})
    text = (tmp_path / "page.html").read_text()
    assert "<script" not in text
    assert "a &amp; b" in text
    assert "&lt;b&gt;" in text
    write_results(tmp_path / "results.json", [curves], settings, {})
    write_table(tmp_path / "results.csv", [curves])
    assert json.loads((tmp_path / "results.json").read_text())["scenes"][0]["left_out"] == ["a & b"]
    assert EXACT.relmse == pytest.approx((weights(TRUE) * 1e-8).mean())


def test_other_commands_do_not_wait_for_it():
    names = ("mitsuba", "matplotlib", "comparisons.experiments.convergence")
    code = (
        f"import sys, comparisons.commands.register;print([m for m in {names} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "name", ["mask", "blend", "plastic", "rough_plastic", "rough_conductor_beckmann"]
)
def test_mitsuba_is_timed_with_its_own_materials(name):
    """What is written in Python for exactness would be timed as Mitsuba's."""
    scene = Scene.load(SCENES / f"material_{name}.yaml")
    written = {"exact_beckmann", "exact_coat", "mixture_mask", "mixture_blend"}
    assert not written & set(types_in(to_mitsuba(scene, native=True)))


def types_in(part: object) -> list[str]:
    """The values of all keys `type`, however deep."""
    if not isinstance(part, dict):
        return []
    own = [part["type"]] if "type" in part else []
    return own + [found for value in part.values() for found in types_in(value)]
