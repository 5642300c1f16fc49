"""Noise that pixels share is no fault; noise that replicates share is one, and so is one replicate
that is unlike the rest."""

import numpy as np
import pytest
from noise import LAWS as LAWS_OF_PIXELS
from noise import as_wholes, normal
from planted import scene
from renderers_that_share import RENDERERS, independent
from scipy import stats

from comparisons import statistics
from comparisons.results.case import FloatArray
from comparisons.rungs.input import input_rung
from comparisons.statistics.odd_replicate import odd_replicate
from comparisons.statistics.shared_noise import correlated_pair

UNSEEN = ("1 point light",)
"""All light of a picture comes from one random point: a region that it lights seldom may be dark in
all of eight replicates.  Tiles then differ (4 of 20 runs against independent pixels)."""


def odd_by_chance(name: str, count: int) -> float:
    """The chance that one replicate is unlike all others, which are alike: the rare lamp's has one
    brightness of few, by a Poisson number of mean 1 that all of its pixels share."""
    chances = stats.poisson.pmf(np.arange(20), 1.0) if name == "rare lamp" else np.zeros(1)
    return float(count * (chances ** (count - 1) * (1.0 - chances)).sum())


def wrong_rungs(name: str, seed: int, counts: tuple[int, int], same: bool, side: int) -> list[str]:
    """The rungs by which a right renderer fails, against its own kind or independent pixels."""
    rng = np.random.default_rng([seed, *counts])
    a = RENDERERS[name](rng, counts[0], side)
    b = RENDERERS[name](rng, counts[1], side) if same else independent(name, rng, counts[1], side)
    rungs = [input_rung(a, b)]
    if name not in UNSEEN:
        rungs += [statistics.compare(a, b), as_wholes(a, b)]
    return [f"{r.name}: {r.reason}" for r in rungs if r.status in ("differ", "invalid")]


@pytest.mark.cases(3)
@pytest.mark.parametrize("same", [False, True], ids=["independent reference", "its own kind"])
@pytest.mark.parametrize("name", RENDERERS)
def test_pixels_may_share_random_numbers(name: str, same: bool) -> None:
    found = [
        wrong for counts in ((6, 6), (8, 16)) for wrong in wrong_rungs(name, 0, counts, same, 32)
    ]
    assert not found


@pytest.mark.slow
@pytest.mark.parametrize("name", RENDERERS)
def test_pixels_may_share_random_numbers_in_many_cases(name) -> None:
    cases = [(k, (n, 16), same) for k in range(20) for n in (6, 8, 16) for same in (False, True)]
    alarms = sum(bool(wrong_rungs(name, *case, 32)) for case in cases)
    level = 1e-3 + np.mean([odd_by_chance(name, n) for n in (6, 8, 16)])
    assert alarms <= stats.binom.isf(1e-4, len(cases), level)


def lognormal(rng: np.random.Generator, count: int, side: int) -> FloatArray:
    return np.exp(rng.standard_normal((count, side, side, 1))) * np.ones(3)


def fireflies(rng: np.random.Generator, count: int, side: int) -> FloatArray:
    smooth = 0.5 * rng.gamma(4.0, 0.25, (count, side, side, 3))
    return smooth + (rng.random((count, side, side, 1)) < 1e-3) * 50.0


LAWS = {law.__name__: law for law in (normal, lognormal, fireflies)} | {
    name: RENDERERS[name] for name in ("photon map, radius 1", "box filter of 3")
}


@pytest.mark.parametrize(
    ("law", "count"), [(law, n) for law in LAWS for n in (8, 16) if (law, n) != ("lognormal", 8)]
)
def test_two_replicates_of_overlapping_seeds(law: str, count: int) -> None:
    """The pair that is named is the planted one. Eight lognormal replicates are too few to tell."""
    for seed in range(4):
        pictures = LAWS[law](np.random.default_rng([seed, count]), count, 48)
        assert correlated_pair(pictures) is None
        pictures[5] = 0.5 * pictures[5] + 0.5 * pictures[2]
        found = correlated_pair(pictures)
        assert found is not None
        assert found[:2] == (2, 5)
        assert found[2] > 0.3


@pytest.mark.parametrize("law", LAWS)
def test_a_chain_of_overlapping_seeds(law: str) -> None:
    """Every replicate shares half of its samples with the next one."""
    for seed in range(4):
        pictures = LAWS[law](np.random.default_rng(seed), 17, 48)
        found = correlated_pair(0.5 * (pictures[1:] + pictures[:-1]))
        assert found is not None
        assert found[1] - found[0] == 1


def test_too_few_replicates_or_pixels_to_tell() -> None:
    rng = np.random.default_rng(0)
    for pictures in (normal(rng, 5, 48), normal(rng, 8, 12)):
        pictures[1] = 0.9 * pictures[0] + 0.1 * pictures[1]
        assert correlated_pair(pictures) is None
    assert correlated_pair(np.ones((8, 48, 48, 3))) is None


@pytest.mark.parametrize("count", [6, 8, 12, 16])
@pytest.mark.parametrize("make", [normal, lognormal], ids=["normal", "lognormal"])
def test_two_of_few_replicates_that_share_nearly_all_noise(count, make) -> None:
    """They pull the mean of so few replicates towards themselves."""
    for seed in range(5):
        pictures = make(np.random.default_rng([seed, count]), count, 48)
        pictures[1] = 0.1 * pictures[1] + 0.9 * pictures[4]
        found = correlated_pair(pictures)
        assert found is not None
        assert found[:2] == (1, 4)
        assert correlated_pair(make(np.random.default_rng([seed, count, 1]), count, 48)) is None


# ---- the odd one out -----------------------------------------------------------------------------


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


ALL = {**LAWS_OF_PIXELS, **RENDERERS}
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
@pytest.mark.parametrize("name", ALL)
def test_no_right_replicate_is_odd_in_many_cases(name: str) -> None:
    cases = [(seed, count) for seed in range(150) for count in (6, 8, 16)]
    found = [odd_replicate(ALL[name](np.random.default_rng(case), case[1], 32)) for case in cases]
    level = 1e-4 + np.mean([odd_by_chance(name, n) for n in (6, 8, 16)])
    assert sum(x is not None for x in found) <= stats.binom.isf(1e-4, len(cases), level)
