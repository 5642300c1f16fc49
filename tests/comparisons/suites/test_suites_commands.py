"""The commands `suite` and `report`."""

import json

import pytest
from junitparser import JUnitXml
from suite_runs import SCENES, run_in, scenes

pytestmark = pytest.mark.usefixtures("fake_runners")


@pytest.mark.slow
def test_the_command_as_a_whole(tmp_path, program):
    folder, out = scenes(tmp_path / "scenes", "a", "b", "differ"), tmp_path / "out"
    mine = tmp_path / "mine.yaml"
    mine.write_text("about: mine\nscenes: {b: {skip: it is not needed}}\n")
    common = (mine, "--scenes", folder, "--out", out)
    result = program("suite", *common, "--junit", tmp_path / "junit.xml", "--jobs", 1)
    assert result.exit_code == 1, result.output
    assert "a: agree" in result.stderr
    assert "differ: differ" in result.stderr
    assert "2 cases: 1 agree, 1 differ" in result.stderr
    assert "not run: b: it is not needed" in result.stderr
    assert "::error" not in result.output
    (tests,) = JUnitXml.fromfile(str(tmp_path / "junit.xml"))
    assert (tests.tests, tests.failures, tests.skipped) == (3, 1, 1)
    assert program("suite", *common, "--only", "a").exit_code == 0
    told = json.loads((out / "results.json").read_text())
    assert [case["scene"] for case in told["cases"]] == ["a"]
    again = told["cases"][0]["again"].split()
    assert again[:6] == ["reference-rt", "suite", str(mine), "--only", "a", "--fresh"]


@pytest.mark.slow
def test_annotations_for_github_need_no_option(tmp_path, program, monkeypatch):
    folder = scenes(tmp_path / "scenes", "a", "differ")
    mine = tmp_path / "mine.yaml"
    mine.write_text("about: mine\n")
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    result = program("suite", mine, "--scenes", folder, "--out", tmp_path / "out")
    assert f"::error file={folder.as_posix()}/differ.yaml,title=differ%3A differ::" in result.stdout
    assert "**1** differ, **1** agree" in (tmp_path / "summary.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (("nothing",), 2, "there is no suite 'nothing'"),
        (("smoke", "--scenes", "nowhere"), 2, "there is no folder 'nowhere'"),
        (("smoke", "--only", "z*"), 2, "nothing to run"),
        (("smoke", "--tier", "run"), 2, "--rung: expected one of files, film, solids, geometry"),
        (("smoke", "--jobs", "0"), 2, "jobs"),
    ],
)
def test_wrong_use_is_reported(program, arguments, code, told):
    options = () if "--scenes" in arguments else ("--scenes", SCENES)
    result = program("suite", *arguments, *options)
    assert result.exit_code == code
    assert told in result.output


def test_a_report_is_rendered_again(tmp_path, program):
    folder, out = scenes(tmp_path / "scenes", "a", "differ"), tmp_path / "out"
    run_in(out, folder)
    before = (out / "results.json").read_text()
    (out / "report.html").unlink()
    page = tmp_path / "page.html"
    result = program("report", out, "--out", page)
    assert result.exit_code == 0, result.output
    assert (out / "results.json").read_text() == before
    assert "differ" in page.read_text(encoding="utf-8")
    (out / "results.json").unlink()
    assert program("report", out).exit_code == 0  # all records, then
    assert (out / "report.html").exists()
    told = json.loads((out / "results.json").read_text())
    assert [case["scene"] for case in told["cases"]] == ["a", "differ"]


def test_a_report_of_what_is_no_suite_is_refused(tmp_path, program):
    result = program("report", tmp_path)
    assert result.exit_code == 3
    assert "has no cases" in result.output
    (tmp_path / "results.json").write_text("[]")
    result = program("report", tmp_path)
    assert result.exit_code == 3
    assert "was not written by `suite` or `compare`" in result.output
    (tmp_path / "results.json").write_text(
        '{"cases": [{"scene": "a"}], "provenance": {}, "suite": null, "not_run": {}}'
    )
    result = program("report", tmp_path)
    assert result.exit_code == 3
    assert "cannot be read" in result.output
