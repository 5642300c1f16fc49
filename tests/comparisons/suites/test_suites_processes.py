"""Suites whose processes fail, hang or are interrupted."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from suite_runs import processes, run_in, scenes, signal_in_the_next_case

from comparisons.compare.budget import Budget
from comparisons.results.case import exit_code
from comparisons.results.stored_case import read_case, read_stored_case
from comparisons.runs import processes as children
from comparisons.suites import run
from comparisons.suites.run import read_stored_results
from comparisons.suites.worker import Request
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.workers import Threads

pytestmark = pytest.mark.usefixtures("fake_runners")


@pytest.mark.slow
def test_what_fails_is_reported_and_the_others_go_on(tmp_path):
    names = ("a", "crash", "exit", "print", "raise", "scene_error", "z")
    folder, out = scenes(tmp_path / "scenes", *names), tmp_path / "out"
    found = run_in(out, folder)
    assert [case.scene for case in found.cases] == list(names)
    reasons = {case.scene: case.reason for case in found.cases if case.verdict == "invalid"}
    assert set(reasons) == {"crash", "exit", "raise", "scene_error"}
    assert reasons["crash"].startswith("run: the process died by signal 11 (SIGSEGV)")
    assert "Segmentation fault" in (out / "cases" / "crash" / run.LOG).read_text()
    assert reasons["exit"].startswith("run: the process ended with code 7 in the midst of the case")
    assert "it said: the last word" in reasons["exit"]
    assert reasons["raise"].startswith("run: KeyError: 'no such\\nthing'")
    assert "Traceback" in (out / "cases" / "raise" / run.LOG).read_text()
    assert reasons["scene_error"] == "scene: x.yaml:3: is not what it must be"
    assert exit_code(found.cases) == 4  # some could not run
    for case in found.cases:
        rung = "scene" if case.scene == "scene_error" else "run"
        assert case.rungs[0].name == (rung if case.scene in reasons else "geometry")
    # What could not be run is run again; the rest is not.
    again = run_in(out, folder)
    pids = processes_of(found, "agree")
    assert pids == processes_of(again, "agree")
    assert read_stored_case(out / "cases" / "crash").key == ""


def processes_of(found, verdict):
    return [c.rungs[0].numbers["process"] for c in found.cases if c.verdict == verdict]


@pytest.mark.slow
def test_a_process_that_hangs_is_ended(tmp_path):
    folder = scenes(tmp_path / "scenes", "a", "hang", "z")
    found = run_in(tmp_path / "out", folder, "about: x\ncase_seconds: 20\n", workers=Threads(2))
    assert [case.verdict for case in found.cases] == ["agree", "invalid", "agree"]
    assert found.cases[1].reason.startswith("run: took longer than 20 s")


@pytest.mark.slow
def test_processes_are_shared_out(tmp_path, monkeypatch):
    monkeypatch.setattr(children, "MOST_CASES", 2)
    names = [f"slow{k}" for k in range(2)] + [f"z{k}" for k in range(3)]
    folder = scenes(tmp_path / "scenes", *names)
    found = run_in(tmp_path / "out", folder, workers=Threads(2), threads=3)
    pids = list(processes(found).values())
    assert pids[0] != pids[1]
    assert max(pids.count(pid) for pid in pids) == 2
    assert {case.rungs[0].numbers["threads"] for case in found.cases} == {3}


@pytest.mark.slow
def test_where_no_case_can_run_nothing_is_said_of_any(tmp_path):
    folder = scenes(tmp_path / "scenes", "a", "unavailable")
    with pytest.raises(ReferenceUnavailableError, match="no reference here"):
        run_in(tmp_path / "out", folder)
    request = Request(name="a", scene=folder / "a.yaml", budget=Budget(), folder=tmp_path)
    worker = ("comparisons.suites.worker", "--runner", "no_such_module:f")
    with pytest.raises(ReferenceUnavailableError, match="no_such_module"):
        list(children.run([request], Threads(1), 60.0, lambda *_: None, worker))


def test_one_thread_reads_images(tmp_path):
    """With one thread of Dr.Jit Mitsuba would wait for ever for the decoding of an .exr file."""
    scene = Path(__file__).parents[3] / "scenes" / "environment.yaml"
    request = Request(
        name="a", scene=scene, budget=Budget(pixels=16), rungs=("geometry",), folder=tmp_path
    )
    worker = ("comparisons.suites.worker", "--threads", "1")
    (outcome,) = children.run([request], Threads(1), 60.0, lambda *_: None, worker)
    assert outcome.failure is None


INTERRUPTED = """
import signal
import sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs are deaf to it
from pathlib import Path
from comparisons.mitsuba.backend import Backend
from comparisons.suites import run, suite
run.backend = lambda: Backend("llvm_ad_rgb", "0", "", None)
run.provenance = lambda **more: {"mitsuba": "none", **more}
source = suite.Source(suite.Suite(about="x"), "test", "test.yaml", "test.yaml", "")
planned = suite.plan(source, Path(sys.argv[1]))
run.run_suite(source, planned, run.Options(Path(sys.argv[2]), runner="suite_runners:by_name"))
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_keeps_what_is_done(tmp_path, number):
    folder, out = scenes(tmp_path / "scenes", "a", "hang"), tmp_path / "out"
    command = [sys.executable, "-c", INTERRUPTED, str(folder), str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        first = out / "cases" / "a" / "case.json"
        workers = signal_in_the_next_case(process, number, first.exists)
        process.communicate(timeout=600.0)
    finally:
        process.kill()
    assert process.returncode != 0
    assert read_case(out / "cases" / "a").verdict == "agree"
    assert not (out / "cases" / "hang").exists()
    assert [case["scene"] for case in json.loads((out / "results.json").read_text())["cases"]] == [
        "a"
    ]
    for worker in workers:
        with pytest.raises(ProcessLookupError):
            os.kill(int(worker), 0)
    assert [case.scene for case in read_stored_results(out).cases] == ["a"]
