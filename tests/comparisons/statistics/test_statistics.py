"""The statistical rung: right scenes must pass, planted errors must be found and placed."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from planted import (
    FAULTS,
    HEIGHT,
    LAMP,
    MARGINS,
    STILL,
    TILE,
    WIDTH,
    judged,
    patched,
    replicates,
    scene,
)

from comparisons.statistics import Known, Margins, compare, standard_error, worst_regions
from comparisons.statistics.advice import wanted
from comparisons.statistics.decide import _decide, findings

# The decision: specificity and equivalence


@pytest.mark.slow
def test_equal_distributions_agree():
    statuses = [judged(scene(), seed).status for seed in range(60)]
    assert statuses.count("agree") >= 57
    assert "differ" not in statuses
    assert "invalid" not in statuses


def test_the_reason_of_agreement_states_power_and_equivalence():
    result = judged(scene())
    assert result.status == "agree"
    assert result.name == "statistics"
    assert "within ±0.5 %; no tile and no pixel differs" in result.reason
    assert "the smallest bias of the image mean seen with 99 % power is 0." in result.reason
    assert "the means are equivalent within ±0." in result.reason
    assert "% at 99.95 %; this holds for light that the pictures have met" in result.reason
    assert max(result.numbers["detectable_bias"].values()) <= 0.005
    reach = [
        abs(result.numbers["relative_bias"][c]) + result.numbers["image"]["half_width_of_bias"][c]
        for c in "RGB"
    ]
    assert result.numbers["equivalent_within"] == pytest.approx(max(reach))


def test_agreement_needs_power_and_not_only_a_narrow_interval():
    """A bias as large as the limit must be seen, or the run is not conclusive."""
    found = {}
    for noise in (0.13, 0.16, 0.2, 0.25, 0.3):
        result = judged(scene(), noise=noise)
        numbers = result.numbers
        sees = max(numbers["detectable_bias"].values()) <= 0.005
        assert (result.status == "agree") == (sees and numbers["equivalent_within"] <= 0.005)
        found[sees, numbers["equivalent_within"] <= 0.005] = result
    hidden = found[False, True]
    assert hidden.status == "inconclusive"
    assert ", within ±0.5 %; a bias of that size could be overlooked; it takes" in hidden.reason
    assert ", not within ±0.5 %; a bias of" in found[False, False].reason


def test_agreement_needs_an_interval_within_the_limit():
    """A run that would see the limit, but happens to be too far off, and not yet proven so."""
    rng = np.random.default_rng(0)
    pictures = [replicates(rng, scene(), noise=0.11) for _ in range(2)]
    found = findings(*pictures, 16, MARGINS)
    image = found.image
    assert image.over_scale(image.detectable).max() < 0.005
    only_green = np.array([0.0, 1.0, 0.0])
    off = replace(image, difference=only_green * (0.00505 * image.scale - image.half_width))
    assert not off.differs.any()
    assert _decide(found, 0.005, "")[0] == "agree"
    status, reason = _decide(
        replace(found, tests=found.tests | {"image": off}), 0.005, "it takes about twice"
    )
    assert status == "inconclusive"
    assert ", not within ±0.5 %; it takes about" in reason


def test_a_wider_limit_is_met_sooner():
    assert judged(scene(), noise=0.5).status == "inconclusive"
    assert judged(scene(), noise=0.5, limit=0.03).status == "agree"
    with pytest.raises(ValueError, match=r"limit 0.001: expected more than the margin 0.001"):
        judged(scene(), limit=0.001)


@pytest.mark.slow
def test_noise_is_inconclusive_and_the_stated_samples_decide():
    decided = 0
    for seed in range(20):
        result = judged(scene(), seed, noise=0.4)
        assert result.status == "inconclusive"
        factor = result.numbers["samples_factor"]
        assert factor > 1.0
        assert f"replicates x {factor:.{0 if factor > 10 else 1}f} or spp x" in result.reason
        decided += judged(scene(), seed + 100, noise=0.4 / math.sqrt(factor)).status == "agree"
    assert decided >= 17


def test_a_bias_within_the_margin_is_permitted():
    noisy = np.where(STILL, scene(), scene() * 1.0005)
    assert judged(noisy, noise=0.05).status == "agree"
    tight = Margins(image=1e-5, tile=1e-4, pixel=1e-4, constant=1e-12)
    assert judged(noisy, noise=0.002, margins=tight).status == "differ"


def test_a_smaller_share_of_the_levels_needs_more_evidence() -> None:
    """A bias of 0.8 % that the whole level proves; twelve pictures whose pixels vary by 10 %."""
    a, b = (
        1.0 + bias + 0.1 * np.random.default_rng(seed).normal(size=(12, 32, 32, 3))
        for seed, bias in ((1, 0.008), (2, 0.0))
    )
    verdicts = [compare(a, b, limit=0.02, level=level).status for level in (1.0, 1e-3, 1e-6)]
    assert verdicts == ["differ", "agree", "inconclusive"]


# The decision: sensitivity


@pytest.mark.cases(4)
@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_found_and_named(fault):
    changed, words = FAULTS[fault]
    for seed in range(3):
        result = judged(changed, seed)
        assert result.status == "differ"
        assert words in result.reason
        assert "beyond ±" in result.reason


def test_numbers_of_the_worst_tile_and_pixel():
    tile = judged(patched(TILE, 1.05)).numbers["tiles"]
    assert (tile["side"], tile["tested"], tile["differ"]) == (16, 12, 1)
    assert (tile["worst_x"], tile["worst_y"]) == (32, 16)
    assert tile["worst_bias"] == pytest.approx(0.05, abs=0.01)
    assert tile["worst_p_value"] < 1e-6
    pixel = judged(patched((30, 41), 2.0)).numbers["pixels"]
    assert (pixel["worst_x"], pixel["worst_y"], pixel["differ"]) == (41, 30, 1)
    assert pixel["worst_bias"] == pytest.approx(1.0, abs=0.3)


def test_many_small_differences_are_found_by_uniformity():
    """A pattern that no pixel and no tile can prove."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] // 4
    pattern = np.where(STILL, 0.0, np.where((x + y) % 2, 0.06, -0.06)[..., None])
    result = judged(scene() * (1.0 + pattern), noise=0.4)
    assert result.status == "differ"
    assert "small blocks differ more between the sides than within: mean p-value" in result.reason
    assert result.numbers["tiles"]["differ"] == result.numbers["pixels"]["differ"] == 0
    # One of many looks may use little of the level.
    assert judged(scene() * (1.0 + pattern), noise=0.4, level=1e-12).status != "differ"


# Pixels without noise


@pytest.mark.parametrize("count", [2, 4, 16])
def test_rounding_of_pixels_without_noise_is_permitted_and_no_more(count):
    """The background is compared with the dark level, the lamp with itself."""
    for where, change, status in (
        ((3, 3), 1e-7, None),
        (LAMP, 5.0 * 2.0**-11, None),
        ((3, 3), 1e-4, "differ"),
        ((11, 30), 5.0 * 2.0**-10, "differ"),
        (LAMP, 5.0 * 2.0**-10, "differ"),
    ):
        changed = scene()
        changed[where] += change
        result = judged(changed, count=count)
        assert (result.status == "differ") == (status == "differ"), (where, change, result.reason)


def test_pictures_without_any_noise():
    still = np.stack([scene()] * 4)
    assert compare(still, still).status == "agree"
    assert compare(still * (1.0 + 1e-7), still).status == "agree"
    tile = still.copy()
    tile[:, 16:32, :16] *= 1.5
    result = compare(tile, still)
    assert result.status == "differ"
    assert standard_error(still, still).max() <= 5.0 * 2.0**-24


def test_no_noise_by_chance_beside_noise_is_no_proof():
    """Four replicates of a pixel of two values, equal by chance, amid others like it."""
    rng = np.random.default_rng(0)
    a, b = rng.integers(0, 2, (2, 4, 32, 32, 3)).astype(float)
    a[:, 9, 9], b[:, 9, 9] = 1.0, 0.0
    assert not findings(a, b, 16, MARGINS).tests["pixels"].differs.any()


# What is said where there is nothing to compare


def test_black_pictures():
    rng = np.random.default_rng(0)
    lit = replicates(rng, scene())
    assert compare(lit * 0, lit * 0).status == "not-applicable"
    for pair in ((lit * 0, lit), (lit, lit * 0), (lit[:1] * 0, lit), (lit, lit[:1] * 0)):
        result = compare(*pair)
        assert result.status == "differ"
        json.dumps(result.numbers, allow_nan=False)
    assert "where the reference is black" in compare(lit, lit * 0).reason
    spark = lit * 0
    spark[0, 3, 3] = 1.0  # in one replicate only: not proven
    result = compare(spark, lit * 0)
    assert result.status == "inconclusive"
    assert "give more replicates" in result.reason
    json.dumps(result.numbers, allow_nan=False)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_pixels_not_finite_are_invalid(value):
    pictures = np.ones((4, 8, 8, 3))
    bad = pictures.copy()
    bad[2, 3, 4, 0] = value
    result = compare(pictures, bad)
    assert result.status == "invalid"
    assert "0 of the candidate, 1 of the reference" in result.reason
    assert compare(pictures, Known(pictures[0], bad[2])).status == "invalid"
    assert compare(pictures, Known(pictures[0], -pictures[0])).status == "invalid"
    assert np.isfinite(standard_error(pictures, bad)).all()
    with pytest.raises(ValueError, match="not finite"):
        worst_regions(pictures, bad)


def test_sizes():
    images = np.ones((2, 8, 6, 3))
    result = compare(images, np.ones((2, 8, 9, 3)))
    assert result.status == "invalid"
    assert result.reason == "candidate is 6 x 8, reference 9 x 8 pixels (width x height)"
    for wrong in (np.ones((8, 6, 3)), np.ones((2, 8, 6, 4)), np.ones((0, 8, 6, 3))):
        with pytest.raises(ValueError, match=r"candidate: expected \(R, height, width, 3\)"):
            compare(wrong, images)
        with pytest.raises(ValueError, match=r"reference: expected \(R, height, width, 3\)"):
            compare(images, wrong)
    with pytest.raises(ValueError, match=r"reference's mean: expected \(height, width, 3\)"):
        compare(images, Known(images, images))
    with pytest.raises(ValueError, match="its variance"):
        compare(images, Known(images[0], images[0, :4]))
    for function in (standard_error, worst_regions):
        with pytest.raises(ValueError, match="candidate is 6 x 8, reference 9 x 8"):
            function(images, np.ones((2, 8, 9, 3)))


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (3, 5), (17, 16), (40, 1)])
@pytest.mark.parametrize("counts", [(1, 1), (1, 4), (2, 2), (4, 1), (5, 9)])
def test_small_pictures(shape, counts):
    rng = np.random.default_rng(0)
    a, b = (1.0 + 0.1 * rng.standard_normal((count, *shape, 3)) for count in counts)
    result = compare(a, b)
    assert result.status == "inconclusive"
    json.dumps(result.numbers, allow_nan=False)
    assert standard_error(a, b).shape == (*shape, 3)
    assert np.isfinite(standard_error(a, b)).all()
    worst_regions(a, b)
    assert compare(a[:, :, :, :], Known(b[0], 0.01 * np.ones_like(b[0]))).status == "inconclusive"


def test_negative_radiance_of_a_filter():
    rng = np.random.default_rng(0)
    pictures = 0.5 + 2.0 * rng.standard_normal((2, 16, 64, 64, 3))
    result = compare(*pictures)
    assert result.status == "inconclusive"
    gain = compare(pictures[0] + 0.5, pictures[1])
    assert gain.status == "differ"


def test_numbers_are_json():
    for noise in (0.05, 1.0):
        result = judged(scene(), noise=noise)
        json.dumps(result.numbers, allow_nan=False)
        for scale in ("image", "tiles", "pixels", "uniformity"):
            assert isinstance(result.numbers[scale], dict)
        for key in ("relative_bias", "standard_error_of_bias", "detectable_bias", "p_value"):
            assert list(result.numbers[key]) == ["R", "G", "B"]
        assert (
            result.numbers["replicates_candidate"] == result.numbers["replicates_reference"] == 16
        )
        assert result.numbers["mean_reference"]["R"] == pytest.approx(
            scene()[..., 0].mean(), rel=0.1
        )


@pytest.mark.parametrize("exponent", [-320, -300, -200, -162, -155, -120, -80, -40])
def test_light_too_faint_to_be_squared(exponent: int) -> None:
    """The tail of a Beckmann lobe: variances, or their squares, are less than the least float64."""
    rng = np.random.default_rng(6)
    a, b = rng.uniform(0.5, 1.5, (2, 8, 24, 24, 3))
    faint = 10.0**exponent * rng.uniform(0.0, 1.0, (2, 8, 24, 10, 3))
    results = []
    for some in (np.zeros_like(faint), faint):
        a[:, :, :10], b[:, :, :10] = some
        found = compare(a, b, limit=0.5)
        assert np.isfinite(standard_error(a, b)).all()
        results.append((found.status, found.numbers["relative_bias"]))
    assert results[0][0] == results[1][0] == "agree"
    assert results[1][1] == pytest.approx(results[0][1])


def test_hardly_more_samples_are_told_in_words():
    sides = (replicates(np.random.default_rng(k), scene()) for k in (1, 2))
    image = findings(*sides, 16, MARGINS).image
    limits = np.geomspace(0.002, 0.02, 60)
    words = [wanted(image, limit, None)[0] for limit in limits]
    assert not any("about 1.0 times" in text for text in words)
    assert sum(text.startswith("slightly more samples suffice: a tenth more") for text in words) > 2
    assert any("it takes about 1.2 times" in text for text in words)


# Where noisy pictures differ: maps and places


def worst_places_of(changed):
    rng = np.random.default_rng(1)
    return worst_regions(replicates(rng, changed), replicates(rng, scene()))


def test_standard_error_is_that_of_the_pixels():
    rng = np.random.default_rng(0)
    a = 1.0 + 0.1 * rng.standard_normal((32, 32, 32, 3))
    b = 1.0 + 0.3 * rng.standard_normal((32, 32, 32, 3))
    expected = math.sqrt((0.1**2 + 0.3**2) / 32)
    error = standard_error(a, b)
    assert error.mean() == pytest.approx(expected, rel=0.1)
    assert error.min() > 0.7 * expected
    single = standard_error(a[:1], b)
    assert single.mean() == pytest.approx(math.sqrt(0.1**2 + 0.3**2 / 32), rel=0.1)


def test_worst_places_are_ranked():
    changed = patched(TILE, 1.2)
    changed[32:48, :16] *= 0.9
    found = worst_places_of(changed)
    assert [(p.x, p.y, p.width, p.height) for p in found[:2]] == [(32, 16, 16, 16), (0, 32, 16, 16)]
    assert found[0].what.startswith("+20 % in ")
    assert found[0].what.endswith(" standard errors")
    assert worst_places_of(scene()) == ()


def test_worst_places_name_a_pixel():
    changed = patched((30, 41), 3.0)
    changed[2, 50] = 0.01
    places = worst_places_of(changed)
    words = {(p.x, p.y): p.what for p in places}
    assert set(words) == {(32, 16), (48, 0)}
    assert words[32, 16].startswith("pixel 41, 30: +")
    assert words[48, 0].startswith("pixel 50, 2: +")
    assert words[48, 0].endswith("where there is no noise")


def test_worst_places_at_the_edge_are_cut_and_limited():
    rng = np.random.default_rng(0)
    a, b = 1.0 + 0.1 * rng.standard_normal((2, 16, 40, 40, 3))
    places = worst_regions(a * 1.5, b)
    assert len(places) == 6
    assert len(worst_regions(a * 1.5, b, most=2)) == 2
    assert all(p.x + p.width <= 40 and p.y + p.height <= 40 for p in places)


def test_worst_places_of_two_single_pictures():
    changed = patched((30, 41), 3.0)
    (place,) = worst_regions(changed[None], scene()[None])
    assert (place.x, place.y) == (32, 16)
    assert "RMS" in place.what
    assert worst_regions(scene()[None], scene()[None]) == ()
