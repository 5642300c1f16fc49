"""The leave-one-out test: the one replicate that is unlike the rest is named, and no right one."""

import numpy as np
import pytest
from planted import scene
from renderers_that_share import RENDERERS
from scipy import stats
from test_statistics_false_alarms import LAWS

from comparisons.results.case import FloatArray
from comparisons.rungs.input import input_rung
from comparisons.statistics.shared_noise import odd_replicate


def noisy(rng: np.random.Generator, mean: FloatArray, count: int, noise: float) -> FloatArray:
    return mean * rng.gamma(noise**-2, noise**2, (count, *mean.shape))


def left_half_brighter() -> FloatArray:
    mean = scene()
    mean[:, :32] *= 1.1
    return mean


FAULTS = {
    "5 % bright": (scene() * 1.05, 0.05, "", ""),
    "5 % dark": (scene() * 0.95, -0.05, "", ""),
    "red 5 % bright": (scene() * [1.05, 1.0, 1.0], 0.05, "", "R"),
    "left half 10 % bright": (left_half_brighter(), 0.1, "in the left half", None),
    "moved by a pixel": (np.roll(scene(), 1, axis=1), None, "along x, as if shifted", None),
}


@pytest.mark.parametrize("noise", [0.1, 0.2])
@pytest.mark.parametrize("count", [8, 16])
@pytest.mark.parametrize("fault", FAULTS)
def test_one_bad_replicate_is_named(fault: str, count: int, noise: float) -> None:
    mean, bias, where, channel = FAULTS[fault]
    for seed in range(4):
        rng = np.random.default_rng([seed, count])
        pictures = noisy(rng, scene(), count, noise)
        pictures[seed] = noisy(rng, mean, 1, noise)[0]
        found = odd_replicate(pictures)
        assert found is not None
        assert found.index == seed
        assert where in (found.where, "")
        assert channel in (found.channel, None)
        if bias is not None and where == found.where:
            # Blocks have noise of 0.2 / 4; the median of 90 is within 5 x 1.25 x 0.05 / 9.5.
            assert found.bias == pytest.approx(bias, abs=0.033)


def test_the_rung_names_the_replicate_and_its_side() -> None:
    rng = np.random.default_rng(0)
    a, b = noisy(rng, scene(), 8, 0.1), noisy(rng, scene(), 16, 0.1)
    assert input_rung(a, b).status == "agree"
    a[3] *= 1.05
    result = input_rung(a, b)
    assert result.status == "invalid"
    assert "replicate 3 of the candidate is unlike the other 7: its median block is +" in (
        result.reason
    )
    result = input_rung(b, a)
    assert result.status == "invalid"
    assert "replicate 3 of the reference is unlike the other 7" in result.reason


def test_too_little_to_tell() -> None:
    rng = np.random.default_rng(0)
    few = noisy(rng, scene(), 5, 0.1)
    few[2] *= 1.5
    assert odd_replicate(few) is None
    small = noisy(rng, scene()[20:36, :16], 8, 0.1)
    small[2] *= 1.5
    assert odd_replicate(small) is None
    assert odd_replicate(np.ones((8, 48, 48, 3))) is None


ALL = {**LAWS, **RENDERERS}


DEAR = ("photon map, radius 20", "64 point lights")
QUICK = [pytest.param(x, marks=pytest.mark.slow) if x in DEAR else x for x in ALL]


@pytest.mark.cases(12)
@pytest.mark.parametrize("name", QUICK)
def test_no_right_replicate_is_odd(name: str) -> None:
    """Heavy tails, and noise that pixels share."""
    for count in (6, 8, 16):
        for seed in range(8):
            assert odd_replicate(ALL[name](np.random.default_rng([seed, count]), count, 32)) is None


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, 8, 16])
@pytest.mark.parametrize("name", ALL)
def test_no_right_replicate_is_odd_in_many_cases(name: str, count: int) -> None:
    cases = 1000
    found = [odd_replicate(ALL[name](np.random.default_rng(k), count, 32)) for k in range(cases)]
    assert sum(x is not None for x in found) <= stats.binom.isf(1e-4, cases, 1e-4)
