"""The self-test: that its faults are what they say, and that what it counts is what it found."""

from pathlib import Path

import numpy as np
import pytest
from faulty_sources import SOURCE_FAULTS, plant

import reference_rt
from comparisons.compare.compare import Subject, gather
from comparisons.experiments.selftest import (
    FAULTS,
    PictureFault,
    SceneFault,
    SourceFault,
    of_media,
    of_readers,
)
from comparisons.experiments.selftest.fault import Finding, finding
from comparisons.experiments.selftest.mutant_worker import BUDGET
from comparisons.experiments.selftest.of_media import PHASE
from comparisons.experiments.selftest.run import Outcome, markdown
from comparisons.experiments.selftest.sensitivity import StaleFaultError, patched_text
from comparisons.experiments.selftest.specificity import Alarms
from comparisons.results.case import Case, RungResult
from reference_rt.rendering.scene import Scene

SCENES = Path(__file__).parents[3] / "scenes"


def of(kind: type) -> list:
    return [pytest.param(f, id=f.name) for f in FAULTS if isinstance(f, kind)]


def test_there_are_enough_faults_of_each_kind() -> None:
    assert len(FAULTS) >= 100
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
    assert all((SCENES / f"{fault.scene}.yaml").is_file() for fault in FAULTS)


@pytest.mark.parametrize("fault", of(SourceFault))
def test_source_fault_fits_the_source_and_is_still_python(fault: SourceFault) -> None:
    text = patched_text(fault)
    assert text != (Path(reference_rt.__file__).parent / fault.file).read_text(encoding="utf-8")
    compile(text, fault.file, "exec")


def test_source_fault_whose_text_is_gone_is_told() -> None:
    with pytest.raises(StaleFaultError, match=r"occurs 0 times in core/ray.py"):
        patched_text(SourceFault("gone", "cornell_box", "core/ray.py", "no such text", ""))


@pytest.mark.parametrize("name", [f.name for f in of_readers.FAULTS if f.rung not in ("files", "")])
def test_what_no_second_reader_says_is_seen_by_another_rung(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that the rung `files` sees are in its own test."""
    fault = SOURCE_FAULTS[name]

    def statuses() -> list[str]:
        subject = Subject(Scene.load(SCENES / f"{fault.scene}.yaml"))
        evidence = gather(subject, BUDGET, lambda step: None, 1, (fault.rung,))
        return [rung.status for rung in evidence.rungs if rung.name == fault.rung]

    assert statuses() == ["agree"]
    plant(monkeypatch, fault)
    assert statuses() == ["differ"]


@pytest.mark.parametrize(
    "name", [f.name for f in of_media.FAULTS if isinstance(f, SourceFault) and f.file == PHASE]
)
def test_a_fault_of_phase_functions_is_seen_by_its_rung(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rung names the phase function: it is no flight that differs."""
    fault = SOURCE_FAULTS[name]

    def found() -> RungResult:
        subject = Subject(Scene.load(SCENES / f"{fault.scene}.yaml"))
        evidence = gather(subject, BUDGET, lambda step: None, 1, (fault.rung,))
        return next(rung for rung in evidence.rungs if rung.name == fault.rung)

    assert found().status == "agree"
    plant(monkeypatch, fault)
    assert found().status == "differ"
    assert "phase function" in found().reason


@pytest.mark.parametrize("fault", of(SceneFault))
def test_scene_fault_makes_another_valid_scene(fault: SceneFault) -> None:
    scene = Scene.load(SCENES / f"{fault.scene}.yaml")
    faulty = fault.change(scene)
    assert faulty.digest() != scene.digest()
    Scene.parse(faulty.to_json(), folder=scene.folder)


@pytest.mark.parametrize("fault", of(PictureFault))
def test_picture_fault_changes_pictures_and_leaves_the_right_ones(fault: PictureFault) -> None:
    pictures = np.random.default_rng(0).gamma(2.0, 0.4, (4, 48, 48, 3))
    kept = pictures.copy()
    changed = fault.change(pictures)
    assert changed.shape == pictures.shape
    assert not np.array_equal(changed, pictures)
    assert np.array_equal(pictures, kept)


def test_finding_names_the_first_rung_that_broke() -> None:
    rungs = (
        RungResult("geometry", "agree", ""),
        RungResult("direct", "differ", "told", {"rays": 1000, "unexplained": 12}),
        RungResult("images", "differ", "later"),
    )
    case = Case("scene", "differ", "direct: told", rungs, None, {})
    found = finding(SceneFault("f", "scene", lambda scene: scene), "smoke", case)
    assert (found.caught, found.rung, found.strength) == (True, "direct", "12 of 1,000 values")
    assert found.kind == "scene"


def test_too_much_noise_is_not_a_catch() -> None:
    rungs = (RungResult("statistics", "inconclusive", "too noisy"),)
    case = Case("scene", "inconclusive", "statistics: too noisy", rungs, None, {})
    assert not finding(PictureFault("f", "scene", np.zeros_like), "smoke", case).caught


def outcome(missed_by_standard: bool = False, alarms: int = 0) -> Outcome:
    def one(suite: str, number: int, caught: bool) -> Finding:
        return Finding(f"f{number}", "scene", "s", suite, "differ", caught, "direct", "much", "")

    findings = [one("standard", k, not (missed_by_standard and k == 3)) for k in range(20)]
    findings += [one("smoke", k, k >= 1) for k in range(20)]
    return Outcome(findings, [], [], [Alarms("kind", "name", True, 1000, alarms, {}, {}, 0.003)])


def test_what_holds() -> None:
    assert outcome().holds
    assert outcome(alarms=1).holds
    assert not outcome(alarms=5).holds
    assert not outcome(missed_by_standard=True).holds
    assert "**missed**" in markdown(outcome())
