"""JUnit XML and GitHub's annotations and summaries: read back, at limits, with hostile text."""

import io
import re
import xml.etree.ElementTree as ElementTree

import pytest
from junitparser import Error, Failure, JUnitXml, Skipped

from comparisons.report import ci
from comparisons.report.ci import SEVERITY, ranked
from comparisons.results.case import Case, Cause, RungResult
from comparisons.results.rungs import RUNGS
from reference_rt.util.errors import ImageError

NASTY = "<a href='x'>&amp;]]>\x00\x1b[31m\ud800 | `code` % \r\n::error::x,y:z *b* @me é"


def case(verdict, name=None, reason=None, rung="geometry", **more):
    rungs = (RungResult("input", "agree", "fine"), RungResult(rung, verdict, reason or "why"))
    name = name or f"scene-{verdict}"
    seconds = {"candidate": {"load": 0.5}, "reference": {"render": 1.0}}
    return Case(name, verdict, f"{rung}: {reason or 'why'}", rungs, None, seconds, **more)


EVERY = [case(verdict) for verdict in SEVERITY if verdict != "not-applicable"]


def test_the_worst_come_first():
    cases = [
        case("agree", "a"),
        case("differ", "b", rung="images"),
        case("differ", "d", rung="geometry"),
        case("differ", "c", rung="geometry"),
        case("invalid", "e"),
        case("reference-limited", "f"),
        case("inconclusive", "g"),
    ]
    assert [c.scene for c in ranked(cases)] == list("ecdbgfa")
    assert set(RUNGS) >= {t.name for c in cases for t in c.rungs}


# ---- JUnit --------------------------------------------------------------------------------------


def test_junit_says_what_failed_and_why(tmp_path):
    path = tmp_path / "junit.xml"
    cause = Cause("gain", "1.02 times", 0.99)
    cases = [*EVERY, case("differ", "other", cause=cause, again="do it again")]
    ci.write_junit(path, cases, "smoke", {"other": 12.3456}, {"left": "no need"})
    suite = next(iter(JUnitXml.fromfile(str(path))))
    assert (suite.name, suite.tests, suite.failures) == ("smoke", 9, 4)
    assert (suite.errors, suite.skipped) == (1, 1)
    tests = {test.name: test for test in suite}
    assert next(iter(tests)) == "scene-invalid"
    assert tests["other"].time == pytest.approx(12.346)
    assert tests["scene-agree"].time == pytest.approx(1.5)
    for verdict in ("agree", "unchanged", "reference-limited"):
        assert tests[f"scene-{verdict}"].result == []
    (failure,) = tests["other"].result
    assert isinstance(failure, Failure)
    assert failure.message == "differ: likeliest cause: gain; why"
    assert failure.type == "differ"
    for told in ("input: agree: fine", "gain: 1.02 times", "reproduce: do it again"):
        assert told in failure.text
    assert isinstance(tests["scene-invalid"].result[0], Error)
    assert isinstance(tests["scene-inconclusive"].result[0], Failure)
    assert isinstance(tests["scene-not-comparable"].result[0], Failure)
    (skipped,) = tests["left"].result
    assert isinstance(skipped, Skipped)
    assert skipped.message == "no need"


def test_junit_is_xml_whatever_the_text(tmp_path):
    path = tmp_path / "junit.xml"
    ci.write_junit(path, [case("differ", NASTY, NASTY), case("agree", "b", NASTY)], NASTY, None,
                {NASTY: NASTY})  # fmt: skip
    root = ElementTree.parse(path).getroot()
    message = root.find(".//failure").get("message")
    for kept in ("<a href='x'>&amp;]]>", "[31m", "é", "| `code` %"):
        assert kept in message
    assert not re.search("[\x00\x1b\ud800]", message)


def test_junit_of_nothing_is_whole(tmp_path):
    ci.write_junit(tmp_path / "junit.xml", [], "smoke")
    assert next(iter(JUnitXml.fromfile(str(tmp_path / "junit.xml")))).tests == 0


# ---- GitHub -------------------------------------------------------------------------------------

COMMAND = re.compile(r"::(\w+) ([^:\r\n]*)::([^\r\n]*)\n")


def annotations(cases, **more):
    stream = io.StringIO()
    ci.annotate(cases, stream, **more)
    found = COMMAND.findall(stream.getvalue())
    assert "".join(f"::{k} {p}::{m}\n" for k, p, m in found) == stream.getvalue()
    return [(k, dict(pair.split("=", 1) for pair in p.split(",")), m) for k, p, m in found]


def unescaped(text):
    for sign, code in (("\n", "%0A"), ("\r", "%0D"), (":", "%3A"), (",", "%2C"), ("%", "%25")):
        text = text.replace(code, sign)
    return text


def test_each_failure_is_annotated_by_kind():
    found = annotations(EVERY, files={"scene-differ": "scenes/a,b:c.yaml"})
    assert [(kind, properties["title"]) for kind, properties, _ in found] == [
        ("error", "scene-invalid%3A invalid"),
        ("error", "scene-differ%3A differ"),
        ("warning", "scene-inconclusive%3A inconclusive"),
        ("warning", "scene-not-comparable%3A not-comparable"),
    ]
    assert unescaped(found[1][1]["file"]) == "scenes/a,b:c.yaml"
    assert "file" not in found[0][1]


def test_annotations_keep_to_their_line_whatever_the_text():
    nasty = NASTY.replace("\ud800", "\\ud800").replace("\x00", "\\x00").replace("\x1b", "\\x1b")
    ((kind, properties, message),) = annotations([case("differ", NASTY, NASTY)])
    assert kind == "error"
    assert unescaped(properties["title"]) == f"{nasty}: differ"
    assert unescaped(message) == f"{nasty}; no single cause explains it\ngeometry: {nasty}"


@pytest.mark.parametrize("number", [10, 11, 60])
def test_no_more_annotations_than_github_takes(number):
    cases = [case("differ", f"s{k:03}") for k in range(number)]
    cases += [case("inconclusive", f"i{k:03}") for k in range(number)]
    found = annotations([case("agree"), *reversed(cases)])
    for kind, letter in (("error", "s"), ("warning", "i")):
        of_kind = [(p["title"], m) for k, p, m in found if k == kind]
        assert len(of_kind) == 10
        assert of_kind[0][0].startswith(f"{letter}000")
        if number > 10:
            assert of_kind[9][0] == f"{number - 9} more cases"
            assert f"{letter}009" in of_kind[9][1]
        else:
            assert of_kind[9][0].startswith(f"{letter}009")


def test_the_summary_has_every_case_the_worst_first(tmp_path):
    path = tmp_path / "summary.md"
    path.write_text("before\n")
    cause = Cause("gain", "1.02 times", 0.99)
    ci.summarise([*EVERY, case("differ", "z", cause=cause)], path, "smoke", {"left": "no need"})
    text = path.read_text()
    assert text.startswith("before\n## smoke\n")
    assert "8 cases: **1** invalid, **2** differ, **1** inconclusive" in text
    rows = re.findall(r"^\| ([\w-]+) \|", text, re.MULTILINE)
    assert rows == ["case", "scene-invalid", "scene-differ", "z", "scene-inconclusive",
                    "scene-not-comparable", "scene-reference-limited", "scene-agree",
                    "scene-unchanged", "left"]  # fmt: skip
    assert "likeliest cause: gain" in text


def test_nothing_in_the_summary_is_markup(tmp_path):
    path = tmp_path / "summary.md"
    ci.summarise([case("differ", NASTY, NASTY)], path, NASTY)
    *_, row = path.read_text(encoding="utf-8").rstrip().split("\n")
    assert len(re.findall(r"(?<!\\)\|", row)) == 4
    assert not re.search(r"(?<!\\)[<`*@\[]", row)


def test_a_long_summary_says_what_it_drops(tmp_path):
    path = tmp_path / "summary.md"
    path.write_text("x" * 500_000)
    cases = [case("differ", f"s{k:05}", "é" * 2000) for k in range(3000)]
    ci.summarise(cases, path, "smoke")
    text = path.read_text(encoding="utf-8")
    assert len(text.encode()) <= ci.MOST_BYTES
    kept = len(re.findall(r"^\| s\d+ \|", text, re.MULTILINE))
    assert 100 < kept < 3000
    assert f"{3000 - kept} more cases are not shown" in text
    assert "| s00000 |" in text
    before = path.read_text(encoding="utf-8")
    path.write_text("x" * ci.MOST_BYTES)
    ci.summarise(cases, path, "smoke")
    assert path.read_text() == "x" * ci.MOST_BYTES
    assert before


def test_a_summary_that_cannot_be_written_is_reported(tmp_path):
    with pytest.raises(ImageError, match="cannot be written"):
        ci.summarise(EVERY, tmp_path, "smoke")


@pytest.mark.parametrize("github", [True, False])
@pytest.mark.parametrize("environment", [None, "true"])
def test_github_is_known_by_its_environment_or_asked_for(
    github, environment, tmp_path, monkeypatch, capsys
):
    summary = tmp_path / "summary.md"
    for name, value in (("GITHUB_ACTIONS", environment), ("GITHUB_STEP_SUMMARY", str(summary))):
        monkeypatch.setenv(name, value) if value else monkeypatch.delenv(name, raising=False)
    formats = ci.Formats(tmp_path / "junit.xml", github)
    formats.write("smoke", EVERY, {}, title="a title")
    is_there = github or environment is not None
    assert formats.files == [tmp_path / "junit.xml", *([summary] if is_there else [])]
    assert all(path.exists() for path in formats.files)
    assert ("::error" in capsys.readouterr().out) == summary.exists() == is_there
    assert not is_there or "## a title" in summary.read_text()
