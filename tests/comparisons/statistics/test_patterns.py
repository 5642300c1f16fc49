"""Rows, columns and smooth patterns that keep the mean of the picture."""

import numpy as np
import pytest
from renderers_that_share import RENDERERS
from scipy import stats

from comparisons.results.case import FloatArray
from comparisons.statistics import Margins, compare
from comparisons.statistics.scales import LINES, MODES, ORDERS, Pair
from comparisons.statistics.sides import side_of

SHAPE = HEIGHT, WIDTH = 48, 64


def scene() -> FloatArray:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / HEIGHT
    return (0.5 + 0.2 * np.sin(5.0 * x) * np.cos(7.0 * y))[..., None] * np.array([1.0, 0.8, 0.3])


def judged(changed: FloatArray, seed: int = 0, noise: float = 0.039):
    rng = np.random.default_rng(seed)
    shape = noise**-2
    sides = [m * rng.gamma(shape, 1.0 / shape, (16, *m.shape)) for m in (changed, scene())]
    return compare(*sides)


def keeps_the_mean(factor: FloatArray) -> FloatArray:
    """The scene times (height, width), scaled to the scene's own mean in each channel."""
    changed = scene() * factor[..., None]
    return changed * scene().mean(axis=(0, 1)) / changed.mean(axis=(0, 1))


def vignette(amount: float) -> FloatArray:
    y, x = np.mgrid[-1.0 : 1.0 : HEIGHT * 1j, -1.0 : 1.0 : WIDTH * 1j]
    return keeps_the_mean(1.0 - amount * (x**2 + y**2) / 2.0)


@pytest.mark.parametrize("along", ["row", "column"])
def test_a_line_that_tiles_and_pixels_do_not_show(along: str) -> None:
    """Two percent, ten standard errors; twice the margin that lines with edges have."""
    for seed, k in enumerate((0, 13, 47)):
        changed = scene()
        changed[(k,) if along == "row" else (slice(None), k)] *= 0.98
        result = judged(changed, seed)
        assert result.status == "differ"
        assert (
            f"rows and columns differ, though no tile and no pixel; the worst, {along} {k}: "
            in (result.reason)
        )


def test_an_edge_that_moves_by_a_fortieth_of_a_pixel_is_no_difference() -> None:
    for axis in (0, 1):
        mean = np.ones((HEIGHT, WIDTH, 3))
        mean[(slice(20),) if axis == 0 else (slice(None), slice(20))] = 1.25
        moved = mean + 0.025 * (np.roll(mean, 1, axis=axis) - mean)
        noisy = np.random.default_rng(axis).gamma(1e4, 1e-4, (2, 16, HEIGHT, WIDTH, 3))
        a, b = side_of(moved * noisy[0]), side_of(mean * noisy[1])
        where = 20 if axis == 0 else HEIGHT + 20
        found, strict = (
            LINES.test(Pair(a, b, margins), LINES.level)
            for margins in (Margins(), Margins(pixel=0.0))
        )
        assert not found.differs[where].any()
        assert strict.differs[where].all()


@pytest.mark.parametrize(("amount", "noise"), [(0.02, 0.04), (-0.02, 0.04), (0.008, 0.025)])
def test_a_vignette_that_keeps_the_mean(amount: float, noise: float) -> None:
    for seed in range(3):
        result = judged(vignette(amount), seed, noise)
        assert result.status == "differ"
        assert (
            "brightness differs smoothly over the picture, though not its mean: from the middle"
            in (result.reason)
        )


def test_each_mode_is_found_and_named() -> None:
    sides = [side_of(scene() * np.random.default_rng(k).gamma(1e4, 1e-4, (8, HEIGHT, WIDTH, 1)))
             for k in (1, 2)]  # fmt: skip
    assert MODES.test(Pair(*sides, Margins()), MODES.level).differs.sum() == 0
    waves = [
        np.outer(
            np.cos(np.pi * y * (np.arange(HEIGHT) + 0.5) / HEIGHT),
            np.cos(np.pi * x * (np.arange(WIDTH) + 0.5) / WIDTH),
        )
        for y, x in ORDERS
    ]
    for index, wave in enumerate(waves):
        changed = side_of(sides[0].pictures + 0.01 * scene().mean() * wave[..., None])
        found = MODES.test(Pair(changed, sides[1], Margins()), MODES.level)
        assert found.worst[0] == index
        expected = 0.01 * np.sqrt((wave**2).mean())
        np.testing.assert_allclose(found.difference[index] / scene().mean(), expected, rtol=0.1)
        assert found.differs[index].all()
        round_too = [index, len(ORDERS)] if index in (2, 4) else [index]
        assert not np.delete(found.differs, round_too, axis=0).any()
    changed = side_of(sides[0].pictures + 0.01 * scene().mean() * (waves[2] + waves[4])[..., None])
    assert MODES.test(Pair(changed, sides[1], Margins()), MODES.level).worst[0] == len(ORDERS)
    assert MODES.place((3,), SHAPE, 16).words == "half a wave along x and half a wave along y"
    lines = [LINES.place((k,), SHAPE, 16).words for k in (5, HEIGHT + 5)]
    assert lines == ["row 5", "column 5"]


def alarms(law: str, cases: int, counts: tuple[int, int] = (8, 16)) -> int:
    found = 0
    for seed in range(cases):
        rng = np.random.default_rng([seed, *counts, 5])
        sides = [side_of(RENDERERS[law](rng, count, 32)) for count in counts]
        found += any(
            scale.test(Pair(*sides, Margins()), scale.level).differs.any()
            for scale in (LINES, MODES)
        )
    return found


@pytest.mark.cases(3)
@pytest.mark.parametrize("law", RENDERERS)
def test_right_pictures_have_no_wrong_lines_and_modes(law: str) -> None:
    assert alarms(law, 6) == 0


@pytest.mark.slow
@pytest.mark.parametrize("law", [law for law in RENDERERS if law != "1 point light"])
def test_right_pictures_have_no_wrong_lines_and_modes_in_many_cases(law: str) -> None:
    assert alarms(law, 300) <= stats.binom.isf(1e-4, 300, 1e-4)
