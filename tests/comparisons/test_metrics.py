"""The metrics against values worked out by hand."""

import math

import numpy as np
import pytest

from comparisons.metrics import encode, image_metrics, white_level


@pytest.fixture
def picture():
    return np.random.default_rng(1).uniform(0.1, 1.0, (24, 32, 3))


def test_equal_pictures(picture):
    metrics = image_metrics(picture, picture.copy())
    assert metrics.ssim == pytest.approx(1.0, abs=1e-12)
    assert metrics.psnr == math.inf
    assert (metrics.rmse, metrics.relmse, metrics.mean_bias) == (0.0, 0.0, (0.0, 0.0, 0.0))
    assert metrics.nonfinite == 0


def test_constant_pictures_in_closed_form():
    metrics = image_metrics(np.full((8, 8, 3), 1.5), np.full((8, 8, 3), 2.0))
    assert metrics.rmse == pytest.approx(0.5)
    assert metrics.relmse == pytest.approx(0.25 / (4.0 + 0.01 * 4.0))
    assert metrics.mean_bias == pytest.approx((-0.25, -0.25, -0.25))
    # White is 2, so ours is encoded as sRGB(0.75) and Mitsuba's as 1.
    encoded = 1.055 * 0.75 ** (1 / 2.4) - 0.055
    assert metrics.psnr == pytest.approx(-20.0 * math.log10(1.0 - encoded))
    # Without variance SSIM is its luminance term, with C1 = (0.01 * data_range)^2.
    expected = (2.0 * encoded + 1e-4) / (encoded**2 + 1.0 + 1e-4)
    assert metrics.ssim == pytest.approx(expected)


def test_bias_is_told_per_channel(picture):
    metrics = image_metrics(picture * [1.0, 1.02, 0.9], picture)
    assert metrics.mean_bias == pytest.approx((0.0, 0.02, -0.1), abs=1e-12)


@pytest.mark.parametrize("factor", [1e-30, 1e-3, 1e30])
def test_only_rmse_depends_on_exposure(picture, factor):
    ours = picture * 1.1
    plain, scaled = image_metrics(ours, picture), image_metrics(ours * factor, picture * factor)
    for name in ("ssim", "psnr", "relmse", "mean_bias"):
        assert getattr(scaled, name) == pytest.approx(getattr(plain, name), rel=1e-9)
    assert scaled.rmse == pytest.approx(plain.rmse * factor)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("side", [0, 1])
def test_a_pixel_that_is_not_finite_spoils_every_number(picture, value, side):
    pair = [picture.copy(), picture.copy()]
    pair[side][3, 4] = value
    pair[side][5, 6, 1] = value
    metrics = image_metrics(*pair)
    assert metrics.nonfinite == 2
    numbers = (metrics.ssim, metrics.psnr, metrics.rmse, metrics.relmse, *metrics.mean_bias)
    assert all(math.isnan(number) for number in numbers)


def test_a_black_reference():
    black, lit = np.zeros((8, 8, 3)), np.zeros((8, 8, 3))
    assert image_metrics(black, black).relmse == 0.0
    assert image_metrics(black, black).mean_bias == (0.0, 0.0, 0.0)
    lit[..., 1] = 1e-6
    metrics = image_metrics(lit, black)
    assert metrics.relmse == math.inf
    assert metrics.mean_bias == (0.0, math.inf, 0.0)


@pytest.mark.parametrize(("side", "defined"), [(1, False), (2, False), (3, True), (6, True)])
def test_ssim_of_small_pictures(side, defined):
    picture = np.random.default_rng(2).uniform(0.1, 1.0, (side, 20, 3))
    metrics = image_metrics(picture, picture)
    assert math.isnan(metrics.ssim) != defined
    assert metrics.rmse == 0.0


def test_structure_is_seen(picture):
    assert image_metrics(np.roll(picture, 1, axis=1), picture).ssim < 0.5


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
    ("ours", "mitsuba", "message"),
    [
        ((4, 4, 3), (4, 5, 3), "differ in shape"),
        ((4, 4), (4, 4), "expected"),
        ((4, 4, 4), (4, 4, 4), "expected"),
        ((0, 4, 3), (0, 4, 3), "expected"),
    ],
)
def test_wrong_shapes(ours, mitsuba, message):
    with pytest.raises(ValueError, match=message):
        image_metrics(np.ones(ours), np.ones(mitsuba))
