"""The statistics of a single picture and of a known mean."""

import json
import math

import numpy as np
import pytest
from noise import as_wholes, known
from planted import FAULTS, MARGINS, STILL, replicates, scene
from scipy import ndimage

from comparisons.compare.judge import of_replicates
from comparisons.results.case import Images
from comparisons.statistics import Known, compare, standard_error
from comparisons.statistics.decide import findings
from comparisons.statistics.metric_null import noise_alone


def test_a_single_picture_says_what_it_presumes():
    rng = np.random.default_rng(0)
    one, many = replicates(rng, scene(), 1), replicates(rng, scene())
    for result in (compare(one, many), compare(many, one), compare(one, many[:1])):
        assert result.status == "inconclusive"
        assert "with a single picture on a side the noise is estimated" in result.reason
        assert "assuming that the noise of neighbouring blocks is independent" in result.reason
        known = "it takes about" in result.reason
        assert known or "give more replicates" in result.reason
        assert result.numbers["noise_known"] == known == ("the smallest bias" in result.reason)
        assert "such as a contact shadow, is not told from noise" in result.reason
        json.dumps(result.numbers, allow_nan=False)
    assert "single" not in compare(many, many).reason


def test_a_single_picture_of_little_noise_agrees():
    rng = np.random.default_rng(0)
    assert compare(replicates(rng, scene(), 1, 0.01), replicates(rng, scene())).status == "agree"


@pytest.mark.parametrize("law", ["normal", "filtered"])
def test_standard_error_of_a_single_picture_is_right(law):
    """As the spread of the difference over many runs; with noise that is not the same all over."""
    rng = np.random.default_rng(0)
    noise = np.linspace(0.05, 1.0, 64)[:, None, None] * np.ones(3)
    found, differences = [], []
    for _ in range(60):
        a, b = rng.standard_normal((2, 1, 64, 64, 3))
        if law == "filtered":
            a, b = (0.5 * (x + np.roll(x, 1, axis=2)) for x in (a, b))
        image = findings(5.0 + noise * a, 5.0 + noise * b, 16, MARGINS).image
        found.append(image.standard_error)
        differences.append(image.difference)
    ratio = np.mean(found) / np.std(differences)
    assert 0.9 < ratio < 1.25


def test_standard_error_of_a_tile_knows_of_noise_that_blocks_share():
    rng = np.random.default_rng(0)
    found, differences = [], []
    for _ in range(40):
        a, b = rng.standard_normal((2, 1, 64, 64, 3))
        a = sum(np.roll(a, shift, axis=2) for shift in range(4)) / 4.0
        tiles = findings(5.0 + a, 5.0 + 0.01 * b, 16, MARGINS).tests["tiles"]
        found.append(tiles.standard_error)
        differences.append(tiles.difference)
    assert 0.88 < np.sqrt(np.mean(np.square(found))) / np.std(differences) < 1.1


def test_a_firefly_leaves_a_single_picture_few_degrees_of_freedom():
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 1, 64, 64, 3))
    assert np.all(findings(a, b, 16, MARGINS).image.errors[0].dof > 100)
    a[0, 30, 30] = 1e4
    found = findings(a, b, 16, MARGINS)
    assert np.all(found.image.errors[0].dof < 3)
    assert np.all(found.tests["tiles"].errors[0].dof[1, 1] < 3)
    assert np.all(found.tests["tiles"].errors[0].dof[0, 0] > 8)


@pytest.mark.parametrize(
    "fault", ["gain", "one tile", "firefly tile", "lamp", "hue", "tile that keeps the mean"]
)
def test_faults_of_a_single_picture_of_little_noise(fault):
    rng = np.random.default_rng(0)
    candidate = replicates(rng, FAULTS[fault][0], 1, 0.02)
    assert compare(candidate, replicates(rng, scene())).status == "differ"
    assert compare(candidate, known(replicates(rng, scene(), 64))).status == "differ"


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_against_a_known_mean(fault):
    rng = np.random.default_rng(0)
    reference = known(replicates(rng, scene(), 64))
    assert compare(replicates(rng, FAULTS[fault][0]), reference).status == "differ"
    assert compare(replicates(rng, scene()), reference).status == "agree"


def test_a_known_mean_without_certainty_is_inconclusive():
    rng = np.random.default_rng(0)
    candidate = replicates(rng, scene(), noise=0.01)
    loud = Known(scene(), np.where(STILL, 0.0, 0.1) * np.ones(3))
    result = compare(candidate, loud)
    assert result.status == "inconclusive"
    assert standard_error(candidate, loud)[20:].min() == pytest.approx(math.sqrt(0.1), rel=0.01)


@pytest.mark.parametrize("gain", [0.95, 0.98, 0.995, 1.005, 1.02, 1.05])
@pytest.mark.parametrize("channels", [[1, 1, 1], [0, 0, 1]])
def test_a_gain_is_not_noise(gain, channels):
    """The interval is that of the right picture's noise, whatever the gain, and lies around it."""
    rng = np.random.default_rng(0)
    factors = np.where(channels, gain, 1.0)
    right, reference = replicates(rng, scene(), 1, 0.01), replicates(rng, scene(), 16, 0.01)
    before = findings(right, reference, 16, MARGINS).image
    image = findings(right * factors, reference, 16, MARGINS).image
    # Noise grows with the gain, and a gain of several adds its own to the other side's.
    assert np.all(image.half_width < 1.3 * max(gain, 1.0) * before.half_width)
    assert np.all(
        np.abs(image.relative - (factors - 1.0))
        <= max(gain, 1.0) * image.over_scale(before.half_width)
    )
    assert compare(right * factors, reference).status == "differ"


def test_noise_of_the_reference_is_no_gain():
    """Two single pictures of one contrast: regressing one's noise on the other's would hide it."""
    rng = np.random.default_rng(0)
    found, differences = [], []
    for _ in range(60):
        a, b = (replicates(rng, scene(), 1, 0.3) for _ in range(2))
        image = findings(a, b, 16, MARGINS).image
        found.append(image.standard_error)
        differences.append(image.difference)
    # 60 runs know the deviation of the differences within 9 %; three channels are alike.
    assert np.all(np.sqrt(np.mean(np.square(found), axis=0)) > 0.8 * np.std(differences, axis=0))


def test_advice_of_a_single_picture_is_right_or_withheld():
    """Within a factor of 2 of each other over seeds, where it is given; and it can be given."""
    rng = np.random.default_rng(0)
    factors = []
    for _ in range(20):
        a, b = replicates(rng, scene(), 1, 0.1), replicates(rng, scene(), 16, 0.1)
        factors.append(compare(a, b).numbers["samples_factor"])
    given = [factor for factor in factors if factor is not None]
    assert len(given) > 10
    assert max(given) < 2.0 * np.median(given)
    assert min(given) > 0.5 * np.median(given)


@pytest.mark.parametrize("place", [(8, 8), (20, 40), (32, 20)])
def test_a_contact_shadow_in_a_single_picture_asks_for_replicates(place):
    y, x = place
    rng = np.random.default_rng(0)
    wrong = scene()
    wrong[y : y + 8, x : x + 8] *= 0.5
    a, b = replicates(rng, wrong, 1, 0.02), replicates(rng, scene(), 16, 0.02)
    result = compare(a, b)
    assert result.status in ("inconclusive", "differ")
    assert result.numbers["samples_factor"] is None
    if result.status == "inconclusive":
        assert "give more replicates" in result.reason
        assert "the smallest bias" not in result.reason
        assert not result.numbers["noise_known"]


def known_through_a_filter(rng: np.random.Generator, width: float, noise: float = 0.05) -> Known:
    """The mean of a picture whose pixels share samples through a Gaussian, with its variance."""
    kernel = np.zeros((17, 17))
    kernel[8, 8] = 1.0
    kernel = ndimage.gaussian_filter(kernel, width)
    deviation = noise * np.maximum(scene(), 0.01)
    own = deviation * rng.standard_normal(deviation.shape)
    spread = ndimage.gaussian_filter(own, (width, width, 0.0), mode="wrap")
    variance = ndimage.convolve(deviation**2, (kernel**2)[..., None], mode="wrap")
    return Known(scene() + spread, variance)


@pytest.mark.parametrize("runs", [10, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize("width", [0.05, 0.7, 1.5])
def test_a_known_mean_whose_pixels_share_a_filter(width: float, runs: int) -> None:
    """Its variance does not show that the errors of neighbours add."""
    for seed in range(runs):
        rng = np.random.default_rng([seed, 3])
        reference = known_through_a_filter(rng, width)
        candidate = scene() + 0.05 * scene() * rng.standard_normal((8, *scene().shape))
        found = compare(candidate, reference)
        assert found.status in ("agree", "inconclusive"), found.reason
        found = as_wholes(*of_replicates(candidate, reference, {}).resampled)
        assert found.status == "agree", found.reason
        assert width < 0.5 or "share noise, as through a filter" in found.reason


@pytest.mark.parametrize("channels", [1, 3])
def test_noise_of_hues_against_a_known_mean(channels: int) -> None:
    """FLIP is what noise alone makes it, whether the channels of a pixel err together or not: of a
    picture it scatters by 2.3 %, so that the mean of eight is within five times 0.8 %."""
    noise, found = 0.05 * np.maximum(scene(), 0.01), []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        errors = rng.standard_normal((9, *noise.shape[:2], channels))
        candidate = scene() + noise * errors[:8]
        mean = scene() + noise * errors[8]
        sides = candidate, np.stack([mean + noise, mean - noise])
        flip = [each[1] for each in noise_alone(Images(candidate.mean(axis=0), mean), sides)]
        found.append(flip[0] / flip[1])
    assert np.mean(found) == pytest.approx(1.0, abs=0.04)
