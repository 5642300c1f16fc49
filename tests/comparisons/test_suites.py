"""Suites: their files, what of them is run and what is not run again, and processes that fail."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
import typer
from junitparser import JUnitXml
from typer.testing import CliRunner

from comparisons.budget import Budget
from comparisons.commands.report import report
from comparisons.commands.suite import suite as suite_command
from comparisons.mitsuba_backend import Backend
from comparisons.processes import pool
from comparisons.record import read_case, read_record
from comparisons.suites import run
from comparisons.suites.archive import read_archive
from comparisons.suites.keys import case_key, files_digest
from comparisons.suites.run import Options, run_suite
from comparisons.suites.suite import BUILT_IN, Source, load_suite, parse_suite, plan
from comparisons.suites.worker import Request
from comparisons.verdict import exit_code
from reference_rt.errors import ReferenceUnavailableError, SceneError, UsageError
from reference_rt.scene import Scene

SCENES = Path(__file__).parents[2] / "scenes"
RUNNER = "suite_runners:by_name"
RAY_CAST = "integrator: {type: ray_cast}\n"


@pytest.fixture(autouse=True)
def runners_are_found(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))


@pytest.fixture(autouse=True)
def a_backend_without_looking(monkeypatch):
    monkeypatch.setattr(run, "backend", lambda: Backend("llvm_ad_rgb", "0", "", None))
    monkeypatch.setattr(run, "provenance", lambda **more: {"mitsuba": "none", **more})


def scenes(folder: Path, *names: str, text: str = RAY_CAST) -> Path:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / f"{name}.yaml").write_text(text)
    return folder


def suite(text: str = "about: a test\n") -> Source:
    return Source(parse_suite(text, "test.yaml"), "test", "test.yaml", "test.yaml", text)


def run_in(out: Path, folder: Path, text: str = "about: a test\n", only=(), **options):
    source = suite(text)
    rungs = options.get("rungs", ())
    planned = plan(source, folder, only, rungs)
    return run_suite(source, planned, Options(out, runner=RUNNER, **options))


def processes(found) -> dict[str, int]:
    return {case.scene: case.tiers[0].numbers["process"] for case in found.cases}


# ---- suite files --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("about: x\nscenes:\n  a: {sp: 4}\n", "s.yaml:3: scenes.a.sp: unknown key"),
        ("about: x\nscenes:\n  a:\n    spp: 0\n", "s.yaml:4: scenes.a.spp: expected greater"),
        ("about: x\ndefaults:\n  limit: -1\n", "s.yaml:3: defaults.limit: expected greater"),
        ("about: x\n\nscenes: {a: {size: [3]}}\n", "s.yaml:3: scenes.a.size"),
        ("about: x\nscenes:\n  a: {skip: ''}\n", "s.yaml:3: scenes.a.skip"),
        ("about: x\nscenes:\n  a: {control: true}\n", "s.yaml:3: scenes.a.control: is told by"),
        ("defaults: {}\n", "s.yaml:1: about: missing"),
        ("about: x\nabout: y\n", "s.yaml:2: malformed"),
        ("about: [\n", "s.yaml:2: malformed"),
        ("- a\n", "s.yaml:1: expected keys"),
        ("", "s.yaml:1: expected keys"),
        ("about: x\ncase_seconds: .nan\n", "s.yaml:2: case_seconds: expected"),
    ],
)
def test_a_wrong_suite_is_told_with_its_line(text, expected):
    with pytest.raises(SceneError) as error:
        parse_suite(text, "s.yaml")
    assert str(error.value).startswith(expected)
    assert "\n" not in str(error.value)


def test_a_suite_may_be_a_file_of_ones_own(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("about: mine\n")
    assert load_suite(str(path)).name == "mine"
    with pytest.raises(UsageError, match="there is no suite 'huge'; expected smoke, standard"):
        load_suite("huge")
    with pytest.raises(SceneError, match="cannot be read"):
        load_suite(str(tmp_path / "none.yaml"))
    path.write_bytes(b"\xff\xfe\xfa")
    with pytest.raises(SceneError, match="is not text"):
        load_suite(str(path))


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_suites_fit_the_scenes(name):
    """Every scene is compared, or it is said why not, and none is named that is not there."""
    source = load_suite(name)
    planned = plan(source, SCENES)
    names = {work.name for work in planned.work} | set(planned.skipped)
    assert {path.stem for path in SCENES.glob("*.yaml")} <= names
    assert all(len(why) > 10 for why in planned.skipped.values())


# ---- what is run --------------------------------------------------------------------------------

NOISY = "integrator: {type: path}\n"


def test_a_scene_that_is_not_named_has_the_defaults(tmp_path):
    scenes(scenes(tmp_path, "a", "b", "d"), "c", text=NOISY)
    planned = plan(
        suite("""
about: x
defaults: {spp: 8, replicates: 4}
scenes:
  a: {spp: 16}
  d: {skip: it is not needed}
controls:
  defaults: {spp: 2}
"""),
        tmp_path,
    )
    assert {work.name: work.budget for work in planned.work} == {
        "a": Budget(spp=16, replicates=4),
        "b": Budget(spp=8, replicates=4),
        "c": Budget(spp=8, replicates=4),
        **{f"{name} (control)": Budget(spp=2, control=True) for name in "abcd"},
    }
    assert planned.skipped == {"d": "it is not needed"}


def test_controls_may_be_of_some_scenes_only(tmp_path):
    scenes(tmp_path, "a", "b", text=NOISY)
    text = "about: x\ncontrols: {only: [b]}\n"
    assert [work.name for work in plan(suite(text), tmp_path).work] == ["a", "b", "b (control)"]
    with pytest.raises(SceneError, match=r"test\.yaml:2: controls\.only\[0\]: there is no scene"):
        plan(suite(text.replace("[b]", "[z]")), tmp_path)


def test_a_scene_that_is_named_must_be_there(tmp_path):
    scenes(tmp_path, "a")
    text = "about: x\nscenes:\n  a: {}\n  other: {}\n"
    with pytest.raises(SceneError) as error:
        plan(suite(text), tmp_path)
    assert str(error.value).startswith("test.yaml:4: scenes.other: there is no scene 'other'")


@pytest.mark.parametrize(
    ("patterns", "expected"),
    [
        (("a*",), ["aa", "aa (control)", "ab", "ab (control)"]),
        (("ab", "b"), ["ab", "b"]),
        (("*(control)",), ["aa (control)", "ab (control)", "b (control)"]),
        (("b*",), ["b", "b (control)"]),
    ],
)
def test_only_those_that_fit_a_pattern(tmp_path, patterns, expected):
    scenes(scenes(tmp_path, "aa", "ab"), "b", text=NOISY)
    planned = plan(suite("about: x\ncontrols: {}\n"), tmp_path, patterns)
    assert [work.name for work in planned.work] == expected


def test_nothing_to_run_is_no_success(tmp_path):
    scenes(tmp_path, "a")
    with pytest.raises(UsageError, match=r"nothing to run: no case fits z\*"):
        plan(suite(), tmp_path, ("z*",))
    with pytest.raises(UsageError, match="holds no scene"):
        plan(suite(), scenes(tmp_path / "empty"))
    with pytest.raises(UsageError, match="there is no folder"):
        plan(suite(), tmp_path / "none")
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(SceneError, match=r"has the name of a\.json"):
        plan(suite(), tmp_path)


def test_only_some_rungs(tmp_path):
    folder = scenes(tmp_path / "scenes", "a", "b")
    found = run_in(tmp_path / "out", folder, rungs=("whitted",))
    assert found.cases == ()
    assert found.not_run == dict.fromkeys("ab", "has no rung whitted")
    assert exit_code(found.cases) == 4
    found = run_in(tmp_path / "out", folder, rungs=("whitted", "geometry"))
    assert [case.scene for case in found.cases] == ["a", "b"]


def test_controls_are_of_pictures_only(tmp_path):
    scenes(tmp_path, "a", text=NOISY)
    source = suite("about: x\ncontrols: {}\n")
    assert len(plan(source, tmp_path, rungs=("geometry",)).work) == 1
    assert len(plan(source, tmp_path, rungs=("geometry", "statistics")).work) == 2


# ---- what is not run again ----------------------------------------------------------------------


def test_what_is_done_is_not_done_again(tmp_path):
    folder, out = scenes(tmp_path / "scenes", "a", "differ"), tmp_path / "out"
    first = run_in(out, folder)
    assert [case.verdict for case in first.cases] == ["agree", "differ"]
    assert processes(run_in(out, folder)) == processes(first)
    (folder / "a.yaml").write_text(RAY_CAST + "film: {width: 8, height: 8}\n")
    second = processes(run_in(out, folder))
    assert second["differ"] == processes(first)["differ"]
    assert second["a"] != processes(first)["a"]
    third = processes(run_in(out, folder, "about: x\ndefaults: {pixels: 99}\n"))
    assert not set(third.values()) & set(second.values())
    fresh = processes(run_in(out, folder, "about: x\ndefaults: {pixels: 99}\n", fresh=True))
    assert not set(fresh.values()) & set(third.values())
    told = json.loads((out / "results.json").read_text())
    assert [case["scene"] for case in told["cases"]] == ["a", "differ"]
    assert told["suite"] == "test"
    assert "differ" in (out / "report.html").read_text(encoding="utf-8")


def test_a_damaged_record_is_made_again(tmp_path):
    folder, out = scenes(tmp_path / "scenes", "a"), tmp_path / "out"
    first = run_in(out, folder)
    (out / "cases" / "a" / "pictures.exr").write_bytes(b"v/1\x01")
    second = run_in(out, folder)
    assert processes(first) != processes(second)
    assert read_case(out / "cases" / "a").images is not None


def test_keys_tell_what_a_case_is_made_with(tmp_path):
    (tmp_path / "bitmap.png").write_bytes(b"1")
    (tmp_path / "s.yaml").write_text("textures: {t: {type: bitmap, file: bitmap.png}}\n")

    def key(variant="llvm_ad_rgb", rungs=(), **budget):
        scene = Scene.load(tmp_path / "s.yaml")
        return case_key(scene, Budget(**budget), rungs, Backend(variant, "0", "", None))

    keys = [key(), key("scalar_rgb"), key(rungs=("film",)), key(spp=3), key(control=True)]
    (tmp_path / "bitmap.png").write_bytes(b"2")
    keys.append(key())
    (tmp_path / "s.yaml").write_text("textures: {t: {type: bitmap, file: ./bitmap.png}}\n")
    keys.append(key())
    assert len(set(keys)) == len(keys)
    assert key() == keys[-1]
    (tmp_path / "bitmap.png").unlink()
    with pytest.raises(SceneError, match=r"bitmap\.png: cannot be read"):
        key()


def test_keys_cover_the_parts_of_a_mesh(tmp_path):
    (tmp_path / "m.gltf").write_text(json.dumps({"buffers": [{"uri": "m%20x.bin"}, {}]}))
    (tmp_path / "m x.bin").write_bytes(b"1")
    (tmp_path / "s.yaml").write_text("shapes: [{type: mesh, file: m.gltf}]\n")
    scene = Scene.load(tmp_path / "s.yaml")
    before = files_digest(scene)
    (tmp_path / "m x.bin").write_bytes(b"2")
    assert files_digest(scene) != before


# ---- processes that fail ------------------------------------------------------------------------


def test_what_fails_is_told_and_the_others_go_on(tmp_path):
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
    assert reasons["scene_error"] == "run: x.yaml:3: is not what it must be"
    assert exit_code(found.cases) == 4  # some could not run
    for case in found.cases:
        assert case.tiers[0].name == ("run" if case.scene in reasons else "geometry")
    # What could not be run is run again; the rest is not.
    again = run_in(out, folder)
    pids = processes_of(found, "agree")
    assert pids == processes_of(again, "agree")
    assert read_record(out / "cases" / "crash").key == ""


def processes_of(found, verdict):
    return [c.tiers[0].numbers["process"] for c in found.cases if c.verdict == verdict]


def test_a_process_that_hangs_is_ended(tmp_path):
    folder = scenes(tmp_path / "scenes", "a", "hang", "z")
    found = run_in(tmp_path / "out", folder, "about: x\ncase_seconds: 5\n", jobs=2)
    assert [case.verdict for case in found.cases] == ["agree", "invalid", "agree"]
    assert found.cases[1].reason.startswith("run: took longer than 5 s")


def test_processes_are_shared_out(tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "MOST_CASES", 2)
    names = [f"slow{k}" for k in range(2)] + [f"z{k}" for k in range(3)]
    folder = scenes(tmp_path / "scenes", *names)
    found = run_in(tmp_path / "out", folder, jobs=2, threads=3)
    pids = list(processes(found).values())
    assert pids[0] != pids[1]
    assert max(pids.count(pid) for pid in pids) == 2
    assert {case.tiers[0].numbers["threads"] for case in found.cases} == {3}


def test_where_no_case_can_run_nothing_is_said_of_any(tmp_path):
    folder = scenes(tmp_path / "scenes", "a", "unavailable")
    with pytest.raises(ReferenceUnavailableError, match="no reference here"):
        run_in(tmp_path / "out", folder)
    request = Request(name="a", scene=folder / "a.yaml", budget=Budget(), folder=tmp_path)
    worker = ("comparisons.suites.worker", "--runner", "no_such_module:f")
    with pytest.raises(ReferenceUnavailableError, match="no_such_module"):
        list(pool.run([request], 1, 60.0, lambda *_: None, worker))


INTERRUPTED = """
import signal
import sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs are deaf to it
from pathlib import Path
from comparisons.mitsuba_backend import Backend
from comparisons.suites import run, suite
run.backend = lambda: Backend("llvm_ad_rgb", "0", "", None)
run.provenance = lambda **more: {"mitsuba": "none", **more}
source = suite.Source(suite.Suite(about="x"), "test", "test.yaml", "test.yaml", "")
planned = suite.plan(source, Path(sys.argv[1]))
run.run_suite(source, planned, run.Options(Path(sys.argv[2]), runner="suite_runners:by_name"))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_keeps_what_is_done(tmp_path, number):
    folder, out = scenes(tmp_path / "scenes", "a", "hang"), tmp_path / "out"
    command = [sys.executable, "-c", INTERRUPTED, str(folder), str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        deadline = time.monotonic() + 60.0
        while not (out / "cases" / "a" / "case.json").exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        time.sleep(0.5)  # until the next case has begun
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        workers = children.read_text().split() if children.exists() else []
        process.send_signal(number)
        process.communicate(timeout=120.0)
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
    assert [case.scene for case in read_archive(out).cases] == ["a"]


# ---- the commands -------------------------------------------------------------------------------


@pytest.fixture
def command(monkeypatch):
    """`reference-rt suite` and `report`, with the runners of tests."""
    app = typer.Typer()
    app.command()(suite_command)
    app.command()(report)
    whole = run.run_suite
    monkeypatch.setattr(
        run, "run_suite", lambda s, p, options: whole(s, p, replace(options, runner=RUNNER))
    )
    for name in ("GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY"):
        monkeypatch.delenv(name, raising=False)
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


def test_the_command_as_a_whole(tmp_path, command):
    folder, out = scenes(tmp_path / "scenes", "a", "b", "differ"), tmp_path / "out"
    mine = tmp_path / "mine.yaml"
    mine.write_text("about: mine\nscenes: {b: {skip: it is not needed}}\n")
    common = (mine, "--scenes", folder, "--out", out)
    result = command("suite", *common, "--junit", tmp_path / "junit.xml", "--jobs", 1)
    assert result.exit_code == 1, result.output
    assert "a: agree" in result.stderr
    assert "differ: differ" in result.stderr
    assert "2 cases: 1 agree, 1 differ" in result.stderr
    assert "not run: b: it is not needed" in result.stderr
    assert "::error" not in result.output
    (tests,) = JUnitXml.fromfile(str(tmp_path / "junit.xml"))
    assert (tests.tests, tests.failures, tests.skipped) == (3, 1, 1)
    assert command("suite", *common, "--only", "a").exit_code == 0
    told = json.loads((out / "results.json").read_text())
    assert [case["scene"] for case in told["cases"]] == ["a"]
    again = told["cases"][0]["again"].split()
    assert again[:6] == ["reference-rt", "suite", str(mine), "--only", "a", "--fresh"]


def test_github_is_told_by_itself(tmp_path, command, monkeypatch):
    folder = scenes(tmp_path / "scenes", "a", "differ")
    mine = tmp_path / "mine.yaml"
    mine.write_text("about: mine\n")
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    result = command("suite", mine, "--scenes", folder, "--out", tmp_path / "out")
    assert f"::error file={folder.as_posix()}/differ.yaml,title=differ%3A differ::" in result.stdout
    assert "**1** differ, **1** agree" in (tmp_path / "summary.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (("nothing",), 2, "there is no suite 'nothing'"),
        (("smoke", "--scenes", "nowhere"), 2, "there is no folder 'nowhere'"),
        (("smoke", "--only", "z*"), 2, "nothing to run"),
        (("smoke", "--tier", "run"), 2, "--tier: expected one of film, geometry"),
        (("smoke", "--jobs", "0"), 2, "jobs"),
    ],
)
def test_wrong_use_is_told(command, arguments, code, told):
    options = () if "--scenes" in arguments else ("--scenes", SCENES)
    result = command("suite", *arguments, *options)
    assert result.exit_code == code
    assert told in result.output


def test_a_report_is_rendered_again(tmp_path, command):
    folder, out = scenes(tmp_path / "scenes", "a", "differ"), tmp_path / "out"
    run_in(out, folder)
    before = (out / "results.json").read_text()
    (out / "report.html").unlink()
    page = tmp_path / "page.html"
    result = command("report", out, "--out", page)
    assert result.exit_code == 0, result.output
    assert (out / "results.json").read_text() == before
    assert "differ" in page.read_text(encoding="utf-8")
    (out / "results.json").unlink()
    assert command("report", out).exit_code == 0  # all records, then
    assert (out / "report.html").exists()
    told = json.loads((out / "results.json").read_text())
    assert [case["scene"] for case in told["cases"]] == ["a", "differ"]


def test_a_report_of_what_is_no_suite_is_refused(tmp_path, command):
    result = command("report", tmp_path)
    assert result.exit_code == 3
    assert "holds no case" in result.output
    (tmp_path / "results.json").write_text("[]")
    result = command("report", tmp_path)
    assert result.exit_code == 3
    assert "is not what a suite writes" in result.output
    (tmp_path / "results.json").write_text(
        '{"cases": [{"scene": "a"}], "provenance": {}, "suite": null, "not_run": {}}'
    )
    result = command("report", tmp_path)
    assert result.exit_code == 3
    assert "cannot be read" in result.output
