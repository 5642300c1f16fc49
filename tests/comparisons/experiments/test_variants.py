"""Mitsuba's variants against each other: the failing plugin is named, what is missing is said."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import invoke

from comparisons.experiments import variants
from comparisons.mitsuba import backend
from comparisons.results.case import Case

BOX = str(Path(__file__).parents[3] / "scenes" / "cornell_box.yaml")

MEAN = np.random.default_rng(1).uniform(0.5, 1.5, (24, 24, 1)) * np.array([1.0, 0.8, 0.6])


def noisy(seed: int, gain: float = 1.0) -> Any:
    noise = np.random.default_rng(seed).gamma(400.0, 1.0 / 400.0, (8, 24, 24, 1))
    return gain * MEAN * noise


def faked(monkeypatch: pytest.MonkeyPatch, **by_variant: dict[str, Any]) -> list[Case]:
    """The cases of what processes of variants would tell."""
    monkeypatch.setattr(variants, "measured", lambda name, *more: by_variant[name])
    task = variants.Task((BOX,), plugins=("sphere", "linearcurve"))
    return variants.run(list(by_variant), task, 0.02, lambda line: None)


def told(gain: float, sphere: str = "agree", reach: float = 1.0, seed: int = 1) -> dict[str, Any]:
    t = np.linspace(1.0, 2.0, 500)
    met = np.where(t < reach, t, np.inf)
    return {
        "rays sphere": {"status": sphere, "reason": "so many rays"},
        "rays linearcurve": {
            "status": "agree",
            "reason": "",
            "array": met,
        },
        "picture cornell_box": {"status": "agree", "reason": "", "array": noisy(seed, gain)},
    }


def test_a_failing_plugin_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    right = told(1.0, reach=3.0)
    cases = faked(monkeypatch, scalar_rgb=right, llvm_ad_rgb=told(1.0, reach=3.0, seed=2))
    assert [case.verdict for case in cases] == ["agree", "agree", "agree"]
    wrong = told(0.9, "differ", reach=1.5)
    cases = faked(
        monkeypatch, scalar_rgb=right, llvm_ad_rgb=told(1.0, reach=3.0), cuda_ad_rgb=wrong
    )
    by_name = {case.scene: case for case in cases}
    assert "the plugin sphere fails in cuda_ad_rgb: " in by_name["rays of sphere"].reason
    assert "the plugin linearcurve fails in cuda_ad_rgb" in by_name["rays of linearcurve"].reason
    verdicts = {name: case.verdict for name, case in by_name.items() if name.startswith("cornell")}
    assert verdicts == {
        "cornell_box: cuda_ad_rgb against llvm_ad_rgb": "differ",
        "cornell_box: cuda_ad_rgb against scalar_rgb": "differ",
        "cornell_box: llvm_ad_rgb against scalar_rgb": "unchanged",
    }
    case = by_name["cornell_box: cuda_ad_rgb against scalar_rgb"]
    assert case.sides == ("cuda_ad_rgb's", "scalar_rgb's")
    assert case.cause is not None
    assert case.cause.name.startswith("constant gain of 0.9")


def test_a_variant_that_does_not_start_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has told nothing: all that it should have done is named, and the first part fails."""
    program = tmp_path / "dies"
    program.write_text("#!/bin/sh\necho no such driver >&2\nexit 3\n")
    program.chmod(0o700)
    task = variants.Task((BOX,), plugins=("sphere", "disk"))
    with monkeypatch.context() as patched:
        patched.setattr(variants.sys, "executable", str(program))
        dead = variants.measured("cuda_ad_rgb", task, tmp_path / "v", lambda line: None)
    cases = faked(monkeypatch, scalar_rgb=told(1.0), cuda_ad_rgb=dead)
    found = {case.scene: case for case in cases}
    assert found["rays of sphere"].verdict == "differ"
    assert "ends the process with 3: no such driver" in found["rays of sphere"].reason
    picture = found["cornell_box: cuda_ad_rgb against scalar_rgb"]
    assert picture.verdict == "not-comparable"
    assert "cuda_ad_rgb: was not run" in picture.reason


def test_a_variant_that_crashes_names_what_it_did(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "crashes"
    program.write_text(
        f"#!{sys.executable}\n"
        "import json, os, sys\n"
        "told = [{'what': 'rays disk', 'status': 'agree', 'reason': ''},\n"
        "        {'what': 'rays sphere', 'status': 'begun', 'reason': 'was begun'}]\n"
        "with open(sys.argv[-1] + '/told.jsonl', 'w') as file:\n"
        "    file.writelines(json.dumps(line) + '\\n' for line in told)\n"
        "os.abort()\n"
    )
    program.chmod(0o700)
    monkeypatch.setattr(variants.sys, "executable", str(program))
    found = variants.measured("llvm_ad_rgb", variants.Task(), tmp_path / "v", lambda line: None)
    assert found["rays disk"]["status"] == "agree"
    assert found["rays sphere"]["status"] == "differ"
    assert "llvm_ad_rgb ends the process with -6" in found["rays sphere"]["reason"]


def test_without_a_gpu_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend.ctypes.util, "find_library", lambda name: None)
    monkeypatch.delenv("DRJIT_LIBCUDA_PATH", raising=False)
    assert backend.no_gpu() == "no GPU (no driver library libcuda was found)"
    chosen = backend.choose(backend.FASTEST)
    assert chosen.variant != backend.CUDA
    assert "cuda_ad_rgb: no GPU" in chosen.reason
    monkeypatch.setattr(backend, "no_gpu", lambda: None)
    monkeypatch.setattr(backend, "prove", lambda variant, path: None)
    assert backend.choose(backend.FASTEST).variant == backend.CUDA


def test_the_asked_variant_is_of_this_command_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(backend.FORCE, raising=False)
    with backend.asked_for("scalar_rgb"):
        assert backend.choose().variant == "scalar_rgb"
    assert backend.FORCE not in backend.os.environ
    monkeypatch.setenv(backend.FORCE, "scalar_rgb")
    with backend.asked_for(backend.FASTEST):  # what the environment says is heeded
        assert backend.choose().variant == "scalar_rgb"


@pytest.mark.slow
@pytest.mark.parametrize("name", [backend.LLVM, backend.CUDA])
def test_variants_agree(name: str, tmp_path: Path) -> None:
    works, left_out = variants.works()
    if name not in works:
        pytest.skip("; ".join(left_out))
    few = ["--rays", "12000", "--size", "32x32", "--spp", "16"]
    some = ["--variant", backend.SCALAR, "--variant", name]
    result = invoke("variants", BOX, *few, *some, "-o", tmp_path)
    assert result.exit_code == 0, result.output
    cases = json.loads((tmp_path / "results.json").read_text())["cases"]
    verdicts = {case["scene"]: case["verdict"] for case in cases}
    for plugin in variants.PLUGINS:
        assert verdicts[f"rays of {plugin}"] in ("agree", "reference-limited"), plugin


def test_scenes_of_one_name_are_refused(tmp_path: Path) -> None:
    for folder in "ab":
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "ball.yaml").write_text("shapes: [{type: sphere}]\n")
    a, b = (str(tmp_path / folder / "ball.yaml") for folder in "ab")
    for words in (["variants", a, b], ["versions", "3.8.0", "3.9.1", "--scene", a, "--scene", b]):
        result = invoke(*words, "--out", str(tmp_path / "out"))
        assert result.exit_code == 2, result.output
        assert "have the same name" in result.stderr
