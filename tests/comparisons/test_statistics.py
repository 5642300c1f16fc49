"""The statistical rung: right scenes must pass, planted errors must be found."""

import json
import math

import numpy as np
import pytest
from scipy import stats

from comparisons.statistics import (
    FAMILY_LEVEL,
    IMAGE_MARGIN,
    bias_of_means,
    bias_of_tiles,
    compare_replicates,
)

SEEDS = 300


def scene(height=32, width=32):
    """A picture with a bright, a dim and a black part, and a channel of little light."""
    mean = np.full((height, width, 3), 0.5)
    mean[: height // 2, : width // 2] = 0.02
    mean[height // 2 :, : width // 2] = 0.0
    mean[..., 2] *= 0.1
    return mean


def replicates(rng, mean, count=16, samples=20_000):
    """Poisson noise, as of `samples` samples a pixel that are either lit or not."""
    return rng.poisson(mean * samples, (count, *mean.shape)) / samples


# Welch's test itself


def test_statistic_is_welchs():
    rng = np.random.default_rng(0)
    ours, mitsuba = rng.normal(1.0, 0.1, (5, 4, 4, 3)), rng.normal(1.1, 0.3, (9, 4, 4, 3))
    test = bias_of_means(ours, mitsuba, margin=0.0, level=0.05)
    expected = stats.ttest_ind(ours.mean(axis=(1, 2)), mitsuba.mean(axis=(1, 2)), equal_var=False)
    assert test.difference / test.standard_error == pytest.approx(expected.statistic)
    assert test.dof == 4
    assert test.p_value == pytest.approx(2.0 * stats.t.sf(np.abs(expected.statistic), 4))
    quantile = stats.t.ppf(0.5 + 0.5 * 0.95 ** (1.0 / 3.0), 4)
    assert test.half_width == pytest.approx(quantile * test.standard_error)
    assert test.relative == pytest.approx(ours.mean((0, 1, 2)) / mitsuba.mean((0, 1, 2)) - 1.0)


def tiles_of_eight(ours, mitsuba, **options):
    return bias_of_tiles(ours, mitsuba, 8, **options)[0]


@pytest.mark.parametrize("bias", [bias_of_means, tiles_of_eight])
def test_level_is_the_stated_one(bias):
    """Against a side without noise the test is Student's, whose level is exact.

    Without a margin, equal means must then be rejected as often as the family's level says.
    """
    level = 0.05
    exact = np.ones((6, 16, 16, 3))
    alarms = 0
    for seed in range(SEEDS):
        ours = np.random.default_rng(seed).normal(1.0, 0.2, exact.shape)
        alarms += bool(bias(ours, exact, margin=0.0, level=level).differs.any())
    assert stats.binom.ppf(1e-4, SEEDS, level) <= alarms <= stats.binom.isf(1e-4, SEEDS, level)


@pytest.mark.parametrize(("count", "noise"), [(4, 10.0), (16, 2.0)])
def test_level_holds_far_out_in_the_tail(count, noise):
    """At one in 1e4, where Welch and Satterthwaite's dof give many times the stated alarms."""
    rng = np.random.default_rng(0)
    ours = rng.normal(1.0, noise, (4, 300, 300, 3))
    mitsuba = rng.normal(1.0, 1.0, (count, 300, 300, 3))
    p_value = bias_of_tiles(ours, mitsuba, tile=1, margin=0.0)[0].p_value
    alarms = np.count_nonzero(p_value < 1e-4)
    assert alarms <= stats.binom.isf(1e-4, p_value.size, 1e-4)


@pytest.mark.parametrize("count", [2, 3, 8])
def test_detectable_bias_is_detected_that_often(count):
    """The power can be counted: 99 %, by the definition of the detectable bias.

    The approximation errs by up to 3 % of the bias, to the safe side for few replicates.
    """
    rng = np.random.default_rng(5)
    ours, mitsuba = rng.normal(1.0, 0.01, (2, count, 1, 1, 3))
    test = bias_of_means(ours, mitsuba, margin=0.001)
    # Runs of the same dof whose true standard error is the one that was estimated.
    error, dof = test.standard_error, test.dof
    runs = 20_000
    difference = rng.normal(test.detectable, error, (runs, 3))
    estimated = error * np.sqrt(rng.chisquare(dof, (runs, 3)) / dof)
    proven = difference - test.half_width / error * estimated > test.margin * test.scale
    power = proven.mean(axis=0)
    assert np.all(power > 0.985)
    assert np.all(power < 0.997)


# The decision: specificity


def test_equal_distributions_do_not_differ():
    alarms = agreements = 0
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        tier = compare_replicates(replicates(rng, scene()), replicates(rng, scene()))
        alarms += tier.status == "differ"
        agreements += tier.status == "agree"
    assert alarms <= stats.binom.isf(1e-3, SEEDS, 2 * FAMILY_LEVEL)
    assert agreements >= 0.95 * SEEDS


@pytest.mark.parametrize(("count_ours", "count_mitsuba"), [(2, 2), (4, 16), (16, 4)])
def test_few_and_unequal_replicates_do_not_differ(count_ours, count_mitsuba):
    alarms = 0
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        # Unlike noise on the two sides, which a pooled variance would get wrong.
        ours = replicates(rng, scene(16, 16), count_ours, samples=200)
        mitsuba = replicates(rng, scene(16, 16), count_mitsuba, samples=3_000)
        alarms += compare_replicates(ours, mitsuba, tile=4).status == "differ"
    assert alarms <= stats.binom.isf(1e-3, SEEDS, 2 * FAMILY_LEVEL)


def test_noise_is_inconclusive_and_the_stated_samples_decide():
    decided = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        tier = compare_replicates(*(replicates(rng, scene(), samples=400) for _ in range(2)))
        assert tier.status == "inconclusive"
        assert "times as many samples" in tier.reason
        samples = math.ceil(400 * tier.numbers["samples_factor"])
        assert samples > 400
        more = (replicates(rng, scene(), samples=samples) for _ in range(2))
        decided += compare_replicates(*more).status == "agree"
    assert decided >= 18


# The decision: sensitivity


def found(changed, tile=16, **options):
    """In how many of 20 runs `changed` is told from `scene()`."""
    results = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        ours, mitsuba = replicates(rng, changed, **options), replicates(rng, scene(), **options)
        results.append(compare_replicates(ours, mitsuba, tile))
    return sum(tier.status == "differ" for tier in results), results[0]


def test_one_percent_of_gain_is_found():
    count, tier = found(scene() * 1.01)
    assert count == 20
    assert "image mean" in tier.reason
    bias = tier.numbers["relative_bias"]
    assert bias["R"] == pytest.approx(0.01, abs=0.002)
    assert max(tier.numbers["detectable_bias"].values()) < 0.01


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_one_wrong_channel_is_found(channel):
    changed = scene()
    changed[..., channel] *= 0.98
    count, tier = found(changed)
    assert count == 20
    assert f"image mean {'RGB'[channel]} -" in tier.reason


def test_one_wrong_tile_is_found_and_named():
    """Energy that moves within a tile's neighbourhood leaves the image mean alone."""
    changed = scene(48, 80)
    changed[16:32, 64:80, 1] *= 1.05
    changed[32:48, 64:80, 1] *= 0.95
    rng = np.random.default_rng(0)
    tier = compare_replicates(replicates(rng, changed), replicates(rng, scene(48, 80)))
    assert tier.status == "differ"
    assert "not the image mean" in tier.reason
    assert tier.numbers["tiles_that_differ"] == 2
    assert (tier.numbers["worst_tile_x"], tier.numbers["worst_tile_y"]) in [(64, 16), (64, 32)]
    assert tier.numbers["worst_tile_channel"] == "G"
    assert abs(tier.numbers["worst_tile_bias"]) == pytest.approx(0.05, abs=0.01)


def test_light_in_a_black_tile_is_found():
    changed = scene()
    changed[16:, :16] = 0.01
    count, _ = found(changed)
    assert count == 20


def test_a_bias_within_the_margin_is_permitted():
    rng = np.random.default_rng(0)
    ours = replicates(rng, scene() * (1.0 + IMAGE_MARGIN / 2), samples=200_000)
    assert compare_replicates(ours, replicates(rng, scene(), samples=200_000)).status == "agree"


# No noise, no light, no number


def test_pictures_without_noise():
    still = np.stack([scene()] * 4)
    assert compare_replicates(still, still).status == "agree"
    assert compare_replicates(still * (1.0 + 1e-15), still).status == "agree"
    tile = still.copy()
    tile[:, :8, :8] *= 1.5
    tier = compare_replicates(tile, still, tile=8)
    assert tier.status == "differ"
    assert (tier.numbers["worst_tile_x"], tier.numbers["worst_tile_y"]) == (0, 0)
    assert (
        compare_replicates(still, np.random.default_rng(0).permuted(still, axis=0)).status
        == "agree"
    )


def test_a_tile_without_noise_that_differs_fails_beside_noisy_ones():
    rng = np.random.default_rng(0)
    ours, mitsuba = replicates(rng, scene()), replicates(rng, scene())
    ours[:, 16:, :16] = 0.002
    mitsuba[:, 16:, :16] = 0.0
    test, worst = bias_of_tiles(ours, mitsuba)
    assert worst == (0, 16)
    assert test.p_value[1, 0, 0] == 0.0
    assert compare_replicates(ours, mitsuba).status == "differ"


def test_black_pictures():
    rng = np.random.default_rng(0)
    lit = replicates(rng, scene())
    assert compare_replicates(lit * 0, lit * 0).status == "not-applicable"
    assert compare_replicates(lit * 0, lit).status == "differ"
    assert compare_replicates(lit, lit * 0).status == "differ"
    spark = lit * 0
    spark[0, 3, 3] = 1.0  # in one replicate only: not proven
    tier = compare_replicates(spark, lit * 0)
    assert tier.status == "inconclusive"
    json.dumps(tier.numbers, allow_nan=False)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_pixels_not_finite_are_invalid(value):
    ours = np.ones((4, 8, 8, 3))
    ours[2, 3, 4, 0] = value
    tier = compare_replicates(np.ones((4, 8, 8, 3)), ours)
    assert tier.status == "invalid"
    assert "0 of ours, 1 of Mitsuba's" in tier.reason
    with pytest.raises(ValueError, match="not finite"):
        bias_of_means(ours, ours)


def test_sizes():
    images = np.ones((2, 8, 8, 3))
    assert compare_replicates(images, np.ones((2, 8, 9, 3))).status == "invalid"
    for wrong in (np.ones((1, 8, 8, 3)), np.ones((8, 8, 3)), np.ones((2, 8, 8, 4))):
        with pytest.raises(ValueError, match="expected"):
            compare_replicates(wrong, images)
    with pytest.raises(ValueError, match="differ in size"):
        bias_of_tiles(images, np.ones((2, 8, 9, 3)))


def test_tiles_at_the_edges_are_means_of_what_is_there():
    images = np.arange(2 * 5 * 7 * 3, dtype=float).reshape(2, 5, 7, 3)
    test, _ = bias_of_tiles(images, images * 2.0, tile=4)
    assert test.difference.shape == (2, 2, 3)
    assert test.difference[1, 1] == pytest.approx(-images[:, 4:, 4:].mean(axis=(0, 1, 2)))
    assert test.difference[0, 1] == pytest.approx(-images[:, :4, 4:].mean(axis=(0, 1, 2)))


def test_numbers_are_json_and_the_reason_states_the_power():
    rng = np.random.default_rng(0)
    for samples in (100, 20_000):
        noisy = [replicates(rng, scene(), samples=samples) for _ in range(2)]
        tier = compare_replicates(*noisy)
        json.dumps(tier.numbers, allow_nan=False)
        assert "smallest detectable bias" in tier.reason
        assert tier.name == "statistics"
