"""The level of statistical cases: right renderers pass, and 1 % is seen."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from comparisons.experiments.stability import furnaces
from comparisons.experiments.stability.bsdfs.samples import PURE
from comparisons.experiments.stability.furnaces import COSINES
from comparisons.experiments.stability.harness import chance
from comparisons.experiments.stability.harness.chance import Mean
from comparisons.experiments.stability.harness.outcomes import FloatArray
from comparisons.experiments.stability.harness.series import family
from comparisons.experiments.stability.harness.worlds import judge
from comparisons.experiments.stability.media.turns import phases_of


def test_the_level_of_a_full_run_is_that_of_all_its_tests() -> None:
    """The table of `chance`, counted; the areas and radiances of 1 are drawn once."""
    f10, f11, f12, f14 = (family(name).by_name for name in ("F10", "F11", "F12", "F14"))
    closed = len(f10["closed furnace"].values)
    opened = len(f10["open furnace"].values) * len(furnaces._white(0.1)) * len(COSINES)
    densities = len(f11["densities"].values) * len(PURE) * 3
    lamps = [
        (2 * len(f12[name].values) - 1) * kinds
        for name, kinds in (("light area", 4), ("radiance", 2))
    ]
    roulette = 3 * len(f12["roulette"].values)
    assert (closed, opened, densities, *lamps, roulette) == (8, 432, 135, 52, 26, 24)
    media = [
        len(f14[name].values) * cases
        for name, cases in (
            ("half spaces", 1),
            ("white layers", 3),
            ("unlike colours", 3),
            ("absorption behind glass", 1),
            ("phase densities", len(phases_of(2.0))),
        )
    ]
    assert media == [6, 33, 15, 14, 18]
    tests = closed + 2 * opened + densities + sum(lamps) + roulette + sum(media)
    assert tests == 1195
    assert 2 * chance.LEVEL * tests < 2.4e-5


def stages(*means: Mean) -> Callable[[int], Mean]:
    return lambda stage: means[stage]


@pytest.mark.parametrize(
    ("means", "failed"),
    [
        ([Mean(1.3, 0.1)], False),
        ([Mean(1.5, 0.1), Mean(1.1, 0.05)], False),
        ([Mean(1.5, 0.1), Mean(1.4, 0.05)], True),
        ([Mean(1.5, 0.1), Mean(0.6, 0.05)], False),
        ([Mean(1.0, 0.0)], False),
        ([Mean(1.001, 0.0), Mean(1.001, 0.0)], True),
        ([Mean(1.001, 0.0), Mean(1.001, 0.01)], False),
        ([Mean(math.nan, 0.1)], True),
        ([Mean(1.5, 0.1), Mean(math.inf, 0.1)], True),
        ([Mean(1.5, math.nan), Mean(1.5, math.nan)], True),
    ],
)
def test_two_stages(means: list[Mean], failed: bool) -> None:
    assert chance.fails(stages(*means), 1.0, 0.0)[0] == failed


def test_what_rounding_allows_does_not_fail() -> None:
    assert not chance.fails(stages(Mean(1.001, 0.0)), 1.0, 0.01)[0]


def test_noise_is_no_excuse_for_everything() -> None:
    vague = stages(Mean(0.5, 0.4), Mean(0.6, 0.4))
    assert not chance.fails(vague, 1.0, 0.0)[0]
    assert chance.fails(vague, 1.0, 0.0, 0.1)[0]
    assert not chance.fails(stages(Mean(0.5, 0.4), Mean(0.95, 0.4)), 1.0, 0.0, 0.1)[0]


def test_right_pictures_are_as_seldom_suspect_as_is_said() -> None:
    """Of pixels whose noise is exponential, as that of paths' lengths is, within three times 1e-4;
    both stages multiply."""
    rng, n, suspects = np.random.default_rng(3), 50_000, 0
    for _ in range(10):
        pixels = rng.standard_exponential((n // 10, 256))
        error = pixels.std(axis=1, ddof=1) / 16.0
        suspects += int((np.abs(pixels.mean(axis=1) - 1.0) > chance.ERRORS * error).sum())
    assert suspects < 60 * n * math.sqrt(chance.LEVEL)


def test_bernsteins_bound_holds_for_rare_losses() -> None:
    """Weights of 1 of which one in a thousand is lost: of 1,000 numbers many samples see none."""
    rng, n = np.random.default_rng(4), 1_000
    lost = rng.binomial(n, 1e-3, 20_000)
    means = 1.0 - lost / n
    errors = np.sqrt(means * (1.0 - means) / (n - 1))
    allowed = np.array([chance.bernstein(error, 1.0, n) for error in errors])
    assert (lost == 0).mean() > 0.3
    assert (np.abs(means - 0.999) <= allowed).all()


def test_pictures_are_judged() -> None:
    def noisy(factor: float) -> Callable[[int, int], FloatArray]:
        def render(seed: int, spp: int) -> FloatArray:
            noise = np.random.default_rng(seed).normal(0.0, 0.4 / math.sqrt(spp), (1024, 3))
            return factor * (2.0 + noise)

        return render

    def bad(seed: int, spp: int) -> FloatArray:
        pixels = noisy(1.0)(seed, spp)
        pixels[3, 1] = math.nan
        return pixels

    rendered = {"right": noisy(1.0), "dark": noisy(0.99), "bright": noisy(1.01), "nan": bad}
    found = judge(rendered, (5, 6), 16, 2.0, lambda who: 0.0, {})
    assert found["right"].failures == 0
    assert found["dark"].failures == found["bright"].failures == 1
    assert found["nan"].failures == 1
    assert found["nan"].worst == math.inf
    assert found["nan"].examples[0]["expected"] == 2.0
