"""Pixels with hardly any noise, whose values are stored as floats or half floats."""

import numpy as np
import pytest
from noise import known
from planted import LAMP, STILL, replicates, scene

from comparisons.rungs.input import COMMON
from comparisons.statistics import compare
from comparisons.statistics.metric_null import noise_ratio
from comparisons.statistics.shared_noise import common_noise

SIDE = 48


def halves(values):
    return np.asarray(values).astype(np.float16).astype(np.float64)


def singles(values):
    return np.asarray(values).astype(np.float32).astype(np.float64)


def coarse(values):
    """Halves whose rounding has one sign: the worst that a format with 11 bits can do."""
    return np.asarray(values) * (1.0 - 2.0**-11)


STORED = [singles, halves, coarse]


def sky(radiance=1.0):
    """(48, 48, 3): a smooth sky."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    shade = 0.3 + y + 0.2 * np.sin(3.0 * x)
    return radiance * shade[..., None] * np.array([0.7, 0.9, 1.3])


def pictures(rng, mean, noise, count):
    return mean * (1.0 + noise * rng.standard_normal((count, *mean.shape)))


@pytest.mark.cases(5)
@pytest.mark.parametrize("counts", [(1, 16), (2, 2), (4, 16), (16, 16)])
@pytest.mark.parametrize("noise", [0.0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("stored", STORED)
def test_texels_may_be_stored_as_floats_of_any_kind(stored, noise, counts):
    for radiance in (1e-3, 1.0, 37.3):
        rng = np.random.default_rng(0)
        texels = stored(sky(radiance) / radiance) * radiance
        candidate = pictures(rng, texels, noise, counts[0])
        reference = pictures(rng, sky(radiance), noise, counts[1])
        for pair in ((candidate, reference), (reference, candidate)):
            result = compare(*pair)
            assert result.status in ("agree", "inconclusive"), result.reason


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1e-6, 1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("stored", STORED)
def test_rounding_of_texels_is_no_shared_noise(stored, noise):
    """It is the same in all replicates, independent between pixels, and unlike the picture."""
    for seed in range(40):
        rng = np.random.default_rng(seed)
        texels = stored(sky() * (0.7 + 0.01 * seed))
        candidate = pictures(rng, texels, noise, 16)
        reference = pictures(rng, sky() * (0.7 + 0.01 * seed), noise, 16)
        for pair in ((candidate, reference), (reference, candidate)):
            share = common_noise(*pair)
            assert share is None or share < COMMON, seed
            assert compare(*pair).status in ("agree", "inconclusive")


@pytest.mark.parametrize("stored", STORED)
def test_files_may_be_stored_as_floats_of_any_kind(stored):
    rng = np.random.default_rng(0)
    dim = scene() * 0.2347  # so that the lamp's radiance is no half float
    a, b = (np.where(STILL, dim, 0.2347 * replicates(rng, scene())) for _ in range(2))
    assert compare(stored(a), b).status == "agree"
    assert compare(stored(a), known(b)).status == "agree"
    ratio, error = noise_ratio(stored(a), b)
    assert ratio - 5.0 * error < 1.25


@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-5])
@pytest.mark.parametrize("factor", [1.0 - 2.0**-9, 1.0 + 2.0**-9])
def test_more_than_rounding_differs_in_a_single_pixel(noise, factor):
    rng = np.random.default_rng(0)
    wrong = sky()
    wrong[20, 30] *= factor
    result = compare(pictures(rng, wrong, noise, 16), pictures(rng, sky(), noise, 16))
    assert result.status == "differ"
    assert "1 of 2304 pixels differ" in result.reason


def test_a_dark_pixel_without_noise_has_no_rounding_to_speak_of():
    """Light that leaks into black is compared with the picture, not with the pixel."""
    rng = np.random.default_rng(0)
    leak = scene()
    leak[2, 2] += 2e-5
    assert compare(replicates(rng, leak), replicates(rng, scene())).status == "differ"
    lamp = scene()
    lamp[LAMP] *= 1.0 + 2.0**-12
    assert compare(replicates(rng, lamp), replicates(rng, scene())).status == "agree"
