"""A run: processes that crash, results that are resumed, distinct findings, outputs, exit codes."""

import json
import os
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from builders import HELPERS
from command_line import invoke
from junitparser import JUnitXml

from comparisons.experiments.fuzz import results, summary, worker
from comparisons.experiments.fuzz import run as running
from comparisons.experiments.fuzz.finding import Checked, Effort, Request
from comparisons.experiments.fuzz.planted import Planted, feature_of, source_faults
from comparisons.experiments.fuzz.planted import summary as planted_summary
from comparisons.experiments.fuzz.run import Plan, run
from comparisons.experiments.fuzz.schema import features as known
from comparisons.experiments.fuzz.summary import write_page
from comparisons.mitsuba.backend import FORCE, choose
from comparisons.runs import provenance
from reference_rt.scene.model import SceneModel
from reference_rt.util.errors import UsageError
from reference_rt.util.workers import Threads

SCENES = Path(__file__).parents[3] / "scenes"


@pytest.fixture
def fake_workers(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(HELPERS))
    monkeypatch.setattr(running, "WORKER", ("fuzz_workers",))


def quiet(checked: Checked) -> None:
    pass


def by_number(found):
    return dict(found.findings)


@pytest.mark.slow
def test_a_scene_that_hangs_is_a_finding(tmp_path, fake_workers):
    found = run(Plan(tmp_path, first=3, count=1, limit=40.0, shrink=0.0), quiet)
    assert by_number(found)[3].cause == "took longer than # s"


def test_scenes_that_crash_or_raise_are_findings(tmp_path, fake_workers):
    plan = Plan(tmp_path, count=7, workers=Threads(2), shrink=0.0)
    results.add(tmp_path, Checked(number=3))  # it would hang
    told = []
    found = run(plan, told.append)
    assert sorted(c.number for c in told) == [0, 1, 2, 4, 5, 6]
    findings = by_number(found)
    assert set(findings) == {1, 2, 4, 5}
    assert "SIGSEGV" in findings[1].detail
    assert "KeyError" in findings[2].cause
    assert findings[4] == findings[5]
    again = run(plan, told.append)
    assert again.fresh == 0
    assert by_number(again) == findings
    more = run(replace(plan, count=8), told.append)
    assert more.fresh == 1
    with pytest.raises(UsageError, match="another seed or other settings"):
        run(replace(plan, seed=3), quiet)


@pytest.mark.slow  # each try is a new process
def test_a_crash_is_reduced_in_new_processes(tmp_path, fake_workers, monkeypatch):
    scene = {"shapes": [{"type": "torus", "major_radius": 0.8}, {"type": "box"}]}
    monkeypatch.setattr(running, "generate", lambda *arguments: scene)
    found = run(Plan(tmp_path, first=1, count=1, shrink=20.0), quiet)
    (one,) = found.reduced
    assert one.scene["shapes"] == [{"type": "torus"}]


def test_findings_of_one_cause_are_one(tmp_path, fake_workers):
    plan = Plan(tmp_path, first=4, count=3, workers=Threads(1))
    found = run(plan, quiet)
    assert len(found.findings) == 2
    ((one, count),) = summary.distinct(found)
    assert (one.number, count, one.tried) == (4, 2, 7)
    summary.write_results(plan, found, {"who": "a test"}, tmp_path / "junit.xml")
    document = json.loads((tmp_path / "fuzz.json").read_text())
    assert document["scenes"] == document["lit"] == document["valid"] == 3
    (listed,) = document["findings"]
    assert listed["scene"] == "shapes:\n  - {type: sphere}\n"
    words = shlex.split(listed["again"])
    assert SceneModel.load(words[words.index("--scene") + 1]).shapes
    suite = next(iter(JUnitXml.fromfile(str(tmp_path / "junit.xml"))))
    assert (suite.tests, suite.failures) == (2, 1)
    write_page(tmp_path / "fuzz.html", plan, found, {"who": "<a test>"})
    page = (tmp_path / "fuzz.html").read_text()
    assert "geometry: ours wrong: t" in page
    assert "&lt;a test&gt;" in page
    assert "{type: sphere}" in page


@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
def test_the_variant_is_handed_on_and_told(variant, tmp_path, fake_workers, monkeypatch):
    """To the processes, to the command that repeats a finding, and on the page."""
    monkeypatch.setattr(provenance, "backend", choose)  # this process may have one already
    invoke("fuzz", "--variant", variant, "--count", 5, "--first", 4, "--reduce", 0, "-o", tmp_path)
    document = json.loads((tmp_path / "fuzz.json").read_text())
    assert variant in document["provenance"]["mitsuba"]
    assert document["settings"]["effort"]["variant"] == variant
    (listed,) = document["findings"]
    assert (f"--variant {variant}" in listed["again"]) == (variant != "scalar_rgb")


@pytest.mark.parametrize("asked", ["scalar_rgb", "llvm_ad_rgb"])
def test_a_process_takes_the_variant(asked, tmp_path, monkeypatch):
    monkeypatch.delenv(FORCE, raising=False)
    monkeypatch.setattr(worker, "do_scene", lambda request: None)
    effort = Effort(variant=asked)
    worker.carry_out(Request(number=0, out=tmp_path, files=tmp_path, effort=effort))
    assert os.environ[FORCE] == asked


def test_the_page_can_be_read_by_everybody(tmp_path, fake_workers, check_page):
    plan = Plan(tmp_path, first=4, count=3, workers=Threads(1))
    write_page(tmp_path / "fuzz.html", plan, run(plan, quiet), {})
    check_page(tmp_path / "fuzz.html", pictures=False)


def test_it_stops_at_the_first_finding(tmp_path, fake_workers):
    found = run(Plan(tmp_path, first=4, count=100, workers=Threads(1), stop=True), quiet)
    assert len(found.scenes) == 1
    assert len(found.reduced) == 1


def test_half_a_file_is_left_out(tmp_path):
    results.add(tmp_path, Checked(number=3))
    (tmp_path / "scenes" / "4.json").write_text('{"number": 4, "lit"')
    assert [checked.number for checked in results.every(tmp_path, Checked)] == [3]
    results.remove(tmp_path)
    assert not [*results.every(tmp_path, Checked)]


def test_the_command_refuses_what_it_does_not_know(tmp_path):
    for words, said in (
        (["--rungs", "geometri"], "--rungs: expected one of"),
        (["--time", "10 apples"], "--time: expected a duration"),
        (["--features", "glas"], "did you mean 'glass'"),
        (["--planted", "nothing like it"], "no source fault matches"),
    ):
        result = invoke("fuzz", *words, "--out", tmp_path)
        assert result.exit_code == 2
        assert said in " ".join(result.output.split())


def test_planted_faults_name_the_type_that_scenes_must_have():
    features = {feature_of(fault) for fault in source_faults()}
    assert {"", "sphere", "dielectric", "environment_map"} <= features
    known(tuple(features - {""}))
    some = [Planted("a", 3, "direct", "", 1, 9), Planted("b", 0), Planted("c", 5, "run", "", 3, 11)]
    assert planted_summary(some) == (
        "2 of 3 faults found, after 4 scenes (median); reduced to 2 shapes and 10 lines (median)"
    )


RENDERER = """
import sys
import reference_rt as rt
scene, output, seed, spp, wrong = sys.argv[1:]
scene = rt.Scene.load(scene)
picture = rt.render(scene, spp=int(spp), seed=int(seed) + 555, threads=1)
if wrong == "yes":
    picture.layers["colour"][:] *= 1.3
picture.save(output)
"""


@pytest.mark.slow  # each picture is a process of another program
@pytest.mark.parametrize("wrong", ["no", "yes"])
def test_another_renderer_is_compared_with_ours(tmp_path, wrong):
    program = tmp_path / "renderer.py"
    program.write_text(RENDERER)
    scene = {
        "camera": {"type": "perspective", "eye": [0, 1, 5], "target": [0, 0, 0], "fov": 40},
        "film": {"width": 12, "height": 9},
        "integrator": {"type": "path", "max_depth": 3},
        "shapes": [{"type": "sphere"}, {"type": "box", "transform": [{"translate": [2, 0, 0]}]}],
        "lights": [{"type": "constant", "radiance": 1.0}],
    }
    command = shlex.join([sys.executable, str(program)])
    command += " {scene} {output} {seed} {spp} " + wrong
    plan = Plan(
        tmp_path / "out",
        workers=Threads(1),
        command=command,
        scenes=(scene,),
        effort=Effort(spp=64, replicates=4),
        shrink=0.0,
    )
    found = run(plan, quiet)
    if wrong == "no":
        assert found.findings == []
        assert found.scenes[0].rungs == {"renderer": "agree"}
    else:
        ((_, finding),) = found.findings
        assert finding.rung == "statistics"


REGRESSIONS = sorted((SCENES / "regressions").glob("*.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("path", REGRESSIONS, ids=lambda path: path.stem)
def test_what_was_found_before_is_mended(path, monkeypatch):
    from comparisons.commands.trials import _data
    from comparisons.experiments.fuzz.check import check

    data = _data(path, path.parent.parent)
    for pixels in (48, 144):
        found = check(data, 4, Effort(pixels=pixels, light_pixels=pixels // 2), path.parent)
        assert found.findings == []
