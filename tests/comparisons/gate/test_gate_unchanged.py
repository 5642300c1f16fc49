"""Pictures that are bit for bit the baseline's: `unchanged`, whole sets, parts of them and mixed
ones."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from gate_checks import files, run, status
from junitparser import JUnitXml

from comparisons.gate.baselines import MOST_KEPT
from comparisons.gate.copies import Copies, fingerprint
from comparisons.gate.gate import gate_pictures
from comparisons.gate.pictures_in import Picture
from comparisons.gate.question import Question
from comparisons.gate.reference import of_files
from comparisons.results.files import sealed
from reference_rt.core.arrays import FloatArray

pytestmark = pytest.mark.usefixtures("gate_folder")


def noisy(count: int, seed: int = 1) -> FloatArray:
    """Replicates of one picture as float32 files hold them."""
    rng = np.random.default_rng(seed)
    values = 1.0 + 0.05 * rng.standard_normal((count, 32, 32, 3))
    return values.astype(np.float32).astype(np.float64)


def accepted(pictures: FloatArray, *more: str) -> list[str]:
    """The files of a new baseline "ball"."""
    names = files(pictures)
    result = invoke("accept", *names, "--name", "ball", "--reason", "seen", *more)
    assert result.exit_code == 0, result.output
    return names


@pytest.mark.cases(3)
@pytest.mark.parametrize("count", [1, 2, 4, MOST_KEPT, MOST_KEPT + 1, 2 * MOST_KEPT, 20])
def test_the_files_that_it_was_made_from(count: int) -> None:
    names = accepted(noisy(count))
    result, found = run(*names, "--baseline", "ball", "--junit", "junit.xml")
    assert result.exit_code == 0, result.output
    assert "ball: unchanged: " in result.stdout
    assert found["cases"][0]["verdict"] == status(found, "images") == "unchanged"
    assert found["cases"][0]["tiers"]["images"]["copies"] == count
    assert JUnitXml.fromfile("junit.xml").failures == 0
    assert '<span aria-hidden="true">=</span> unchanged' in Path("out/report.html").read_text()


@pytest.mark.cases(3)
@pytest.mark.parametrize("chosen", [[3], [5, 2], [7, 6, 5, 4, 3, 2, 1, 0], [11, 0]])
@pytest.mark.parametrize("count", [8, 12])
def test_some_of_the_files_in_any_order(chosen: list[int], count: int) -> None:
    names = accepted(noisy(count))
    given = [names[k % count] for k in chosen]
    result, _ = run(*given, "--baseline", "ball")
    assert (result.exit_code, "unchanged" in result.stdout) == (0, True), result.output


def test_other_files_with_the_same_pixels() -> None:
    """Another format, and another header: neither changes a picture."""
    pictures = noisy(4)
    accepted(pictures)
    np.save("again.npy", pictures)
    result, _ = run("again.npy", "--baseline", "ball")
    assert (result.exit_code, "unchanged" in result.stdout) == (0, True), result.output


def test_a_renderer_without_noise() -> None:
    names = accepted(noisy(1), "--noise-free")
    result, found = run(*names, "--baseline", "ball")
    assert (result.exit_code, found["cases"][0]["verdict"]) == (0, "unchanged"), result.output
    # A baseline whose pictures are all the same one, since no one said that there is no noise.
    names = accepted(np.repeat(noisy(1), 4, axis=0))
    result, found = run(*names, "--baseline", "ball")
    assert (result.exit_code, found["cases"][0]["verdict"]) == (0, "unchanged"), result.output


def test_references_from_files() -> None:
    names = files(noisy(3))
    judges = [word for name in names for word in ("--reference", name)]
    result, _ = run(*names, *judges)
    assert (result.exit_code, "unchanged" in result.stdout) == (0, True), result.output


@pytest.mark.parametrize("change", ["last bit", "gain", "one pixel"])
def test_what_has_changed_is_not_unchanged(change: str) -> None:
    pictures = noisy(4)
    accepted(pictures)
    changed = pictures.copy()
    if change == "last bit":
        changed[2, 5, 5, 1] = np.nextafter(np.float32(changed[2, 5, 5, 1]), np.float32(9.0))
    elif change == "gain":
        changed *= 1.05
    else:
        changed[:, 7, 9] *= 3.0
    _, found = run(*files(changed), "--baseline", "ball")
    assert found["cases"][0]["verdict"] != "unchanged"
    if change == "last bit":
        assert "3 of 4 candidates are copies" in str(found["cases"][0]["notes"])


def test_one_picture_many_times_is_wrong() -> None:
    """A renderer that ignores its seed makes copies of one of the baseline's pictures."""
    pictures = noisy(4)
    accepted(pictures)
    result, found = run(*files(pictures[[0, 0, 0, 0]]), "--baseline", "ball")
    assert found["cases"][0]["verdict"] == "invalid", result.output
    assert "the same bit for bit" in result.output


@pytest.mark.parametrize(("gain", "verdict"), [(1.0, "agree"), (1.05, "differ")])
def test_copies_beside_others_are_left_out(gain: float, verdict: str) -> None:
    pictures = noisy(16)
    accepted(pictures[:8])
    result, found = run(*files(np.concatenate([pictures[:8], gain * pictures[8:]])), "--baseline",
                        "ball")  # fmt: skip
    case = found["cases"][0]
    assert case["verdict"] == verdict, result.output
    assert case["tiers"]["statistics"]["replicates_candidate"] == 8
    assert "8 of 16 candidates are copies of the reference's pictures" in str(case["notes"])


def test_a_baseline_of_a_former_version() -> None:
    """Its sources have no fingerprints: the stored pictures have."""
    names = accepted(noisy(4))
    path = Path("baselines/ball/baseline.json")
    record = json.loads(path.read_text())
    del record["seal"]
    for source in record["sources"]:
        del source["pixels"]
    path.write_text(json.dumps(sealed(record)))
    result, _ = run(*names, "--baseline", "ball")
    assert (result.exit_code, "unchanged" in result.stdout) == (0, True), result.output


def test_fingerprints() -> None:
    picture = noisy(1)[0]
    assert fingerprint(picture) == fingerprint(picture * (1.0 + 1e-9))  # float32 holds no more
    assert fingerprint(0.0 * picture) == fingerprint(-0.0 * picture)
    assert fingerprint(picture) != fingerprint(picture.swapaxes(0, 1))
    assert fingerprint(picture) != fingerprint(np.nextafter(picture.astype("f4"), np.float32(9)))
    assert fingerprint(picture) != fingerprint(picture.reshape(16, 64, 3))
    for size in (1e-200, 1e-42, 1e200):  # which float32 rounds to 0, to few digits, to infinity
        assert fingerprint(size * picture) != fingerprint(1.001 * size * picture)
    assert len(Copies.of(()).others([Picture(picture)])) == 1


@pytest.mark.parametrize("fault", ["shared", "nan", "repeated"])
@pytest.mark.parametrize("gain", [1.0, 1.2])
def test_invalid_does_not_hide_a_bias(fault: str, gain: float) -> None:
    """Both are told; of right pictures only the fault is."""
    pictures = gain * noisy(8)
    if fault == "nan":
        pictures[3, 4, 5, 0] = np.nan
    elif fault == "repeated":
        pictures[1] = pictures[0]
    else:
        pictures[1] = 0.1 * pictures[1] + 0.9 * pictures[2]
    reference = of_files([Picture(p) for p in noisy(8, 2)], None, False)
    case = gate_pictures([Picture(p) for p in pictures], reference, Question(limit=0.02))
    assert case.verdict == "invalid"
    assert case.reason.startswith("input: ")
    assert ("; besides, statistics: the image mean differs: " in case.reason) == (gain > 1.0)
