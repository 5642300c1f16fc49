"""The images rung: what it calls noise, and what it does not."""

import numpy as np
import pytest

from comparisons.metrics import image_metrics
from comparisons.pictures import Rendered, images_tier, noise_ratio
from comparisons.results import Images
from reference_rt.shapes.shape import FloatArray


def replicates(seed: int, picture: FloatArray, noise: float = 0.05, count: int = 16) -> FloatArray:
    """Noisy pictures; the left quarter is a background without any noise."""
    rng = np.random.default_rng(seed)
    sigma = np.where(np.arange(picture.shape[1]) < picture.shape[1] // 4, 0.0, noise)
    return picture * (1.0 + sigma[:, None] * rng.normal(size=(count, *picture.shape)))


@pytest.fixture
def picture() -> FloatArray:
    image = np.ones((48, 64, 3))
    image[:, 32:] = 0.3
    return image


def rendered(ours: FloatArray, mitsuba: FloatArray) -> Rendered:
    return Rendered(Images(ours.mean(axis=0), mitsuba.mean(axis=0)), {}, (ours, mitsuba))


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


@pytest.mark.parametrize("fault", ["gain", "shift", "background"])
def test_faults_are_seen(picture: FloatArray, fault: str) -> None:
    wrong = picture.copy()
    if fault == "gain":
        wrong *= 1.02
    elif fault == "shift":
        wrong = np.roll(wrong, 1, axis=1)
    else:
        wrong[:, :16] *= 1.0001
    ours, theirs = replicates(0, picture), replicates(1, wrong)
    metrics = image_metrics(ours.mean(axis=0), theirs.mean(axis=0))
    assert images_tier(rendered(ours, theirs), metrics).status == "differ"


def test_equal_pictures_agree_and_nan_is_invalid(picture: FloatArray) -> None:
    same = np.repeat(picture[None], 4, axis=0)
    metrics = image_metrics(picture, picture)
    assert images_tier(rendered(same, same), metrics).status == "agree"
    assert images_tier(Rendered(Images(picture, picture), {}), metrics).status == "agree"
    broken = picture.copy()
    broken[3, 4, 1] = np.nan
    metrics = image_metrics(broken, picture)
    assert images_tier(Rendered(Images(broken, picture), {}), metrics).status == "invalid"


def test_pictures_without_noise_must_be_alike(picture: FloatArray) -> None:
    wrong = np.roll(picture, 1, axis=1)
    for other, status in ((picture * (1.0 + 1e-7), "agree"), (wrong, "differ")):
        tier = images_tier(Rendered(Images(picture, other), {}), image_metrics(picture, other))
        assert tier.status == status
