"""Suites that are killed at any moment go on where they were, and suites on clusters: the same
results, file by file."""

import json
import os
import random
import signal
import subprocess
import sys
import time

import pytest
from machines import Machines
from suite_runs import RUNNER, scenes, suite

from comparisons.results.stored_case import CASE
from comparisons.suites import suite as suites
from comparisons.suites.run import LOG, Options, run_suite
from reference_rt.util.cluster import Cluster
from reference_rt.util.errors import WorkersError
from reference_rt.util.workers import Threads

STEADY = "suite_runners:steady"

PROGRAM = """
import sys
from pathlib import Path
from comparisons.mitsuba.backend import Backend
from comparisons.suites import run, suite
from reference_rt.util.workers import Threads
run.backend = lambda: Backend("llvm_ad_rgb", "0", "", None)
run.provenance = lambda **more: {"mitsuba": "none", **more}
source = suite.Source(suite.Suite(about="x"), "test", "test.yaml", "test.yaml", "")
options = run.Options(Path(sys.argv[2]), workers=Threads(2), runner="suite_runners:steady")
run.run_suite(source, suite.plan(source, Path(sys.argv[1])), options)
"""


def whole(out, folder, workers=None, runner=STEADY):
    options = Options(out, workers=workers or Threads(2), runner=runner)
    return run_suite(suite(), suites.plan(suite(), folder), options)


def results(out):
    """All that a suite has written but for times and the commands to repeat it."""
    found = {}
    for path in sorted((out / "cases").glob("*/[!.]*")):
        content = path.read_bytes()
        if path.name == CASE:
            record = json.loads(content)
            content = {k: v for k, v in record.items() if k not in ("wall", "seal")}
            content["case"].pop("again")
            content.pop("key")  # not stored for cases that cannot be run
        found[path.relative_to(out).as_posix()] = content
    summary = json.loads((out / "results.json").read_text())
    return found, [case["scene"] for case in summary["cases"]], summary["missing"]


def ran_in(folder):
    log = folder / "log"
    return log.read_text().split() if log.exists() else []


@pytest.mark.slow
@pytest.mark.usefixtures("fake_runners")
@pytest.mark.parametrize(("times", "cases"), [(3, 60), (50, 700)])
def test_killed_at_any_moment(times, cases, tmp_path):
    """Kill a suite some time after it has run a first case, or at its start."""
    folder = scenes(tmp_path / "scenes", *(f"case{k:03}" for k in range(cases)))
    out, choose = tmp_path / "out", random.Random(24)
    command = [sys.executable, "-c", PROGRAM, str(folder), str(out)]
    for k in range(times):
        before = len(ran_in(folder))
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
            while k % 5 and len(ran_in(folder)) == before and process.poll() is None:
                time.sleep(0.02)
            time.sleep(choose.uniform(0.0, 1.5))
            process.send_signal(signal.SIGKILL)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # A kill repeats at most the cases that were running.
    assert times // 2 < len(ran_in(folder)) <= cases + 2 * times
    whole(tmp_path / "expected", folder)
    assert results(out) == results(tmp_path / "expected")
    # Files that a kill left half written are deleted by a later run, when nobody can be writing.
    (out / "cases" / "case000" / ".0123abcd-case.json").touch()
    for left in out.glob("**/.*"):
        os.utime(left, (time.time() - 7200.0,) * 2)
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    assert not list(out.glob("**/.*"))
    assert len(results(out)[1]) == cases


# ---- clusters -----------------------------------------------------------------------------------


@pytest.fixture
def machines(tmp_path):
    pytest.importorskip("distributed")
    folder = tmp_path / "machines"
    folder.mkdir()
    found = Machines(folder)
    yield found
    found.end()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # those of distributed are not ours
@pytest.mark.usefixtures("fake_runners")
def test_a_cluster_writes_the_same_files(machines, tmp_path):
    """Though one of its workers is killed."""
    for _ in range(2):
        machines.start_worker()
    folder = scenes(tmp_path / "scenes", *(f"case{k:03}" for k in range(40)))
    cluster = Cluster(machines.address)
    told = []

    def tell(run):
        told.append(len(run.cases))

    options = Options(
        tmp_path / "out", workers=_Killing(cluster, machines), runner=STEADY, tell=tell
    )
    run_suite(suite(), suites.plan(suite(), folder), options)
    cluster.close()
    whole(tmp_path / "expected", folder)
    assert results(tmp_path / "out") == results(tmp_path / "expected")
    assert told == [40]
    assert machines.workers[0].poll() is not None


class _Killing:
    """The workers of a cluster, one of which is killed and replaced while they compute."""

    def __init__(self, cluster, machines):
        self._cluster, self._machines, self._count = cluster, machines, 0

    def __getattr__(self, name):
        return getattr(self._cluster, name)

    def submit(self, function, *arguments):
        self._count += 1
        if self._count == 12:
            self._machines.workers[0].kill()
            self._machines.start_worker()
        return self._cluster.submit(function, *arguments)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("fake_runners")
def test_cases_that_fail_on_a_cluster(machines, tmp_path, monkeypatch):
    """As on this machine, with what their processes said."""
    machines.start_worker()
    folder = scenes(tmp_path / "scenes", "a", "crash", "exit", "raise", "scene_error", "z")
    cluster = Cluster(machines.address)
    found = whole(tmp_path / "out", folder, cluster, RUNNER)
    reasons = {case.scene: case.reason for case in found.cases if case.verdict == "invalid"}
    assert set(reasons) == {"crash", "exit", "raise", "scene_error"}
    assert reasons["crash"].startswith("run: the process died by signal 11 (SIGSEGV)")
    assert "Segmentation fault" in (tmp_path / "out" / "cases" / "crash" / LOG).read_text()
    assert "it said: the last word" in reasons["exit"]
    assert reasons["scene_error"] == "scene: x.yaml:3: is not what it must be"
    # What is stored is not run again.
    again = whole(tmp_path / "out", folder, cluster, RUNNER)
    assert [c.rungs[0].numbers for c in again.cases if c.verdict == "agree"] == [
        c.rungs[0].numbers for c in found.cases if c.verdict == "agree"
    ]
    monkeypatch.setattr("comparisons.runs.processes.everything_fingerprint", lambda: "other")
    with pytest.raises(WorkersError, match="has other sources"):
        whole(tmp_path / "more", folder, cluster, RUNNER)
    cluster.close()
