"""The option of the gate that leaves the rim out."""

import numpy as np
import pytest

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.gate.gate import gate_pictures
from comparisons.gate.pictures_in import Picture
from comparisons.gate.question import Question
from comparisons.gate.reference import Reference
from comparisons.gate.rim import question_without_rim, without_rim
from comparisons.results.case import FloatArray
from reference_rt.util.errors import UsageError


def noisy(seed: int, count: int) -> FloatArray:
    y, x = np.mgrid[0:48, 0:64] / 32.0
    mean = (0.5 + 0.2 * np.sin(3.0 * x) * y)[..., None] * np.array([1.0, 0.8, 0.6])
    noise = np.random.default_rng(seed).normal(size=(count, *mean.shape))
    return np.asarray(mean * (1.0 + 0.02 * noise))


def candidates(rim: float) -> list[Picture]:
    pictures = noisy(1, 8)
    inner = pictures[:, 3:-3, 3:-3].copy()
    pictures *= rim
    pictures[:, 3:-3, 3:-3] = inner
    return [Picture(picture, np.ones((48, 64))) for picture in pictures]


@pytest.mark.slow
def test_a_rim_by_another_convention_is_named_and_can_be_left_out() -> None:
    reference = Reference(noisy(0, 16))
    case = gate_pictures(candidates(0.8), reference)
    assert case.verdict == "differ"
    assert case.cause is not None
    assert case.cause.name == "filter at the picture's border"
    assert "within 3 px of the border" in case.cause.evidence
    assert "--rim" in case.cause.evidence
    for rim, verdict in ((2, "differ"), (3, "agree"), (5, "agree")):
        case = gate_pictures(candidates(0.8), reference, Question(rim=rim))
        assert case.verdict == verdict, case.reason
        assert any(f"outermost {rim} pixels on each side are left out" in n for n in case.notes)
    assert gate_pictures(candidates(1.0), reference).verdict == "agree"


def test_all_that_has_pixels_is_cropped() -> None:
    pictures = noisy(0, 1)
    reference = Reference(pictures, pictures[0] ** 2)
    lights = {"lamp": pictures[0]}
    cropped, judge = without_rim(candidates(1.0), reference, 4)
    inside = question_without_rim(Question(lights=lambda: lights, rim=4))
    inner = pictures[:, 4:-4, 4:-4]
    assert cropped[0].radiance.shape == (40, 56, 3)
    assert cropped[0].opacity is not None
    assert cropped[0].opacity.shape == (40, 56)
    np.testing.assert_array_equal(judge.pictures, inner)
    np.testing.assert_array_equal(np.asarray(judge.variance), inner[0] ** 2)
    assert inside.lights is not None
    np.testing.assert_array_equal(inside.lights()["lamp"], inner[0])
    without = question_without_rim(Question(rim=4))
    assert (without.lights, without.lengths, without.edges) == (None, None, None)


@pytest.mark.parametrize("rim", [-1, 24, 100])
def test_a_rim_that_leaves_nothing(rim: int) -> None:
    with pytest.raises(UsageError, match="less than half of the shorter side"):
        gate_pictures(candidates(1.0), Reference(noisy(0, 16)), Question(rim=rim))


def test_hypotheses_lose_the_rim_of_all_that_they_say() -> None:
    picture = noisy(2, 1)[0]
    whole = Hypothesis("any", "any", "", picture, 0, noise=picture**2)
    question = question_without_rim(Question(rim=2, lengths=lambda reference: [whole]))
    assert question.lengths is not None
    (found,) = question.lengths(picture[2:-2, 2:-2])
    assert np.array_equal(found.picture, picture[2:-2, 2:-2])
    assert found.noise is not None
    assert np.array_equal(found.noise, found.picture**2)
