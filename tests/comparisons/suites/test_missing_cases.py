"""An interrupted run states everywhere how many of its cases it ran."""

import io
import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace

import pytest
from junitparser import JUnitXml
from report_page import case
from suite_runs import processes, run_in, scenes, signal_in_the_next_case

from comparisons.report import ci, write_report
from comparisons.results.case import RungResult, exit_code, how_many
from comparisons.suites.run import summarise

pytestmark = pytest.mark.usefixtures("fake_runners")

RAN = [case("agree", "a"), case("agree", "b")]
MISSING = ("<c>", "d")


def test_how_many_are_there():
    assert how_many(1, 0) == "1 case"
    assert how_many(17, 0) == "17 cases"
    assert how_many(17, 47) == "17 of 64 cases run"
    assert how_many(0, 1) == "0 of 1 cases run"


def test_exit_code():
    assert exit_code(RAN, MISSING) == 1
    unread = replace(case("invalid"), rungs=(RungResult("scene", "invalid", "why"),))
    assert exit_code([unread], MISSING) == 3
    assert exit_code([], MISSING) == 4


def test_the_page(tmp_path):
    write_report(tmp_path / "page.html", RAN, {}, missing=MISSING)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<title>a, b: 2 of 4 cases run: all pass" in page
    assert '<b class="missing">2 of 4 cases run: all pass</b>' in page
    for name in ("&lt;c&gt;", "d"):
        assert f'– missing</span></td><th scope="row">{name}</th>' in page
    assert page.count("the run was interrupted before this case") == 2
    write_report(tmp_path / "page.html", RAN, {}, title="some", not_run={"<e>": "it is <odd>"})
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<title>some: 2 cases: all pass; 1 not run" in page
    assert '– not run</span></td><th scope="row">&lt;e&gt;</th>' in page
    assert "it is &lt;odd&gt;" in page
    assert "interrupted" not in page


def test_junit(tmp_path):
    ci.write_junit(tmp_path / "junit.xml", RAN, "smoke", missing=MISSING)
    (suite,) = JUnitXml.fromfile(str(tmp_path / "junit.xml"))
    assert (suite.tests, suite.errors, suite.failures, suite.skipped) == (4, 2, 0, 0)
    (error,) = {test.name: test for test in suite}["<c>"].result
    assert error.message == "the run was interrupted before this case"


def test_github(tmp_path):
    ci.summarise(RAN, tmp_path / "summary.md", "smoke", missing=MISSING)
    summary = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert "2 of 4 cases run: **2** agree" in summary
    assert "| \\<c\\> | ❌ missing | the run was interrupted before this case |" in summary
    stream = io.StringIO()
    ci.annotate(RAN, stream, missing=MISSING)
    assert stream.getvalue() == "::error title=2 of 4 cases run::Missing: <c>, d\n"
    stream = io.StringIO()
    many = [case("differ", f"s{k:02d}") for k in range(20)]
    ci.annotate(many, stream, missing=MISSING)
    assert stream.getvalue().count("::error") == ci.MOST_ANNOTATIONS


def test_the_terminal(capsys):
    summarise(RAN, {}, {}, MISSING)
    told = capsys.readouterr().err
    assert "2 of 4 cases run: 2 agree" in told
    assert "missing: <c>, d" in told


PROGRAM = """
import signal
import sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs are deaf to it
from dataclasses import replace
import typer
from comparisons.commands.compare import compare
from comparisons.commands.compare import suite
from comparisons.mitsuba.backend import Backend
from comparisons.suites import run
run.backend = lambda: Backend("llvm_ad_rgb", "0", "", None)
run.provenance = lambda **more: {"mitsuba": "none", **more}
whole = run.run_cases
run.run_cases = lambda plan, options, *more: whole(
    plan, replace(options, runner="suite_runners:by_name"), *more
)
app = typer.Typer()
app.command()(compare)
app.command()(suite)
app()
"""


def interrupted(number, out, *arguments):
    """The program, which gets this signal in its second case: its exit code and what it said."""
    command = [sys.executable, "-c", PROGRAM, *map(str, arguments), "--out", str(out)]
    log = out.with_suffix(".txt")
    with log.open("w") as stream:
        process = subprocess.Popen(command, stderr=stream)
    workers = []
    try:
        results = out / "results.json"
        workers = signal_in_the_next_case(
            process, number, lambda: results.exists() and json.loads(results.read_text())["cases"]
        )
        process.wait(timeout=600.0)
    finally:
        process.kill()
        # The workers of a killed program live on until their case is done.
        for worker in workers if number == signal.SIGKILL else ():
            with suppress(ProcessLookupError):
                os.kill(int(worker), signal.SIGKILL)
    return process.returncode, log.read_text()


NUMBERS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "command"),
    [(signal.SIGINT, "compare"), (signal.SIGTERM, "suite"), (signal.SIGKILL, "compare")],
)
def test_an_interrupted_run_says_so_and_is_continued(tmp_path, number, command, program):
    folder, out = scenes(tmp_path / "scenes", "a", "wait", "z"), tmp_path / "out"
    (folder / "wait").touch()
    mine, xml = tmp_path / "mine.yaml", tmp_path / "junit.xml"
    mine.write_text("about: mine\n")
    files = [folder / f"{name}.yaml" for name in ("a", "wait", "z")]
    more = ("--scenes", folder, "--jobs", 1, "--junit", xml)
    arguments = ("compare", *files) if command == "compare" else ("suite", mine, *more)
    code, said = interrupted(number, out, *arguments)
    assert code == NUMBERS[number]
    told = json.loads((out / "results.json").read_text())
    assert (told["asked"], told["missing"]) == (3, ["wait", "z"])
    page = out / "report.html"
    assert page.exists() == (number != signal.SIGKILL)
    assert ("1 of 3 cases run: 1 agree" in said) == (number != signal.SIGKILL)
    if command == "suite" and number != signal.SIGKILL:
        (suite,) = JUnitXml.fromfile(str(xml))
        assert (suite.tests, suite.errors) == (3, 2)
    # The page can be made of what is there, and says what is not.
    page.unlink(missing_ok=True)
    result = program("report", out)
    assert result.exit_code == 1, result.output
    assert "1 of 3 cases run" in result.stderr
    assert "1 of 3 cases run" in page.read_text(encoding="utf-8")
    assert json.loads((out / "results.json").read_text()) == told
    # The next run does only what is missing.
    (folder / "wait").unlink()
    result = program(*arguments, "--out", out)
    assert result.exit_code == 0, result.output
    assert "a: agree (done before)" in result.stderr
    assert "wait: agree (" in result.stderr
    assert "wait: agree (done" not in result.stderr
    told = json.loads((out / "results.json").read_text())
    assert (told["asked"], told["missing"]) == (3, [])
    assert program("report", out).exit_code == 0


def test_an_old_results_file_is_read(tmp_path, program):
    """Before `missing` was written nothing was known to be missing."""
    folder, out = scenes(tmp_path / "scenes", "a"), tmp_path / "out"
    first = run_in(out, folder)
    told = json.loads((out / "results.json").read_text())
    del told["asked"], told["missing"]
    (out / "results.json").write_text(json.dumps(told))
    assert program("report", out).exit_code == 0
    assert processes(run_in(out, folder)) == processes(first)


@pytest.mark.slow
def test_a_page_of_no_case_at_all(tmp_path, program):
    """Of a run that was killed before its first case."""
    folder, out = scenes(tmp_path / "scenes", "unavailable"), tmp_path / "out"
    with pytest.raises(Exception, match="no reference here"):
        run_in(out, folder)
    result = program("report", out)
    assert result.exit_code == 1
    assert "0 of 1 cases run" in result.stderr
