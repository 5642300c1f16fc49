"""False alarms of the statistics, whatever the law of the noise: at most one case in a thousand."""

import numpy as np
import pytest
from noise import LAWS, filtered, fireflies, known, lognormal, normal, on_and_off, texture
from scipy import stats

from comparisons.statistics import Margins, compare
from comparisons.statistics.decide import findings

COUNTS = [(4, 4), (8, 8), (16, 16), (32, 32), (4, 32), (32, 8), (16, 12)]


def differs(candidate, reference):
    """Whether anything is said to be wrong, at any scale."""
    found = findings(candidate, reference, 16, Margins())
    spread = found.uniformity
    return any(test.differs.any() for test in found.tests.values()) or (
        spread is not None and (spread.wide or spread.narrow)
    )


def alarms_of(law, counts, cases, side=32):
    alarms = 0
    for seed in range(cases):
        rng = np.random.default_rng([seed, *counts])
        alarms += differs(law(rng, counts[0], side), law(rng, counts[1], side))
    return alarms


@pytest.mark.cases(3)
@pytest.mark.parametrize("counts", [(4, 4), (8, 8), (16, 16), (4, 16), (16, 8)])
@pytest.mark.parametrize("law", LAWS)
def test_false_alarms(law, counts):
    """A level of 1e-2 would show: forty laws and counts, forty cases each."""
    assert alarms_of(LAWS[law], counts, 40, side=16 if max(counts) < 16 else 24) <= 1


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_false_alarms_of_many_cases(law):
    """Of all numbers of replicates together: a rate of 1e-2 is missed in 2 % of runs."""
    cases = 150
    alarms = sum(alarms_of(LAWS[law], counts, cases) for counts in COUNTS)
    assert alarms <= stats.binom.isf(0.01, cases * len(COUNTS), 1e-3)


@pytest.mark.slow
def test_false_alarms_of_the_smoke_suite():
    """A thousand seeds of a verdict, not only of its tests: no picture that is right differs."""
    statuses = []
    for seed in range(1000):
        rng = np.random.default_rng(seed)
        statuses.append(compare(*(fireflies(rng, 16, 48) for _ in range(2))).status)
    assert statuses.count("differ") + statuses.count("invalid") <= 1


@pytest.mark.cases(2)
@pytest.mark.parametrize("law", [normal, lognormal, fireflies, on_and_off, texture])
def test_false_alarms_of_a_single_picture(law):
    alarms = 0
    for seed in range(25):
        rng = np.random.default_rng(seed)
        alarms += differs(law(rng, 1), law(rng, 16))
        alarms += differs(law(rng, 16), law(rng, 1))
        alarms += differs(law(rng, 1), law(rng, 1))
    assert alarms == 0


@pytest.mark.cases(4)
@pytest.mark.parametrize("cases", [15, pytest.param(250, marks=pytest.mark.slow)])
@pytest.mark.parametrize("make", [normal, lognormal, fireflies, on_and_off, texture, filtered])
def test_false_alarms_against_a_known_mean(make, cases):
    """And of a single picture against few."""
    alarms = 0
    for seed in range(cases):
        rng = np.random.default_rng(seed)
        many = make(rng, 64)
        alarms += sum(differs(make(rng, count), known(many)) for count in (1, 4, 16))
        alarms += differs(make(rng, 1), many[:16])
    assert alarms <= stats.binom.isf(0.01, 4 * cases, 1e-3)


PRECISE = [(8, 4, 64), (32, 16, 16), (64, 16, 16), (64, 4, 64)]
"""Replicates of the candidate; pictures of the reference; of how many replicates each is the
mean."""


@pytest.mark.cases(3)
@pytest.mark.parametrize("cases", [10, pytest.param(125, marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", LAWS)
def test_false_alarms_against_a_precise_reference(law, cases):
    """A gate's: its pictures are fewer than the candidate's, but have more samples."""
    alarms, make = 0, LAWS[law]
    for many, few, each in PRECISE:
        for seed in range(cases):
            rng = np.random.default_rng([seed, many, few, each])
            reference = np.stack([make(rng, each, 16).mean(axis=0) for _ in range(few)])
            candidate = make(rng, many, 16)
            alarms += differs(candidate, reference) + differs(reference, candidate)
    assert alarms <= stats.binom.isf(0.01, 2 * cases * len(PRECISE), 1e-3)


def test_pixels_of_two_values_that_part_by_chance():
    """Four heads against four tails happen somewhere in any picture; two rows of them do not."""
    rng = np.random.default_rng(0)
    dim = 0.01 * rng.random((8, 48, 48, 3))
    coin = dim.copy()
    coin[:4, 14, 14] = 1.0
    coin[:4, 30, 30] = 1e5  # beside which its neighbours' noise is nothing
    assert not findings(coin[:4], coin[4:], 16, Margins()).tests["pixels"].differs.any()
    rows = dim.copy()
    rows[:4, 20:22] = 1.0
    differing = findings(rows[:4], rows[4:], 16, Margins()).tests["pixels"].differs
    assert differing[20:22].all()
    assert differing.sum() == 2 * 48 * 3
