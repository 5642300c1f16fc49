"""Fitted slopes, times to an error and plans: those of known curves are recovered."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from comparisons.experiments.convergence.estimates import (
    DRAWS,
    Points,
    linear_time,
    log_line,
    time_to,
)
from comparisons.experiments.convergence.findings import Target, ratio
from comparisons.experiments.convergence.methods import (
    Cost,
    Shot,
    affordable,
    estimate,
    rungs,
    why_left_out,
)
from comparisons.experiments.convergence.store import Settings


def points(spp, seconds, squared, log_error=0.02, freedom=7):
    n = len(spp)
    return Points(
        np.array(spp, float),
        np.array(seconds, float),
        np.array(squared, float),
        np.full(n, 0.01),
        np.full(n, log_error),
        freedom,
    )


# ---- slopes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("scatter", [0.03, 0.3])
@pytest.mark.parametrize("slope", [-1.0, -1.3])
def test_slope_lies_within_its_interval(slope, scatter):
    """In 95 % of 400 runs of six rungs of eight replicates, as measured: scatters of errors are
    those of gamma variates; four standard deviations of a binomial are 4.4 %."""
    rng = np.random.default_rng(9)
    spp = 4.0 * 2.0 ** np.arange(6)
    held = []
    for _ in range(400):
        shape = 1.0 / scatter**2
        replicates = rng.gamma(shape, scatter**2, (8, 6)) * spp**slope
        mean = replicates.mean(axis=0)
        error = replicates.std(axis=0, ddof=1) / math.sqrt(8) / mean
        line = log_line(spp, mean, error, 7)
        held.append(line.low <= slope <= line.high)
    assert abs(np.mean(held) - 0.95) < 0.044


def test_a_bent_curve_has_a_wider_interval():
    """Points off a line by more than their scatter: the interval does not pretend."""
    spp = 4.0 * 2.0 ** np.arange(6)
    bent = 1.0 / spp * (1.0 + 0.3 * np.array([1, -1, 1, -1, 1, -1]))
    straight, off = (log_line(spp, y, np.full(6, 1e-3), 7) for y in (1.0 / spp, bent))
    assert off.high - off.low > 50.0 * (straight.high - straight.low)
    assert log_line(spp[:1], spp[:1], np.ones(1), 7) is None


# ---- times --------------------------------------------------------------------------------------


def test_time_between_rungs():
    """An error of 2 / n in 0.01 n seconds: 1/25 after 50 samples, half a second."""
    spp = [4, 8, 16, 32, 64, 128]
    curve = points(spp, [0.01 * n for n in spp], [2.0 / n for n in spp])
    found = time_to(curve, 0.04)
    assert found.how == "interpolated"
    assert found.spp == pytest.approx(50.0, rel=1e-9)
    assert found.seconds.value == pytest.approx(0.5, rel=1e-9)
    assert found.seconds.low < 0.5 < found.seconds.high


@pytest.mark.parametrize("independent", [False, True])
def test_time_beyond_the_last_rung(independent):
    """Seconds have a start of 0.1 and grow by 0.01 a sample, also beyond."""
    spp = [4, 8, 16, 32, 64, 128]
    curve = points(spp, [0.1 + 0.01 * n for n in spp], [2.0 / n for n in spp])
    found = time_to(curve, 2e-4, independent)
    assert found.how == "extrapolated"
    assert found.spp == pytest.approx(10_000.0, rel=1e-6)
    assert found.seconds.value == pytest.approx(100.1, rel=1e-6)
    both = [time_to(curve, 2e-4, known).seconds for known in (False, True)]
    widths = [band.high / band.low for band in both]
    assert widths[1] < widths[0]


def test_what_strata_catch_does_not_fall_for_ever():
    """Errors of (0.5 + 0.6 / sqrt(n)) / n are continued as such; a line would be too low."""
    spp = np.array([4.0, 8, 16, 32, 64, 128])
    squared = (0.5 + 0.6 / np.sqrt(spp)) / spp
    found = time_to(points(spp, 0.01 * spp, squared), (0.5 + 0.6 / 100.0) / 1e4)
    assert found.spp == pytest.approx(1e4, rel=1e-6)
    assert found.seconds.value == pytest.approx(100.0, rel=1e-6)
    # All of it caught: as n^(-3/2), not faster.
    caught = time_to(points(spp, 0.01 * spp, spp**-1.5), 1e-6)
    assert caught.spp == pytest.approx(1e4, rel=1e-6)


def test_times_that_cannot_be_determined():
    spp = [4, 8, 16]
    curve = points(spp, [0.1, 0.2, 0.4], [0.5, 0.25, 0.125])
    first = time_to(curve, 0.9)
    assert (first.how, first.seconds.value) == ("below", pytest.approx(0.1))
    rising = points(spp, [0.1, 0.2, 0.4], [0.5, 0.6, 0.7])
    assert time_to(rising, 0.1) is None
    assert time_to(points([4], [0.1], [0.5]), 0.1) is None
    assert time_to(points([], [], []), 0.1) is None


@pytest.mark.parametrize("seconds", [[0.07] * 3, [0.08, 0.07, 0.07], [0.07, 0.02, 0.01]])
def test_times_that_do_not_rise_with_the_samples_are_not_continued(seconds):
    """A renderer whose start takes all the time, or a machine that was busy at first: its time to a
    small error would be that of its last rung."""
    spp = np.array([1.0, 2.0, 4.0])
    assert time_to(points(spp, seconds, 1.0 / spp), 0.01) is None
    assert time_to(points(spp, seconds, 1.0 / spp), 0.3).how == "interpolated"


@pytest.mark.slow
def test_time_lies_within_its_band():
    """Measured curves of eight replicates: the band of the time to an error about eight times below
    that of the last rung holds the true time in 95 % of 200 runs (four standard deviations of a
    binomial: 6.2 %); more often for the two terms, one of which may be held at 0."""
    rng = np.random.default_rng(10)
    spp = 4.0 * 2.0 ** np.arange(6)
    for strata, independent in ((0.0, True), (0.6, False)):
        errors_at = lambda n, strata=strata: (0.5 + strata / np.sqrt(n)) / n  # noqa: E731
        held = []
        for _ in range(200):
            replicates = rng.gamma(400.0, 1 / 400.0, (8, 6)) * errors_at(spp)
            mean = replicates.mean(axis=0)
            error = replicates.std(axis=0, ddof=1) / math.sqrt(8) / mean
            curve = Points(spp, 0.01 * spp, mean, np.zeros(6), error, 7)
            band = time_to(curve, float(errors_at(1024.0)), independent).seconds
            held.append(band.low <= 10.24 <= band.high)
        assert abs(np.mean(held) - 0.95) < 0.062, (strata, np.mean(held))


def test_seconds_are_a_start_and_a_share_of_each_sample():
    spp = np.array([4.0, 8.0, 16.0, 64.0])
    assert linear_time(spp, 0.2 + 0.03 * spp) == pytest.approx((0.2, 0.03))
    start, share = linear_time(spp, 0.03 * spp)
    assert (start, share) == pytest.approx((0.0, 0.03), abs=1e-12)


def test_ratio_of_times():
    spp = [4, 8, 16, 32]
    mine = points(spp, [0.01 * n for n in spp], [1.0 / n for n in spp])
    theirs = points(spp, [0.03 * n for n in spp], [1.0 / n for n in spp])
    targets = []
    for curve in (mine, theirs):
        found = time_to(curve, 0.05)
        targets.append(Target(0.2, found.how, found.seconds, found.spp, np.exp(found.log_seconds)))
    found = ratio(*targets)
    assert found.value == pytest.approx(1 / 3)
    assert found.low < 1 / 3 < found.high
    assert len(targets[0].drawn) == DRAWS
    unknown = Target(0.2, "unknown", found, math.nan, np.array([math.nan]))
    assert ratio(unknown, targets[0]) is None


# ---- plans --------------------------------------------------------------------------------------


def renderer(start: float, per_sample: float) -> Callable[[int, int], Shot]:
    return lambda spp, replicate: Shot(np.zeros((2, 2, 3)), spp, start + per_sample * spp)


def test_cost_is_estimated_from_trials():
    cost = estimate(renderer(0.5, 0.01))
    assert (cost.start, cost.per_sample) == (pytest.approx(0.5), pytest.approx(0.01))
    # Where noise makes fewer samples slower, none of the cost is lost.
    odd = estimate(lambda spp, k: Shot(np.zeros((2, 2, 3)), spp, 0.2 if spp == 4 else 0.1))
    assert odd.picture(16) >= 0.1


def test_rungs_fit_into_the_time():
    settings = Settings(max_spp=64, replicates=8)
    cost = Cost(0.0, 0.01)
    assert rungs(64) == (4, 8, 16, 32, 64)
    assert rungs(100, 4) == (4, 16, 64)
    # 8 replicates of 4, 8, 16 samples are 2.24 s, of 32 another 2.56 s.
    assert affordable(cost, 4.0, settings, 100) == (4, 8, 16)
    assert "rungs from 32 samples" in why_left_out(cost, (4, 8, 16), 4.0, settings, 100)
    assert affordable(cost, 100.0, settings, 100) == rungs(64)
    assert why_left_out(cost, rungs(64), 100.0, settings, 100) == ""
    assert affordable(cost, 1e6, replace(settings, max_spp=1 << 20), 1 << 22) == rungs(512)
