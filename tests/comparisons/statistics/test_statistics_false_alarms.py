"""False alarms of the statistics, whatever the law of the noise: at most one case in a thousand.

Each law is a function (rng, count, side) that makes `count` pictures (side, side, 3).
"""

import numpy as np
import pytest
from scipy import stats

from comparisons.statistics import Known, Margins, compare
from comparisons.statistics.decide import findings

CHANCES = np.random.default_rng(6).random((64, 64, 3)) ** 6
BRIGHTNESS = 10.0 ** np.random.default_rng(5).uniform(-2.0, 2.0, (64, 64, 1))


def normal(rng, count, side=32):
    return 1.0 + 0.3 * rng.standard_normal((count, side, side, 3))


def lognormal(rng, count, side=32):
    """Sigma 2: skewness 414."""
    return np.exp(2.0 * rng.standard_normal((count, side, side, 3)) - 2.0)


def fireflies(rng, count, side=32):
    """One sample in 1e4 carries half of the energy."""
    smooth = 0.5 * rng.gamma(4.0, 0.25, (count, side, side, 3))
    return smooth + (rng.random((count, side, side, 1)) < 1e-4) * 5000.0


def pareto(rng, count, side=32):
    """Without a variance: the tail's exponent is 1.2."""
    return 0.5 + 0.1 * rng.pareto(1.2, (count, side, side, 3))


def on_and_off(rng, count, side=32):
    """One sample a pixel that meets a light or not, seldom in a quarter of the picture."""
    chance = np.full((side, side, 3), 0.5)
    chance[: side // 2] = 0.05
    chance[: side // 2, : side // 2] = 0.003
    return (rng.random((count, side, side, 3)) < chance).astype(float)


def texture(rng, count, side=32):
    """Two values a pixel, and next to a dark pixel one that is up to 1e4 times as bright."""
    return BRIGHTNESS[:side, :side] * (rng.random((count, side, side, 3)) < CHANCES[:side, :side])


def caustic(rng, count, side=32):
    """Little noise, rare bright paths in a sixteenth of the picture, and a black border."""
    pictures = 0.5 + 0.05 * rng.standard_normal((count, side, side, 3))
    n = side // 4
    bright = (rng.random((count, n, n, 1)) < 0.02) * rng.pareto(1.5, (count, n, n, 1)) * 10.0
    pictures[:, n : 2 * n, n : 2 * n] += bright
    pictures[:, : n // 2] = 0.0
    return pictures


def filtered(rng, count, side=32):
    """Grey noise that a reconstruction filter spreads over neighbours."""
    x = rng.gamma(0.5, 2.0, (count, side + 2, side + 2, 1))
    around = x[:, :-2, 1:-1] + x[:, 2:, 1:-1] + x[:, 1:-1, 2:] + x[:, 1:-1, :-2]
    return (2.0 * x[:, 1:-1, 1:-1] + around) / 6.0 * np.ones(3)


LAWS = {
    law.__name__: law
    for law in (normal, lognormal, fireflies, pareto, on_and_off, texture, caustic, filtered)
}

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
@pytest.mark.parametrize("count", [1, 4, 16])
@pytest.mark.parametrize("law", [normal, lognormal, fireflies, on_and_off, texture])
def test_false_alarms_against_a_known_mean(law, count):
    alarms = 0
    for seed in range(15):
        rng = np.random.default_rng(seed)
        many = law(rng, 64)
        alarms += differs(law(rng, count), Known(many.mean(axis=0), many.var(axis=0, ddof=1) / 64))
    assert alarms == 0


@pytest.mark.slow
@pytest.mark.parametrize("law", [normal, lognormal, fireflies, on_and_off, texture, filtered])
def test_false_alarms_against_a_known_mean_of_many_cases(law):
    alarms, cases = 0, 250
    for seed in range(cases):
        rng = np.random.default_rng(seed)
        many = law(rng, 64)
        known = Known(many.mean(axis=0), many.var(axis=0, ddof=1) / 64)
        alarms += sum(differs(law(rng, count), known) for count in (1, 4, 16))
        alarms += differs(law(rng, 1), many[:16])
    assert alarms <= stats.binom.isf(0.01, 4 * cases, 1e-3)


PRECISE = [(8, 4, 64), (32, 16, 16), (64, 16, 16), (64, 4, 64)]
"""Replicates of the candidate; pictures of the reference; of how many replicates each is the
mean."""


def alarms_against_a_precise_reference(law, counts, cases):
    """A gate's: its pictures are fewer than the candidate's, but have more samples."""
    alarms, (many, few, each) = 0, counts
    for seed in range(cases):
        rng = np.random.default_rng([seed, *counts])
        reference = np.stack([law(rng, each, 16).mean(axis=0) for _ in range(few)])
        candidate = law(rng, many, 16)
        alarms += differs(candidate, reference) + differs(reference, candidate)
    return alarms


@pytest.mark.cases(3)
@pytest.mark.parametrize("counts", PRECISE)
@pytest.mark.parametrize("law", LAWS)
def test_false_alarms_against_a_precise_reference(law, counts):
    assert alarms_against_a_precise_reference(LAWS[law], counts, 10) == 0


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_false_alarms_against_a_precise_reference_of_many_cases(law):
    cases = 125
    alarms = sum(alarms_against_a_precise_reference(LAWS[law], counts, cases) for counts in PRECISE)
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
