"""The gate as a whole: right pictures pass, wrong ones do not, and each says why."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from faulty_sources import plant
from gate_checks import SCENE, files, pictures, run, status, write
from junitparser import JUnitXml

from comparisons.experiments.selftest import SourceFault
from comparisons.gate import reference_cache
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.image import srgb, write_png
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

pytestmark = pytest.mark.usefixtures("gate_folder")


# ---- verdicts -----------------------------------------------------------------------------------


def test_right_pictures_pass(right: FloatArray, monkeypatch: pytest.MonkeyPatch) -> None:
    result, found = run(*files(right), "--scene", "ball.yaml", "--junit", "junit.xml")
    assert result.exit_code == 0, result.output
    assert "ball: agree: " in result.stdout
    case = found["cases"][0]
    assert (case["scene"], case["verdict"]) == ("ball", "agree")
    assert list(case["tiers"]) == ["input", "statistics", "images"]
    assert all(rung["status"] == "agree" for rung in case["tiers"].values())
    assert case["sides"] == {"candidate": "candidate's", "reference": "reference_rt's"}
    assert found["provenance"]["candidates"] == [f"c{k}.exr" for k in range(4)]
    page = Path("out/report.html").read_text()
    assert "<title>ball: agree, reference_rt</title>" in page
    assert re.search(r"<h3>Seconds</h3>\s*<p>\d+\.\d in all</p>", page)
    assert JUnitXml.fromfile("junit.xml").tests == 1
    assert JUnitXml.fromfile("junit.xml").failures == 0

    def refuse(*arguments: object, **more: object) -> None:
        raise AssertionError("the reference is in the cache")

    monkeypatch.setattr(reference_cache, "render", refuse)
    assert run(*files(right), "--scene", "ball.yaml")[0].exit_code == 0


def test_a_description_that_we_misread_fails() -> None:
    """Green and blue exchanged by our reader, in the reference and so also in the candidate of
    whoever exchanges them, too: the numbers of the file read twice are not the same."""
    with pytest.MonkeyPatch.context() as patch:
        rgb = "    return rgb\n\n\ndef refl"
        swapped = "    return rgb[::2] + rgb[1:2]\n\n\ndef refl"
        plant(patch, SourceFault("", "", "core/model.py", rgb, swapped))
        result, found = run(*files(pictures()), "--scene", "ball.yaml")
    assert result.exit_code == 1, result.output
    case = found["cases"][0]
    assert case["verdict"] == "differ"
    said = "materials.lamp.radiance: the description says 60 50 20, the rendered scene has 60 20 50"
    assert case["reason"] == f"files: {said}; and 1 more"
    statuses = {name: rung["status"] for name, rung in case["tiers"].items()}
    assert statuses == {
        "files": "differ",
        "input": "agree",
        "statistics": "agree",
        "images": "agree",
    }
    assert said in Path("out/report.html").read_text()


def test_one_percent_more_fails(right: FloatArray) -> None:
    replicates = files(1.02 * right)
    result, found = run(*replicates, "--scene", "ball.yaml", "--junit", "junit.xml")
    assert result.exit_code == 1, result.output
    assert "ball: differ: likeliest cause: constant gain of 1.0" in result.stdout
    assert "\n  limit  " in result.stdout
    assert "gain" in found["cases"][0]["cause"]["name"]
    assert found["cases"][0]["worst"]
    assert JUnitXml.fromfile("junit.xml").failures == 1
    one = write("one.exr", 1.01 * right.mean(axis=0))
    result, found = run(one, "--scene", "ball.yaml", "--limit", "0.005")
    assert result.exit_code == 1


def test_a_lost_light_is_named(right: FloatArray) -> None:
    unlit = pictures(SCENE.replace("[0.5, 0.4, 0.3]", "[0, 0, 0]"))
    result, found = run(*files(unlit), "--scene", "ball.yaml")
    assert result.exit_code == 1
    assert "lights[0] (constant)" in str(found["cases"][0]["cause"])


def test_a_single_noisy_picture_is_inconclusive(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")  # where no row of the table is broken
    noisy = pictures(count=1, spp=1) * np.random.default_rng(1).exponential(1.0, (32, 32, 1))
    result, found = run(*files(noisy), "--scene", "ball.yaml")
    assert result.exit_code == 1, result.output
    assert "ball: inconclusive: a single picture does not show its noise" in result.stdout
    assert "\n  would have been seen  unknown  " in result.stdout
    assert status(found, "statistics") == "inconclusive"
    assert status(found, "images") == "not-applicable"


def test_noise_is_judged_by_the_documented_limit(right: FloatArray) -> None:
    """0.5 % (docs/gate.md), where the noise of these pictures would hide a bias of 1 to 2 %."""
    random = np.random.default_rng(4)
    noisy = right * (1.0 + 0.05 * random.normal(size=(len(right), 32, 32, 1)))
    given = ("gate", *files(noisy), "--scene", "ball.yaml")
    assert invoke(*given, "--limit", "0.05").exit_code == 0
    usual = invoke(*given)
    assert usual.exit_code == 1
    assert "inconclusive: too noisy to decide" in usual.stdout
    assert "0.50 % is asked" in usual.stdout


def test_references_from_files(right: FloatArray) -> None:
    candidates, judges = files(right[:2]), [write(f"r{k}.exr", right[2 + k]) for k in range(2)]
    options = [word for judge in judges for word in ("--reference", judge)]
    result, found = run(*candidates, *options)
    assert found["cases"][0]["scene"] == "r0"
    assert status(found, "input") == "agree", result.output
    assert found["cases"][0]["verdict"] in ("agree", "inconclusive")
    # A mean, and how exact it is.
    mean = write("mean.exr", right.mean(axis=0))
    variance = write("var.exr", right.var(axis=0, ddof=1) / len(right))
    result, found = run(*files(pictures(spp=1024)), "--reference", mean, "--variance", variance)
    assert (result.exit_code, status(found, "images")) == (0, "agree"), result.output
    result, _ = run(*files(1.03 * right), "--reference", mean, "--variance", variance)
    assert result.exit_code == 1
    assert "mean: differ: likeliest cause: constant gain of 1.03; " in result.output


@pytest.mark.parametrize("suffix", ["exr", "npy", "png"])
def test_pictures_without_noise(suffix: str) -> None:
    scene = SCENE.replace("sobol", "grid") + "integrator: {type: whitted}\n"
    sun = "type: directional, direction: [-1, -1, -1], irradiance:"
    scene = scene.replace("type: constant, radiance: [0.5, 0.4, 0.3]", f"{sun} [9, 5, 4]")
    Path("ball.yaml").write_text(scene)
    picture = render(Scene.parse(scene)).colour
    assert picture.max() > 1.0  # which 8 bits do not hold

    def written(name: str, values: FloatArray) -> str:
        if suffix == "exr":
            return write(f"{name}.exr", values)
        if suffix == "npy":
            np.save(f"{name}.npy", values)
        else:
            write_png(Path(f"{name}.png"), srgb(values), {})
        return f"{name}.{suffix}"

    result, found = run(written("right", picture), "--scene", "ball.yaml")
    assert result.exit_code == 0, result.output
    assert status(found, "statistics") == "agree"
    assert ("8-bit sRGB" in str(found["cases"][0]["notes"])) == (suffix == "png")
    if suffix == "npy":
        return  # the rest of both sorts of values: of 8 bits and of floating point
    result, _ = run(written("wrong", 1.02 * picture), "--scene", "ball.yaml")
    assert result.exit_code != 0
    result, _ = run(written("wrong", 1.02 * picture), "--scene", "ball.yaml", "--tolerance", "0.03")
    assert result.exit_code == 0, result.output
    result, _ = run(written("right", picture), "--scene", "ball.yaml", "--tolerance", "-1")
    assert (result.exit_code, "the tolerance is -1" in result.output) == (2, True)
    both = [write("a.exr", picture), write("b.exr", picture)]
    result, _ = run(*both, "--scene", "ball.yaml")
    assert (result.exit_code, "of a picture without noise" in result.output) == (2, True)


# ---- baselines ----------------------------------------------------------------------------------


def test_a_baseline_from_nothing_to_stale(right: FloatArray) -> None:
    candidates = files(right)
    result, found = run(*candidates, "--baseline", "ball")
    assert result.exit_code == 4
    told = "reference-rt accept c0.exr c1.exr c2.exr c3.exr --name ball --baselines baselines"
    assert told in result.output
    assert found["cases"][0]["verdict"] == "not-comparable"
    assert not Path("baselines").exists()

    arguments = [*shlex.split(told)[1:], "--reason", "looked at it", "--scene", "ball.yaml"]
    assert invoke(*arguments).exit_code == 0
    others = files(pictures(spp=512))
    result, found = run(*others, "--baseline", "ball")
    assert result.exit_code == 0, result.output
    assert found["provenance"]["baseline"] == "ball"
    assert found["cases"][0]["sides"]["reference"] == "the baseline's, ball"
    assert invoke("accept", "--unused", "out").exit_code == 0
    result, _ = run(*files(1.03 * right), "--baseline", "ball")
    assert result.exit_code == 1
    assert "ball: differ: " in result.output

    Path("ball.yaml").write_text(SCENE.replace("radius: 1", "radius: 1.1"))
    result, _ = run(*candidates, "--baseline", "ball")
    assert (result.exit_code, "is stale: the scene 'ball' has changed" in result.output) == (
        4,
        True,
    )
    Path("ball.yaml").write_text(SCENE)
    write("baselines/ball/picture-02.exr", 1.03 * right.mean(axis=0))
    result, found = run(*candidates, "--baseline", "ball")
    assert result.exit_code == 3
    assert "picture-02.exr: has changed since it was accepted (SHA-256 differs)" in result.output
    assert found["cases"][0]["verdict"] == "invalid"


# ---- CI -----------------------------------------------------------------------------------------


def test_github_sees_it(right: FloatArray, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    result, _ = run(*files(1.05 * right), "--scene", "ball.yaml")
    assert "::error file=ball.yaml,title=ball%3A differ::likeliest cause: " in result.stdout
    assert "differ" in Path("summary.md").read_text()
