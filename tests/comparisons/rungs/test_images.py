"""The images rung: which differences it takes for noise, and which it does not."""

import numpy as np
import pytest
from noise import as_wholes as judged
from scipy import ndimage

from comparisons.results.case import FloatArray, Images, RungResult
from comparisons.rungs import images
from comparisons.rungs.images import images_rung
from comparisons.statistics import metrics
from comparisons.statistics.metric_null import noise_ratio
from comparisons.statistics.metrics import image_metrics

GATES = ("ssim", "flip", "psnr", "relative_rmse", "relmse", "bias")


def replicates(seed: int, picture: FloatArray, noise: float = 0.05, count: int = 16) -> FloatArray:
    """Noisy pictures; the left quarter is a background without any noise."""
    rng = np.random.default_rng(seed)
    sigma = np.where(np.arange(picture.shape[1]) < picture.shape[1] // 4, 0.0, noise)
    return picture * (1.0 + sigma[:, None] * rng.normal(size=(count, *picture.shape)))


@pytest.fixture
def picture() -> FloatArray:
    y, x = np.mgrid[0:48, 0:64] / 48.0
    image = np.ones((48, 64, 3)) * (0.5 + 0.3 * np.sin(9.0 * x * y))[..., None]
    image[:, 32:] *= 0.3
    return image


def judged_alone(candidate: FloatArray, reference: FloatArray) -> RungResult:
    pair = Images(candidate, reference)
    return images_rung(pair, image_metrics(pair), None)


def test_noise_alone_has_ratio_one(picture: FloatArray) -> None:
    ratios = [
        noise_ratio(replicates(2 * k, picture), replicates(2 * k + 1, picture)) for k in range(20)
    ]
    # 9 noisy tiles of 768 numbers each: the standard error is about sqrt(2 / 6912) a ratio, and
    # the mean of 20 lies within 5 of its own, 5 sqrt(2 / 6912 / 20) = 0.019, but for the bias
    # 2 / 30 / 768 of a ratio of two chi-squares.
    assert np.mean([r for r, _ in ratios]) == pytest.approx(1.0, abs=0.02)
    # Of 20 the largest deviation is below 5 standard errors but once in 10^5 runs.
    assert all(abs(r - 1.0) < 5.0 * s + 0.02 for r, s in ratios)


@pytest.mark.parametrize("off", [1.0, 1.3])
def test_without_flip_the_others_judge(
    monkeypatch: pytest.MonkeyPatch, picture: FloatArray, off: float
) -> None:
    """Its package has no wheels for some versions of Python."""
    for module in (metrics, images):
        monkeypatch.setattr(module, "has_flip", lambda: False)
    found = judged(off * replicates(1, picture), replicates(2, picture))
    assert found.status == ("agree" if off == 1.0 else "differ")
    assert found.numbers["flip"]["value"] is None
    assert "nan" not in found.reason
    if off == 1.0:
        assert found.reason.endswith("FLIP is left out: flip-evaluator is not installed")


def skewed(rng: np.random.Generator, picture: FloatArray, count: int) -> FloatArray:
    """Noise with a tail: one pixel in 500 is some 20 times too bright."""
    shape = (count, *picture.shape[:2], 1)
    spikes = (rng.random(shape) < 0.002) * rng.exponential(20.0, size=shape)
    return picture * (1.0 + 0.05 * rng.normal(size=(count, *picture.shape)) + spikes)


def shared(rng: np.random.Generator, picture: FloatArray, count: int) -> FloatArray:
    """Noise that neighbours share, as through a wide filter."""
    noise = ndimage.gaussian_filter(rng.normal(size=(count, *picture.shape)), (0, 1, 1, 0))
    return picture * (1.0 + 0.1 * noise / noise.std())


def gaussian(rng: np.random.Generator, picture: FloatArray, count: int) -> FloatArray:
    return picture * (1.0 + 0.1 * rng.normal(size=(count, *picture.shape)))


@pytest.mark.cases(1)
@pytest.mark.parametrize("noise", [gaussian, skewed, shared])
@pytest.mark.parametrize("counts", [(2, 2), (4, 4), (5, 16), (16, 16)])
def test_noise_alone_agrees(picture, noise, counts) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        result = judged(noise(rng, picture, counts[0]), noise(rng, picture, counts[1]))
        assert result.status == "agree", result.reason


@pytest.mark.slow
@pytest.mark.parametrize("noise", [gaussian, skewed, shared])
@pytest.mark.parametrize("count", [4, 16])
def test_noise_alone_agrees_often(picture, noise, count) -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        result = judged(noise(rng, picture, count), noise(rng, picture, count))
        assert result.status == "agree", result.reason


@pytest.mark.cases(1)
@pytest.mark.parametrize("size", [48, 128])
@pytest.mark.parametrize("met", [1, 2, 3, 4])
@pytest.mark.parametrize("side", [0, 1])
def test_a_lamp_that_few_samples_met_agrees(size: int, met: int, side: int) -> None:
    """In one pixel, in some replicates of one side: in some of the draws they cancel, so that the
    noise seems to be none, and a mean over the picture to be many times that."""
    rng, picture = np.random.default_rng(5), np.full((size, size, 3), 0.5)
    sides = [gaussian(rng, picture, 8) for _ in range(2)]
    for _ in range(4):
        lit = [x.copy() for x in sides]
        lit[side][rng.permutation(8)[:met], 40, 31] += 3e3
        result = judged(*lit)
        assert result.status == "agree", result.reason


@pytest.mark.parametrize("count", [4, 5, 8])
@pytest.mark.parametrize("size", [4, 16, 48])
@pytest.mark.parametrize("met", [1, 2])
def test_a_lamp_that_few_samples_met_in_the_dark(size: int, count: int, met: int) -> None:
    """All other pixels have no noise, so that most differences of replicates vanish, and the factor
    by which their squares may scatter is infinite."""
    rng = np.random.default_rng(7)
    for _ in range(4):
        sides = np.zeros((2, count, size, size, 3))
        for side in sides:
            for k in rng.permutation(count)[:met]:
                side[(k, *rng.integers(size, size=2))] = 0.5 + rng.random(3)
        result = judged(*sides)
        assert result.status in ("agree", "inconclusive"), result.reason


@pytest.mark.slow
def test_what_noise_gives_is_what_is_found(picture: FloatArray) -> None:
    """The expectation, given the noise, is that of new pictures: within its own scatter."""
    rng = np.random.default_rng(2)
    found = {name: [] for name in GATES[:-1]}
    for _ in range(12):
        # The sides have noise of different strength, and are of different number.
        result = judged(gaussian(rng, picture, 6), gaussian(rng, picture, 16))
        for name, values in found.items():
            gate = result.numbers[name]
            values.append(
                (gate["value"] - gate["by_noise"]) / (gate["threshold"] - gate["by_noise"])
            )
    for name, values in found.items():
        assert abs(np.mean(values)) < 0.1, name
        assert max(np.abs(values)) < 0.5, name


@pytest.mark.parametrize("fault", ["gain", "shift", "background", "blur", "noise too little"])
def test_faults_are_seen(picture: FloatArray, fault: str) -> None:
    wrong = picture.copy()
    if fault == "gain":
        wrong *= 1.02
    elif fault == "shift":
        wrong = np.roll(wrong, 1, axis=1)
    elif fault == "background":
        wrong[:, :16] *= 1.0015
    elif fault == "blur":
        wrong = ndimage.gaussian_filter(wrong, (1.0, 1.0, 0.0))
    candidate, reference = replicates(0, picture), replicates(1, wrong)
    if fault == "noise too little":  # of the replicates, that hang together
        candidate = 0.5 * candidate + 0.5 * candidate[:1]
    assert judged(candidate, reference).status == "differ"


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", GATES)
def test_each_metric_has_a_threshold_that_some_fault_passes(picture, name) -> None:
    clean, noisy = (
        judged_alone(picture * 1.3, picture),
        judged(replicates(0, picture * 1.3), replicates(1, picture)),
    )
    expected_to_fail = {"ssim"} ^ set(GATES)
    for result in (clean, noisy):
        gate = result.numbers[name]
        assert set(gate) == {"value", "by_noise", "threshold", "passed"}
        if name in expected_to_fail:
            assert not gate["passed"]
    # A gain is no matter of structure, but a shift is.
    shifted = judged(replicates(0, np.roll(picture, 1, axis=0)), replicates(1, picture))
    assert not shifted.numbers["ssim"]["passed"]


def test_few_replicates_leave_the_metrics_unjudged(picture: FloatArray) -> None:
    result = judged(replicates(0, picture, count=3), replicates(1, picture, count=3))
    assert result.status == "agree"
    assert result.numbers["flip"]["threshold"] is None
    assert result.numbers["difference_over_noise"] == pytest.approx(1.0, abs=0.1)


def test_a_reference_that_is_known(picture: FloatArray) -> None:
    """Its mean with its standard error added and taken away stands for two replicates."""
    deviation = 0.01 * picture
    known = np.stack([picture + deviation, picture - deviation])
    rng = np.random.default_rng(3)
    for _ in range(5):
        middle = picture + deviation * rng.normal(size=picture.shape)
        known = np.stack([middle + deviation, middle - deviation])
        result = judged(gaussian(rng, picture, 8), known)
        assert result.status == "agree", result.reason
        assert result.numbers["flip"]["threshold"] is not None
    assert judged(gaussian(rng, 1.03 * picture, 8), known).status == "differ"


def test_equal_pictures_agree_and_nan_is_invalid(picture: FloatArray) -> None:
    same = np.repeat(picture[None], 4, axis=0)
    assert judged(same, same).status == "agree"
    assert judged_alone(picture, picture).status == "agree"
    broken = picture.copy()
    broken[3, 4, 1] = np.nan
    assert judged_alone(broken, picture).status == "invalid"


def test_pictures_without_noise_must_be_alike(picture: FloatArray) -> None:
    assert judged_alone(picture, picture * (1.0 + 1e-7)).status == "agree"
    assert judged_alone(picture, np.roll(picture, 1, axis=1)).status == "differ"
    for gain in (0.995, 1.005):
        assert judged_alone(gain * picture, picture).status == "differ"


@pytest.mark.parametrize("shape", [(1, 1, 3), (2, 5, 3), (7, 3, 3)])
def test_small_pictures(shape) -> None:
    rng = np.random.default_rng(4)
    picture = rng.uniform(0.1, 1.0, shape)
    assert judged_alone(picture, picture * (1.0 + 1e-7)).status == "agree"
    assert judged_alone(1.1 * picture, picture).status == "differ"
    sides = (picture * (1.0 + 0.1 * rng.normal(size=(8, *shape))) for _ in range(2))
    assert judged(*sides).status == "agree"


def test_black_reference() -> None:
    black = np.zeros((8, 8, 3))
    assert judged_alone(black, black).status == "agree"
    result = judged_alone(black + 0.5, black)
    assert result.status == "differ"
    assert result.numbers["bias"]["value"] is None
