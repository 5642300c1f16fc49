"""The page over a pytest session, and what gates said in former ones."""

import json
import re
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from gate_checks import PLUGIN

from comparisons.gate import history, session_page, uses
from comparisons.results.case import Case, Cause, Images, RungResult

pytest_plugins = ["pytester"]

MODULE = """
import os
import numpy as np
import pytest

RIGHT = np.random.default_rng(1).uniform(0.2, 1.0, (8, 12, 3))
GAIN = float(os.environ.get("GAIN", "1"))

def noisy(seed, gain=1.0):
    return gain * RIGHT + np.random.default_rng(seed).normal(0.0, 1e-3, (8, *RIGHT.shape))

def test_same(image_gate):
    image_gate(RIGHT, reference=RIGHT, noise_free=True)

def test_gain(image_gate):
    image_gate(1.02 * RIGHT, reference=RIGHT, noise_free=True)

def test_file(image_gate):
    image_gate("none.npy", reference=RIGHT)

def test_a_few(pair_gate, image_gate):
    pair_gate(noisy(1), noisy(2))
    with pytest.raises(pytest.fail.Exception):
        pair_gate(noisy(1), noisy(2, 1.02))
    image_gate(noisy(3, GAIN), reference=noisy(4))

def test_derivative(derivative_gate):
    derivative_gate(noisy(5), closed=RIGHT)

def test_material(material_gate):
    def sample(wo, u):
        r, phi = np.sqrt(u[:, 0]), 2.0 * np.pi * u[:, 1]
        return np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1.0 - u[:, 0])], axis=-1)

    def pdf(wo, wi):
        return np.maximum(wi[:, 2], 0.0) / np.pi

    material_gate(lambda wo, wi: 0.5 * pdf(wo, wi), sample, pdf)
    material_gate(lambda wo, wi: 1.5 * pdf(wo, wi), sample, pdf)

@pytest.fixture
def early(image_gate):
    image_gate(RIGHT, reference=RIGHT, noise_free=True)

def test_in_a_fixture(early):
    pass

def test_without():
    pass
"""

EXPECTED = [
    ("a_few", "image_gate", 3, "agree"),
    ("a_few", "pair_gate", 1, "agree"),
    ("a_few", "pair_gate", 2, "differ"),
    ("derivative", "derivative_gate", 1, "agree"),
    ("file", "image_gate", 1, "error"),
    ("gain", "image_gate", 1, "differ"),
    ("in_a_fixture", "image_gate", 1, "unchanged"),
    ("material", "material_gate", 1, "agree"),
    ("material", "material_gate", 2, "differ"),
    ("same", "image_gate", 1, "unchanged"),
]


def run(pytester: pytest.Pytester, *options: str) -> tuple[str, dict[str, Any]]:
    words = ("--reference-rt-report", "seen", "--reference-rt-history", "kept", *options)
    text = pytester.runpytest_subprocess(*PLUGIN, "-p", "no:cacheprovider", *words).stdout.str()
    return text, json.loads((pytester.path / "seen" / "results.json").read_text())


def test_a_call_that_cannot_be_judged_is_on_the_page(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_it=MODULE)
    text, results = run(pytester, "-k", "file or without")
    (noted,) = results["uses"]
    assert (noted["verdict"], noted["passed"], noted["outcome"]) == ("error", False, "failed")
    told = "1 use of gates: 1 error\nseen/results.json, seen/report.html\n"
    assert told in text
    page = (pytester.path / "seen" / "report.html").read_text()
    assert re.findall(r'data-verdict="(\w+)"', page) == ["error"]
    assert noted["headline"] == noted["reason"]
    assert noted["headline"] in page.replace("<wbr>", "")


@pytest.mark.slow
@pytest.mark.parametrize("processes", [(), ("-n", "2")])
def test_every_use_is_on_the_page(pytester: pytest.Pytester, processes: tuple[str, ...]) -> None:
    pytester.makepyfile(test_it=MODULE)
    text, results = run(pytester, *processes)
    noted = results["uses"]
    found = [(u["test"], u["fixture"], u["call"], u["verdict"]) for u in noted]
    assert found == [(f"test_it.py::test_{test}", *rest) for test, *rest in EXPECTED]
    assert results["counts"] == {"error": 1, "differ": 3, "agree": 4, "unchanged": 2}
    assert "10 uses of gates: 1 error, 3 differ, 4 agree, 2 unchanged" in text
    assert [u["passed"] for u in noted] == [u["verdict"] in ("agree", "unchanged") for u in noted]
    # A difference that the test expects is shown all the same.
    assert [u["outcome"] for u in noted[:3]] == ["passed"] * 3
    assert noted[5]["cause"]["name"] == "constant gain of 1.02"
    assert abs(noted[1]["z"]) < 5 < abs(noted[2]["z"])
    assert noted[5]["z"] is None

    page = (pytester.path / "seen" / "report.html").read_text()
    # Those that fail come first; each has pictures, and a page of its own that is there.
    names = re.findall(r'<li id="use-\d+" data-verdict="(\w+)"', page)
    assert names == ["error"] + ["differ"] * 3 + ["agree"] * 4 + ["unchanged"] * 2
    links = [unquote(link) for link in re.findall(r'<h2>.*?href="(tests[^"]+)"', page)]
    assert len(links) == len(set(links)) == 8  # not of the file, nor of the material that passed
    assert all((pytester.path / "seen" / link).exists() for link in links)
    assert page.count("data:image/png") == 3 * 7 + 1
    assert "none.npy: there is no such file" in page


def test_a_page_is_written_for_nothing_and_nothing_without_being_asked(
    pytester: pytest.Pytester,
) -> None:
    pytester.makepyfile(test_it="def test_it():\n    pass\n")
    text, results = run(pytester)
    assert results["uses"] == []
    assert "0 uses of gates" in text
    assert not (pytester.path / "image-gate").exists()
    (pytester.path / "file").write_text("")
    refused = pytester.runpytest_subprocess(*PLUGIN, "--reference-rt-report", "file")
    assert refused.ret == pytest.ExitCode.USAGE_ERROR
    assert "file is a file; expected a folder" in refused.stderr.str()


def test_tests_that_are_only_collected_leave_the_page(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_it="def test_it():\n    pass\n")
    run(pytester)
    page = pytester.path / "seen" / "report.html"
    page.write_text("the last session's")
    text, _ = run(pytester, "--collect-only")  # as editors do
    assert page.read_text() == "the last session's"
    assert "uses of gates" not in text
    # A session without a gate says nothing of any, and takes no place among the last ones.
    assert not [*(pytester.path / "kept").glob("run-*.json")]


@pytest.mark.slow
def test_a_verdict_that_changes_is_named(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytester.makepyfile(test_it=MODULE)
    for gain in ("1", "1.02", "1"):
        monkeypatch.setenv("GAIN", gain)
        text, results = run(pytester, "-k", "a_few")
    name = "test_it.py::test_a_few (image_gate 3)"
    assert f"{name}: agree ×1, differ ×1, agree ×1: changed 2 times" in text
    assert "(pair_gate): " not in text
    first = results["uses"][0]
    assert [run["verdict"] for run in first["history"]] == ["agree", "differ", "agree"]
    assert abs(first["history"][1]["z"]) > 5
    page = (pytester.path / "seen" / "report.html").read_text()
    assert page.count("changed 2 times") == 2  # in the list, and for readers of the strip


@pytest.mark.slow
def test_the_configuration_file_has_defaults(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_it=MODULE)
    text = '[tool.pytest.ini_options]\nreference_rt_report = "made"\nimage_gate_limit = "{}"\n'
    for limit, verdict in (("0.005", "agree"), ("0.0011", "inconclusive")):
        pytester.makepyprojecttoml(text.format(limit))
        pytester.runpytest_subprocess(*PLUGIN, "-p", "no:cacheprovider", "-k", "derivative")
        (found,) = json.loads((pytester.path / "made" / "results.json").read_text())["uses"]
        assert found["verdict"] == verdict
    pytester.makepyprojecttoml(text.format("little"))
    refused = pytester.runpytest_subprocess(*PLUGIN, "-k", "derivative")
    assert "image_gate_limit: expected a number" in refused.stdout.str()


def use(verdict: str, test: str = "t", z: float | None = None, call: int = 1) -> uses.Use:
    passed = verdict in ("agree", "unchanged")
    what = {"verdict": verdict, "passed": passed, "z": z, "outcome": "passed", "folder": ""}
    texts = {"headline": "<b>", "reason": "", "cause": None, "pictures": [], "seconds": 0.0}
    return {"test": test, "fixture": "image_gate", "call": call, **what, **texts}


def test_the_history_counts_changes(tmp_path: Path) -> None:
    for verdict in ("agree", "agree", "inconclusive", "agree"):
        past = history.added(tmp_path, [use(verdict, z=1.5), use("agree", "u")], tmp_path)
    one, other = past.values()
    assert (one.changes, other.changes) == (2, 0)
    assert one.words == "agree ×2, inconclusive ×1, agree ×1: changed 2 times"
    assert other.words == "agree ×4"
    assert [run.z for run in one.runs] == [1.5] * 4
    # A use that was not in each session has the sessions that it was in.
    third = history.added(tmp_path, [use("differ", "u", call=2)], tmp_path)
    assert [len(found.runs) for found in third.values()] == [1]


def test_damaged_files_of_the_history_are_ignored_and_old_ones_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history, "KEPT", 5)
    monkeypatch.setattr(history, "LOOKED_AT", 4)
    (tmp_path / "notes.txt").write_text("mine")
    for content in ("", "[]", '{"schema": 1}', '{"schema": 1, "uses": {"t": 3}}'):
        (tmp_path / f"run-2000-{len(content)}.json").write_text(content)
    past = history.added(tmp_path, [use("agree")], tmp_path)
    assert [len(found.runs) for found in past.values()] == [1]
    for _ in range(6):
        past = history.added(tmp_path, [use("agree")], tmp_path)
    assert [len(found.runs) for found in past.values()] == [4]
    assert len(list(tmp_path.glob("run-*.json"))) == 5
    assert (tmp_path / "notes.txt").exists()


def test_a_change_without_one_of_the_source_is_told() -> None:
    def past(*runs: tuple[str, str]) -> history.Past:
        return history.Past(tuple(history.Once("", c, v, v == "agree", None) for c, v in runs))

    told = ", also without a change of the source"
    assert past(("a", "agree"), ("a", "differ")).words.endswith(told)
    assert past(("a", "agree"), ("b", "differ"), ("a", "agree")).words.endswith("changed 2 times")
    # The source of sessions without a commit is unknown.
    assert past(("", "agree"), ("", "differ")).words.endswith("changed once")


def test_the_commit_of_a_repository_with_changes_is_unknown(pytester: pytest.Pytester) -> None:
    path = pytester.path
    assert history._commit(path) == ""
    git = ("git", "-c", "user.name=n", "-c", "user.email=e", "-C", str(path))
    (path / "file").write_text("1")
    for words in (("init", "-q"), ("add", "file"), ("commit", "-qm", "m"), ("tag", "-m", "m", "v")):
        assert pytester.run(*git, *words).ret == 0
    assert re.fullmatch("[0-9a-f]{40}", history._commit(path))
    (path / "file").write_text("2")
    assert history._commit(path) == ""


def case(verdict: Any, numbers: dict[str, Any], **more: Any) -> Case:
    rung = RungResult("statistics", verdict, "why", numbers)
    return Case("scene", verdict, "why", (rung,), None, {}, **more)


def test_z_is_that_of_the_channel_farthest_from_zero() -> None:
    numbers = {
        "relative_bias": {"R": 0.01, "G": -0.02, "B": None},
        "standard_error_of_bias": {"R": 0.01, "G": 0.004, "B": 0.0},
    }
    assert uses.z_of(case("agree", numbers)) == pytest.approx(-5.0)
    assert uses.z_of(case("agree", {})) is None


def test_names_are_escaped_and_big_pages_leave_pictures_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = np.random.default_rng(1).uniform(size=(8, 8, 3))
    noted = uses.of_case(
        case("agree", {}, images=Images(picture, picture), cause=Cause("<i>", "&", 1.0)), True
    )
    noted_two = [use("agree", "<script>") | noted, use("differ", "u") | noted | {"passed": False}]
    session_page.write(tmp_path, noted_two, {}, 1.0)
    page = (tmp_path / "report.html").read_text()
    assert "<script" not in page
    assert "<i>" not in page
    assert page.count("data:image/png") == 6
    monkeypatch.setattr(session_page, "MOST_BYTES", len(page) - 100)
    session_page.write(tmp_path, noted_two, {}, 1.0)
    assert (tmp_path / "report.html").read_text().count("data:image/png") == 3


def test_the_page_fits_a_phone(tmp_path: Path, browser: Any) -> None:
    long = "tests/a_folder/test_module.py::test_" + "long_name_" * 20
    now = datetime(2026, 1, 1)
    verdicts = ["agree", "differ"] * 10
    runs = [
        history.Once(str(now + timedelta(k)), "a" * 40, verdict, verdict == "agree", k / 7)
        for k, verdict in enumerate(verdicts)
    ]
    noted = use("differ", long, z=-1.5) | {"headline": "a" * 300, "reason": "why"}
    session_page.write(tmp_path, [noted], {uses.key_of(noted): history.Past(tuple(runs))}, 1.0)
    for width in (400, 1400):
        page = browser.new_page(viewport={"width": width, "height": 800})
        page.goto((tmp_path / "report.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.get_by_text("changed 19 times, also without").count() == 1
        page.close()
