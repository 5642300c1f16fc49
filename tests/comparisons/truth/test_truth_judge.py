"""The judge of truth: how seldom it is wrong, and what it sees."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from comparisons.truth.case import Expected, cases
from comparisons.truth.judge import judge, unit_roundoff

LEVEL = 0.02
RUNS = 400

TRUTH = cases()["perspective"].compute().pixels + 0.2
EXPECTED = Expected(TRUTH)


def noise(rng, kind):
    """(height, width, 3), of mean 0."""
    if kind == "white":
        return rng.normal(0.0, 0.05, TRUTH.shape)
    if kind == "filtered":
        return gaussian_filter(rng.normal(0.0, 0.2, TRUTH.shape), (1.0, 1.0, 0.0))
    return (rng.poisson(20.0 * TRUTH) / 20.0 - TRUTH) * (TRUTH > 0.25)  # no noise elsewhere


@pytest.mark.parametrize(
    ("kind", "count"), [("white", 1), ("white", 4), ("filtered", 4), ("rare", 1), ("rare", 4)]
)
def test_false_alarms(kind, count):
    """400 runs at a level of 2 % have 8 alarms at most on average: 20 or more with a chance of
    3e-4."""
    rng = np.random.default_rng(11)
    alarms = sum(
        judge(EXPECTED, [TRUTH + noise(rng, kind) for _ in range(count)], LEVEL).verdict == "off"
        for _ in range(RUNS)
    )
    assert alarms < 20


@pytest.mark.parametrize("count", [1, 4])
def test_a_gain_and_a_single_tile_are_seen(count):
    """White noise of 0.05 in 1024 pixels: 2 % of 0.3 is 4 standard errors of a single picture's
    mean times the gain's share, and 10 with more; a tile's 64 pixels know 0.05 to 0.006."""
    rng = np.random.default_rng(12)
    spot = np.zeros_like(TRUTH)
    spot[8:16, 8:16, 1] = 0.08
    for fault in (0.06 * TRUTH, spot):
        found = [TRUTH + fault + noise(rng, "white") for _ in range(count)]
        assert judge(EXPECTED, found).verdict == "off"


def test_exact_pictures_are_judged_by_their_rounding():
    """A part in 1e6 is more than double precision explains, and less than single precision does."""
    assert judge(EXPECTED, [TRUTH * (1.0 + 1e-6)] * 2).verdict == "off"
    assert judge(EXPECTED, [(TRUTH * (1.0 + 1e-6)).astype(np.float32)] * 2).verdict == "right"
    assert judge(EXPECTED, [(TRUTH * 1.001).astype(np.float32)] * 2).verdict == "off"


def test_precision():
    values = np.array([1.0 / 3.0, 2.0 / 3.0])
    assert unit_roundoff(values) == 2.0**-53
    assert unit_roundoff(values.astype(np.float32).astype(float)) == 2.0**-24
    assert unit_roundoff(values.astype(np.float16).astype(float)) == 2.0**-11


def test_much_noise_is_no_verdict():
    rng = np.random.default_rng(13)
    found = [TRUTH + 30.0 * noise(rng, "white") for _ in range(4)]
    assert judge(EXPECTED, found).verdict == "noisy"


def test_a_pixel_that_few_samples_meet_is_no_fault():
    """A corner that covers 1e-5 of a pixel, which none of the samples of a tile met."""
    rng = np.random.default_rng(14)
    truth = TRUTH.copy()
    truth[0, 0] += 1e-5
    found = [TRUTH + noise(rng, "rare") for _ in range(4)]
    assert judge(Expected(truth), found).verdict == "right"
    truth[0, 0] += 1.0  # 80 of the events of 0.05 / 4 that a mean of four pictures has
    assert judge(Expected(truth), found).verdict == "off"
