"""The metrics against values worked out by hand."""

import math
import os

import numpy as np
import pytest

from comparisons.results.case import Images
from comparisons.statistics.metrics import (
    encode,
    flip_exposures,
    flip_map,
    has_flip,
    image_metrics,
    white_level,
)

NEEDS_FLIP = pytest.mark.skipif(not has_flip(), reason="flip-evaluator has no wheel here")


@pytest.fixture
def picture():
    return np.random.default_rng(1).uniform(0.1, 1.0, (24, 32, 3))


def test_equal_pictures(picture):
    metrics = image_metrics(Images(picture, picture.copy()))
    assert metrics.ssim == pytest.approx(1.0, abs=1e-12)
    assert metrics.psnr == math.inf
    assert (metrics.rmse, metrics.relmse, metrics.mean_bias) == (0.0, 0.0, (0.0, 0.0, 0.0))
    assert metrics.nonfinite == 0


def test_constant_pictures_in_closed_form():
    metrics = image_metrics(Images(np.full((8, 8, 3), 1.5), np.full((8, 8, 3), 2.0)))
    assert metrics.rmse == pytest.approx(0.5)
    assert metrics.relmse == pytest.approx(0.25 / (4.0 + 0.01 * 4.0))
    assert metrics.mean_bias == pytest.approx((-0.25, -0.25, -0.25))
    # White is 2, so the candidate is encoded as sRGB(0.75) and the reference as 1.
    encoded = 1.055 * 0.75 ** (1 / 2.4) - 0.055
    assert metrics.psnr == pytest.approx(-20.0 * math.log10(1.0 - encoded))
    # Without variance SSIM is its luminance term, with C1 = (0.01 * data_range)^2.
    expected = (2.0 * encoded + 1e-4) / (encoded**2 + 1.0 + 1e-4)
    assert metrics.ssim == pytest.approx(expected)


def test_bias_is_reported_per_channel(picture):
    metrics = image_metrics(Images(picture * [1.0, 1.02, 0.9], picture))
    assert metrics.mean_bias == pytest.approx((0.0, 0.02, -0.1), abs=1e-12)


@NEEDS_FLIP
@pytest.mark.parametrize("factor", [1e-30, 1e-3, 1e30])
def test_only_rmse_depends_on_exposure(picture, factor):
    candidate = picture * 1.1
    plain, scaled = (
        image_metrics(Images(candidate, picture)),
        image_metrics(Images(candidate * factor, picture * factor)),
    )
    for name in ("ssim", "flip", "psnr", "relmse", "mean_bias"):
        assert getattr(scaled, name) == pytest.approx(getattr(plain, name), rel=1e-9)
    assert scaled.rmse == pytest.approx(plain.rmse * factor)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("side", [0, 1])
def test_a_pixel_that_is_not_finite_spoils_every_number(picture, value, side):
    pair = [picture.copy(), picture.copy()]
    pair[side][3, 4] = value
    pair[side][5, 6, 1] = value
    metrics = image_metrics(Images(*pair))
    assert metrics.nonfinite == 2
    numbers = (
        metrics.ssim,
        metrics.flip,
        metrics.psnr,
        metrics.rmse,
        metrics.relmse,
        *metrics.mean_bias,
    )
    assert all(math.isnan(number) for number in numbers)


def test_a_black_reference():
    black, lit = np.zeros((8, 8, 3)), np.zeros((8, 8, 3))
    assert image_metrics(Images(black, black)).relmse == 0.0
    assert image_metrics(Images(black, black)).mean_bias == (0.0, 0.0, 0.0)
    lit[..., 1] = 1e-6
    metrics = image_metrics(Images(lit, black))
    assert metrics.relmse == math.inf
    assert metrics.mean_bias == (0.0, math.inf, 0.0)


@pytest.mark.parametrize(("side", "defined"), [(1, False), (2, False), (3, True), (6, True)])
def test_ssim_of_small_pictures(side, defined):
    picture = np.random.default_rng(2).uniform(0.1, 1.0, (side, 20, 3))
    metrics = image_metrics(Images(picture, picture))
    assert math.isnan(metrics.ssim) != defined
    assert metrics.rmse == 0.0


def test_structure_is_seen(picture):
    assert image_metrics(Images(np.roll(picture, 1, axis=1), picture)).ssim < 0.5


def test_white_leaves_out_the_empty_frame():
    picture = np.zeros((100, 100, 3))
    picture[0, :, :] = np.linspace(0.01, 1.0, 100)[:, None]
    assert white_level(picture) == pytest.approx(white_level(picture[:1]))
    assert white_level(np.zeros((2, 2, 3))) == 1.0


def test_encoding_is_srgb():
    assert encode(np.array([-1.0, 0.0, 0.004, 0.36, 2.0, 1e300]), 2.0) == pytest.approx(
        [0.0, 0.0, 12.92 * 0.002, 1.055 * 0.18 ** (1 / 2.4) - 0.055, 1.0, 1.0]
    )


@pytest.mark.parametrize(
    ("candidate", "reference", "message"),
    [
        ((4, 4, 3), (4, 5, 3), "differ in shape"),
        ((4, 4), (4, 4), "expected"),
        ((4, 4, 4), (4, 4, 4), "expected"),
        ((0, 4, 3), (0, 4, 3), "expected"),
    ],
)
def test_wrong_shapes(candidate, reference, message):
    with pytest.raises(ValueError, match=message):
        image_metrics(Images(np.ones(candidate), np.ones(reference)))


@NEEDS_FLIP
def test_flip_of_equal_and_of_opposite_pictures(picture):
    assert image_metrics(Images(picture, picture)).flip == 0.0
    black, white = np.zeros((16, 16, 3)), np.ones((16, 16, 3))
    # Black against white is the largest difference there is but for white itself being shown as
    # 0.85, by the tone curve.
    assert image_metrics(Images(black, white)).flip == pytest.approx(0.965, abs=0.01)
    assert image_metrics(Images(white, black)).flip == pytest.approx(0.965, abs=0.01)


@NEEDS_FLIP
def test_flip_grows_with_the_difference(picture):
    errors = [image_metrics(Images(picture * (1.0 + g), picture)).flip for g in (0.01, 0.05, 0.2)]
    assert 0.0 < errors[0] < errors[1] < errors[2] < 1.0


@NEEDS_FLIP
def test_a_bad_candidate_does_not_choose_the_exposures(picture):
    candidate = picture.copy()
    candidate[0, 0] = 1e30
    shown = flip_map(Images(candidate, picture))
    assert shown.shape == (24, 32)
    assert shown[0, 0] > 0.3
    # Away from the bad pixel, farther than the filters reach, nothing is seen.
    assert not shown[14:, 14:].any()


def test_exposures_do_not_run_away_before_a_black_background():
    reference = np.zeros((64, 64, 3))
    reference[:8, :8] = np.linspace(1e-9, 1.0, 64).reshape(8, 8, 1)
    first, last = flip_exposures(reference / white_level(reference))
    x = 0.6 * 2.0**first  # what white is to the tone curve, which FLIP has of 0.6 times radiance
    shown = (2.51 * x**2 + 0.03 * x) / (2.43 * x**2 + 0.59 * x + 0.14)
    assert shown == pytest.approx(0.85)
    assert first <= last <= first + 4.0
    reference[:8, :8] *= 1e-12
    reference[0, 0] = 1.0
    assert flip_exposures(reference)[1] == first + 4.0
    assert flip_exposures(np.zeros((2, 2, 3))) == (first, first)
    assert flip_exposures(np.full((2, 2, 3), 4.0)) == (first, first)  # brighter than white


@NEEDS_FLIP
@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 9, 3), (2, 2, 3), (5, 3, 3)])
def test_flip_of_pictures_smaller_than_its_filters(shape):
    ones = np.ones(shape)
    assert image_metrics(Images(ones, ones)).flip == 0.0
    assert image_metrics(Images(0.5 * ones, ones)).flip > 0.1


@NEEDS_FLIP
def test_flip_map_marks_pixels_that_are_not_finite(picture):
    candidate = picture.copy()
    candidate[3, 4, 1] = np.nan
    shown = flip_map(Images(candidate, picture))
    assert np.isnan(shown[3, 4])
    assert np.count_nonzero(np.isnan(shown)) == 1


def test_the_process_keeps_its_environment(picture, monkeypatch):
    monkeypatch.setenv("OMP_WAIT_POLICY", "active")
    image_metrics(Images(picture, picture))
    assert os.environ["OMP_WAIT_POLICY"] == "active"
