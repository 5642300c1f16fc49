"""The tests behind the statistical rung: their laws, levels and power."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planted import HEIGHT, LAMP, MARGINS, NONE, WIDTH, replicates, scene
from scipy import stats

from comparisons.statistics import Known, Margins, compare, ranks
from comparisons.statistics.advice import _known
from comparisons.statistics.cells import tiles, whole
from comparisons.statistics.decide import findings
from comparisons.statistics.order import ORDER_LEVEL
from comparisons.statistics.ranks import uniformity
from comparisons.statistics.scales import IMAGE, PIXELS, SCALES, TILES, Pair, chance_of_parting
from comparisons.statistics.sides import side_of
from comparisons.statistics.welch import (
    BiasTest,
    Error,
    bias_test,
    noise_ratio,
    quantiles,
    satterthwaite,
    welch_errors,
)

# ---- Welch's test itself -------------------------------------------------------------------------


def of_image(side):
    return side.of(whole(side.mean))


def test_statistic_is_welchs():
    rng = np.random.default_rng(0)
    a, b = rng.normal(1.0, 0.1, (5, 4, 4, 3)), rng.normal(1.1, 0.3, (9, 4, 4, 3))
    one, two = side_of(a), side_of(b)
    own, pixels = welch_errors(of_image(one), of_image(two), one, two)
    # The side of five is reckoned at least as noisy as that of nine.
    noise_a, noise_b = (x.mean(axis=(1, 2)).var(axis=0, ddof=1) for x in (a, b))
    assert own.value == pytest.approx(np.sqrt(np.maximum(noise_a, noise_b) / 5 + noise_b / 9))
    summed_a, summed_b = (x.var(axis=0, ddof=1).sum(axis=(0, 1)) / 256 for x in (a, b))
    assert pixels.value == pytest.approx(np.sqrt(np.maximum(summed_a, summed_b) / 5 + summed_b / 9))
    assert np.all((own.dof >= 4) & (own.dof <= 12))
    same = side_of(a[:4]), side_of(b[:4])
    own, _ = welch_errors(of_image(same[0]), of_image(same[1]), *same)
    expected = stats.ttest_ind(
        a[:4].mean(axis=(1, 2)), b[:4].mean(axis=(1, 2)), equal_var=False
    ).statistic
    assert (a[:4].mean((0, 1, 2)) - b[:4].mean((0, 1, 2))) / own.value == pytest.approx(expected)


def test_satterthwaite():
    ones = np.ones(1)
    assert satterthwaite(ones, ones, 7.0, 7.0) == pytest.approx(14.0)
    assert satterthwaite(ones, 0.0 * ones, 7.0, 3.0) == pytest.approx(7.0)
    assert satterthwaite(0.0 * ones, 0.0 * ones, 7.0, 3.0) == pytest.approx(3.0)
    assert satterthwaite(ones, ones, 7.0, np.inf) == pytest.approx(28.0)


@pytest.mark.parametrize(("count_a", "count_b"), [(4, 4), (8, 8), (4, 16)])
@pytest.mark.parametrize("ratio", [1.0, 3.0, 10.0])
def test_level_holds_far_out_in_the_tail(count_a, count_b, ratio):
    """At one in 1e4, where degrees of freedom from few replicates' variances promise too much."""
    rng = np.random.default_rng(0)
    tests = 300 * 300
    a = ratio * rng.standard_normal((count_a, tests))
    b = rng.standard_normal((count_b, tests))
    variance = a.var(axis=0, ddof=1) / count_a + b.var(axis=0, ddof=1) / count_b
    shares = np.array([ratio**2 / count_a]), np.array([1.0 / count_b])
    dof = satterthwaite(*shares, count_a - 1.0, count_b - 1.0)
    p = 2.0 * stats.t.sf(np.abs(a.mean(axis=0) - b.mean(axis=0)) / np.sqrt(variance), dof)
    for level in (1e-2, 1e-3, 1e-4):
        assert np.count_nonzero(p < level) <= stats.binom.isf(1e-4, tests, 1.15 * level)


@pytest.mark.parametrize("dof", [1, 3, 15, 30])
def test_detectable_bias_is_detected_that_often(dof):
    """The power can be counted: 99 %, by the definition of the detectable bias."""
    critical, reach = (values[dof] for values in quantiles(1e-3))
    rng = np.random.default_rng(5)
    estimated = np.sqrt(rng.chisquare(dof, 40_000) / dof)
    power = np.mean(rng.normal(reach, 1.0, 40_000) > critical * estimated)
    assert 0.985 < power < 0.997


def test_degrees_of_freedom_are_the_noises():
    """Of normal noise as many as pixels and replicates have; of one firefly about one."""
    rng = np.random.default_rng(0)
    quiet = rng.standard_normal((16, 32, 32, 3))
    assert of_image(side_of(quiet)).pixels_dof == pytest.approx(15 * 1024, rel=0.1)
    assert np.median(side_of(quiet).of(tiles(quiet, 16)).pixels_dof) == pytest.approx(
        15 * 256, rel=0.1
    )
    quiet[3, 8, 9] = 1e6
    assert np.all(of_image(side_of(quiet)).pixels_dof < 2.5)
    assert np.all(side_of(quiet).of(tiles(quiet, 16)).pixels_dof[0, 0] < 2.5)
    variance = np.ones((32, 32, 3))
    known = side_of(Known(variance, variance))
    assert of_image(known).pixels_dof == pytest.approx(1024)


def test_means_and_noise_of_tiles_that_the_edges_cut():
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 4, 5, 7, 3))
    test = TILES.test(Pair(side_of(a), side_of(b), MARGINS, 4), TILES.level)
    assert test.difference.shape == (2, 2, 3)
    corner = (a - b)[:, 4:, 4:].mean(axis=(0, 1, 2))
    assert test.difference[1, 1] == pytest.approx(corner)
    noise = [x[:, 4:, 4:].mean(axis=(1, 2)).var(axis=0, ddof=1) / 4 for x in (a, b)]
    assert test.errors[0].value[1, 1] == pytest.approx(np.sqrt(noise[0] + noise[1]))


def test_the_interval_is_the_widest_of_both_reckonings():
    """Replicates that happen to have the same mean do not know it better than their pixels say."""
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 4, 16, 16, 3))
    a *= 0.6 / a.mean(axis=(1, 2), keepdims=True)
    b *= 0.5 / b.mean(axis=(1, 2), keepdims=True)
    b[:, ..., 0] *= 1.19
    test = IMAGE.test(Pair(side_of(a), side_of(b), NONE), IMAGE.level)
    assert test.errors[0].value == pytest.approx(0.0, abs=1e-6)
    assert test.errors[1].value == pytest.approx(0.015, rel=0.2)
    assert list(test.differs) == [False, True, True]


@pytest.mark.parametrize(("a", "b", "chance"), [(4, 4, 2**-7), (16, 16, 2**-31), (1, 1, 0.5)])
def test_chance_of_parting(a, b, chance):
    assert chance_of_parting(a, b) == pytest.approx(chance)


def test_chance_of_parting_is_that_of_the_worst_coin():
    p = np.linspace(0.001, 0.999, 999)
    worst = (p**4 * (1.0 - p) ** 12 + p**12 * (1.0 - p) ** 4).max()
    assert worst < chance_of_parting(4, 12) < 2.0 * worst + 1e-12


def test_a_bias_test_of_its_own():
    """The pieces fit numbers by hand: 3 standard errors of 0.1 about a difference of 0.5."""
    error = Error(np.array([0.1]), np.array([np.inf]))
    test = bias_test(np.array([0.5]), np.array([2.0]), (error,), 0.05, 0.0027, 2.0)
    assert test.half_width == pytest.approx(0.3, rel=0.01)
    assert test.relative == pytest.approx(0.25)
    assert test.differs.all()
    assert test.strength == pytest.approx((0.5 - 0.1) / 0.3, rel=0.01)
    assert test.p_value() == pytest.approx(2.0 * stats.norm.sf(4.0), rel=0.1)
    assert test.within(0.41).all()
    assert not test.within(0.39).any()


def test_the_margin_of_a_pixel_follows_its_noise():
    rng = np.random.default_rng(0)
    a, b = (replicates(rng, scene(), noise=0.02) for _ in range(2))
    margin = PIXELS.test(Pair(side_of(a), side_of(b), MARGINS), PIXELS.level).margin
    assert np.all(margin[:6] == pytest.approx(1e-5))  # black: nothing is rounded
    assert np.all(margin[LAMP] == pytest.approx(1e-5 + 2.0**-11))
    assert np.median(margin[20:]) == pytest.approx(0.01, rel=0.3)
    a, b = (replicates(rng, scene(), noise=0.5) for _ in range(2))
    margin = PIXELS.test(Pair(side_of(a), side_of(b), MARGINS), PIXELS.level).margin
    assert margin.max() == pytest.approx(0.05, rel=1e-3)


# ---- uniformity ----------------------------------------------------------------------------------


def test_ranks_are_uniform_whatever_the_noise():
    rng = np.random.default_rng(0)
    p = []
    for _ in range(200):
        a, b = np.exp(2.0 * rng.standard_normal((2, 8, 16, 16, 3)))
        found = uniformity(side_of(a), side_of(b), NONE)
        p.append((found.p_narrow, found.p_reversed))
        assert found.p_wide >= 1.0 - found.p_narrow - 1e-9  # rare light is allowed for
        assert found.blocks == 16
    assert stats.kstest(p, "uniform").pvalue.min() > 1e-3


def test_blocks_may_depend_on_each_other():
    """Noise that all blocks of a picture share: their ranks are one rank, and prove nothing."""
    rng = np.random.default_rng(0)
    tested = 0
    for _ in range(60):
        brightness = 1.0 + 0.3 * rng.standard_normal((2, 16, 1, 1, 1))
        a, b = brightness + 0.01 * rng.standard_normal((2, 16, 16, 16, 3))
        found = uniformity(side_of(a), side_of(b), NONE)
        if found is not None:  # one noise for all pixels: its spread alone may look unequal
            tested += 1
            assert not found.wide
            assert not found.narrow
    assert tested > 55


@pytest.mark.parametrize(("each", "is_tested"), [(1, True), (2, True), (8, False), (64, False)])
def test_ranks_are_left_out_where_pictures_have_unequal_samples(each, is_tested):
    rng = np.random.default_rng(0)
    a = 1.0 + 0.3 * rng.standard_normal((16, HEIGHT, WIDTH, 3))
    b = 1.0 + 0.3 / math.sqrt(each) * rng.standard_normal((16, HEIGHT, WIDTH, 3))
    for one, two in ((a, b), (b, a)):
        assert (uniformity(side_of(one), side_of(two), NONE) is not None) == is_tested


@pytest.mark.parametrize("each", [1, 3, 16, 100])
def test_the_ratio_of_the_noise_is_that_of_the_median_pixel(each):
    rng = np.random.default_rng(1)
    a = 1.0 + rng.standard_normal((5, 64, 64, 3))
    b = 1.0 + rng.standard_normal((9, 64, 64, 3)) / math.sqrt(each)
    a[:, :8], b[:, 8:12] = 1.0, 1.0  # without noise on one side
    assert noise_ratio(side_of(a), side_of(b)) == pytest.approx(each, rel=0.1)
    assert noise_ratio(side_of(b), side_of(a)) == pytest.approx(1.0 / each, rel=0.1)


def test_differences_within_the_margin_are_not_too_wide():
    """Blocks that differ by 0.8 %, four times their noise."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] // 4
    pattern = np.where((x + y) % 2, 0.008, -0.008)[..., None]
    a, b = 1.0 + 0.02 * rng.standard_normal((2, 16, HEIGHT, WIDTH, 3))
    a += pattern
    assert not uniformity(side_of(a), side_of(b), MARGINS).wide
    assert uniformity(side_of(a), side_of(b), NONE).wide


def test_replicates_that_depend_on_each_other_are_too_wide():
    rng = np.random.default_rng(0)
    shared = 0.2 * rng.standard_normal((2, HEIGHT, WIDTH, 3))  # of all replicates of a side
    a, b = 1.0 + shared[:, None] + 0.2 * rng.standard_normal((2, 16, HEIGHT, WIDTH, 3))
    found = uniformity(side_of(a), side_of(b), MARGINS)
    assert found.wide
    assert not found.narrow


def test_sides_that_share_their_noise_are_invalid():
    rng = np.random.default_rng(0)
    pictures = replicates(rng, scene())
    result = compare(pictures, pictures)
    assert result.status == "invalid"
    assert "not independent of each other: mean p-value of the blocks 0.7" in result.reason
    other = replicates(rng, scene())
    half = scene() + (pictures - scene()) * 0.9 + (other - scene()) * 0.3
    assert compare(half, pictures).status == "invalid"


def test_too_few_replicates_have_no_ranks():
    rng = np.random.default_rng(0)
    a, b = replicates(rng, scene(), 3), replicates(rng, scene(), 16)
    assert compare(a, b).numbers["uniformity"] is None
    found = compare(replicates(rng, scene(), 13), b).numbers["uniformity"]
    assert found["replicates"] == 8


def test_nothing_is_ranked_where_there_is_no_noise():
    still = side_of(np.stack([scene()] * 8))
    assert uniformity(still, still, MARGINS) is None


def biases(difference, error, dof=15.0):
    """Of a reference of 1, without a margin."""
    shape = np.shape(difference)
    each = Error(np.broadcast_to(error, shape), np.full(shape, dof))
    ones, zeros = np.ones(shape), np.zeros(shape)
    return BiasTest(np.asarray(difference), ones, (each,), zeros, 3.0 * each.value, ones, zeros)


def test_the_worst_of_equal_strengths_is_the_largest_bias():
    """Without noise all strengths are infinite."""
    assert biases(np.array([[0.1, 0.0], [-0.5, 0.3]]), 0.0).worst == (1, 0)
    assert biases(np.array([0.1, 0.2]), np.array([0.01, 0.05])).worst == (0,)


def test_the_known_part_of_an_error_is_a_lower_bound_at_95_percent():
    """Of 20,000 standard errors of 3 degrees of freedom each, whose truth is 1."""
    dof, rng = 3.0, np.random.default_rng(5)
    estimates = np.sqrt(rng.chisquare(dof, 20_000) / dof)
    above = (_known(biases(np.zeros(20_000), estimates, dof)) > 1.0).mean()
    assert above == pytest.approx(0.05, abs=6.0 * np.sqrt(0.05 * 0.95 / 20_000))


def test_all_levels_add_up_to_one_false_alarm_in_a_thousand():
    total = sum(scale.level for scale in SCALES) + ranks.LEVEL + 2.0 * ORDER_LEVEL
    assert total == pytest.approx(1e-3)


@pytest.mark.parametrize("level", [1.0, 0.25])
def test_the_stated_confidence_is_that_of_the_look(level):
    rng = np.random.default_rng(2)
    a, b = rng.normal(1.0, 0.01, (2, 16, 16, 16, 3))
    assert compare(a, b, level=level).numbers["confidence"] == 1.0 - level * IMAGE.level


@pytest.mark.parametrize("look", [1.0, 0.25])
@pytest.mark.parametrize("fraction", [0.99, 1.01])
@pytest.mark.parametrize("way", ["wide", "narrow"])
def test_ranks_alarm_at_their_part_of_the_levels(way: str, fraction: float, look: float) -> None:
    """Half of it is for blocks that differ too much; half for those that differ too little, in
    either order of the pairs."""
    rng = np.random.default_rng(4)
    sides = rng.normal(1.0, 0.01, (2, 16, 16, 16, 3))
    found = findings(*sides, 16, Margins(), look).uniformity
    assert found is not None
    chance = fraction * look * ranks.LEVEL / 2.0
    at = {"p_wide": chance} if way == "wide" else {"p_narrow": 1.0, "p_reversed": chance / 2.0}
    assert getattr(replace(found, **at), way) == (fraction < 1.0)
