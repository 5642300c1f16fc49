"""The estimate of a picture's noise, against samples whose noise is known."""

import math

import numpy as np
import pytest

from reference_rt.rendering.noise import COLUMNS, PASSES, relative_error, statistics


def estimate(samples, ends, chunk=64):
    """The relative error by passes that end at these numbers of samples (n, pixels, 3)."""
    pixels = samples.shape[1]
    found = np.zeros((-(-pixels // chunk), COLUMNS))
    total, begin = np.zeros((pixels, 3)), 0
    for end in ends:
        before = total
        total = total + samples[begin:end].sum(axis=0)
        one = statistics(before, total, end - begin, chunk)
        one[:, : PASSES + 1] += found[:, : PASSES + 1]
        found, begin = one, end
    return relative_error(found, np.full(len(found), ends[-1]), pixels)


@pytest.mark.parametrize("pixels", [1000, 4096])
@pytest.mark.parametrize("ends", [(16, 32), (16, 32, 48, 64, 80), (3, 50, 51, 200)])
def test_independent_samples(ends, pixels):
    """Pixels of means 1 to 3 and variances 0.5 to 8, as an exponential law has them, times 2."""
    rng = np.random.default_rng(1)
    scale = rng.uniform(0.5, 2.0, (pixels, 3))
    samples = scale * rng.exponential(1.0, (ends[-1], pixels, 3))
    true = math.sqrt(np.square(scale).mean() / ends[-1]) / scale.mean()
    # Each of 3 * pixels estimates of a variance has a relative spread of at most 2 (one degree of
    # freedom, and the law's kurtosis of 6 over samples); a root halves it; four standard errors.
    assert estimate(samples, ends) == pytest.approx(
        true, rel=4 * 0.5 * 2 * 1.5 / math.sqrt(3 * pixels)
    )


def test_one_pass_has_no_estimate():
    assert estimate(np.ones((16, 100, 3)), (16,)) is None


def test_pictures_without_noise_and_without_light():
    samples = np.full((64, 100, 3), 0.1)
    # Sums round by 2^-53 of themselves, whose squares are 1e-16 of the picture's: a root of it.
    assert estimate(samples, (16, 32, 64)) < 1e-7
    assert estimate(0.0 * samples, (16, 32)) == math.inf


def test_infinite_radiance():
    samples = np.ones((32, 100, 3))
    samples[5, 7] = math.inf
    assert estimate(samples, (16, 32)) == math.inf
