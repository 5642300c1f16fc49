"""Replicates that depend on their order, or make up for each other, are told from independent
ones, whatever the law of their noise."""

from collections.abc import Callable

import numpy as np
import pytest
from noise import fireflies, lognormal, normal
from renderers_that_share import RENDERERS
from scipy import stats

from comparisons.results.case import FloatArray
from comparisons.rungs.input import input_rung
from comparisons.statistics import compare
from comparisons.statistics.order import ORDER_LEVEL, by_pairs, successive

Law = Callable[[np.random.Generator, int, int], FloatArray]


def lit_corner(rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """Rare light in a few pixels, nothing elsewhere."""
    pictures = np.zeros((count, side, side, 3))
    pictures[:, :6, :6] = (rng.random((count, 6, 6, 1)) < 0.1) * 10.0
    return pictures


LAWS: dict[str, Law] = {
    law.__name__: law for law in (normal, lognormal, fireflies, lit_corner)
} | RENDERERS


def history(pictures: FloatArray) -> FloatArray:
    found = [pictures[0]]
    for picture in pictures[1:]:
        found.append(0.9 * found[-1] + 0.1 * picture)
    return np.stack(found)


def prefixes(pictures: FloatArray) -> FloatArray:
    return np.cumsum(pictures, axis=0) / np.arange(1.0, len(pictures) + 1.0)[:, None, None, None]


def overlapping(pictures: FloatArray) -> FloatArray:
    """One fewer: each shares half of its samples with the next one.  Not the last with the first:
    in a ring of 8, eight orders have the same law, so that the level cannot be reached."""
    return 0.5 * (pictures[1:] + pictures[:-1])


@pytest.mark.cases(2)
@pytest.mark.parametrize("count", [8, 11, 16])
@pytest.mark.parametrize("law", ["normal", "lognormal", "fireflies", "photon map, radius 3"])
def test_pictures_that_go_on_from_each_other(law: str, count: int) -> None:
    rng = np.random.default_rng(count)
    for made in (history, prefixes, overlapping):
        pictures = made(LAWS[law](rng, count + 1, 32))[:count]
        found = successive(pictures)
        assert found is not None, made
        assert found.correlation > 0.2
        assert found.movement == (0, 0)
        # Not in another order, which hides the dependence from the order, not from pairs.
        assert successive(rng.permutation(pictures)) is None


@pytest.mark.parametrize("movement", [(-1, 0), (0, 1), (3, -7), (0, 0)])
def test_each_picture_is_the_one_before_moved(movement: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    x, y = movement
    noise = normal(rng, 1, 160)[0]
    own = normal(rng, 9, 160)
    pictures = np.stack(
        [0.8 * np.roll(noise, (k * y, k * x), axis=(0, 1)) + 0.2 * own[k] for k in range(9)]
    )
    found = successive(pictures)
    if not any(movement):  # all alike: the order does not matter
        assert found is None
        return
    assert found is not None
    assert found.movement == movement
    wrong = input_rung(pictures, normal(rng, 9, 160)).reason
    assert f"like the one before, moved by {x:+d}, {y:+d} pixels" in wrong


def test_the_side_that_depends_on_its_order_is_named() -> None:
    rng = np.random.default_rng(0)
    wrong, right = history(normal(rng, 16, 32)), normal(rng, 8, 32)
    for sides, name in (((wrong, right), "candidate"), ((right, wrong), "reference")):
        found = input_rung(*sides)
        assert found.status == "invalid"
        assert f"the replicates of the {name} depend on their order" in found.reason


def alarms(law: str, count: int, cases: int) -> int:
    found = 0
    for seed in range(cases):
        found += successive(LAWS[law](np.random.default_rng([seed, count]), count, 24)) is not None
    return found


@pytest.mark.cases(3)
@pytest.mark.parametrize("law", LAWS)
def test_independent_replicates_have_no_order(law: str) -> None:
    assert alarms(law, 8, 6) + alarms(law, 12, 4) == 0


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_independent_replicates_have_no_order_in_many_cases(law: str) -> None:
    cases = 100
    found = sum(alarms(law, count, cases) for count in (8, 16))
    assert found <= stats.binom.isf(1e-4, 2 * cases, ORDER_LEVEL)


def strata(rng: np.random.Generator, count: int, side: int) -> FloatArray:
    """Pictures that take turns in the strata of one pattern of each pixel."""
    turns = rng.permuted(np.tile(np.arange(count), (side * side, 1)), axis=1).T
    u = (turns + rng.random(turns.shape)) / count
    return (0.5 + u).reshape(count, side, side, 1) * np.array([1.0, 0.8, 0.5])


def test_replicates_that_make_up_for_each_other_are_judged() -> None:
    """Their mean is better than their spread says; noise that both sides share is another fault."""
    rng = np.random.default_rng(0)
    found = compare(strata(rng, 16, 48), strata(rng, 16, 48))
    assert found.status == "inconclusive", found.reason
    assert "make up for each other (negative correlation)" in found.reason
    own = normal(rng, 16, 48)
    for other in (own, rng.permutation(own), own[::-1]):
        shared = compare(own, other + 0.05 * (normal(rng, 16, 48) - 1.0))
        assert shared.status == "invalid"
        assert "they share their noise" in shared.reason


def antithetic(
    rng: np.random.Generator, count: int, side: int, exponent: float = 2.0
) -> FloatArray:
    """Pairs of pictures of u and 1 - u."""
    u = rng.random((count // 2, side, side, 3))
    both = np.stack([u, 1.0 - u], axis=1).reshape(count, side, side, 3)
    return (exponent + 1.0) * both**exponent * np.array([1.0, 0.8, 0.5])


def independent(rng: np.random.Generator, count: int, side: int) -> FloatArray:
    return 3.0 * rng.random((count, side, side, 3)) ** 2 * np.array([1.0, 0.8, 0.5])


def verdicts_of_antithetic(cases: int, gain: float = 1.0) -> list[str]:
    found = []
    for seed in range(cases):
        rng = np.random.default_rng(seed)
        a = gain * antithetic(rng, 16, 24)
        b = independent(rng, 16, 24) if seed % 2 else antithetic(rng, 16, 24)
        checked = input_rung(a, b)
        assert checked.status == "agree", checked.reason
        assert "replicates of the candidate make up for each other" in checked.reason
        found.append(compare(a, b).status)
    return found


def test_antithetic_pairs_are_judged() -> None:
    """By the means of pairs: single pictures' errors are too large for a bias of 2 %."""
    assert {*verdicts_of_antithetic(4)} <= {"agree", "inconclusive"}
    assert verdicts_of_antithetic(6, 1.02)[::2] == 3 * ["differ"]  # of two antithetic sides


def test_only_pairs_are_averaged() -> None:
    """Of right ones and of those that make up for each other otherwise each stays a replicate."""
    rng = np.random.default_rng(0)
    pairs = antithetic(rng, 16, 24)
    assert np.array_equal(by_pairs(pairs), 0.5 * (pairs[::2] + pairs[1::2]))
    moved = np.roll(pairs, 1, axis=0)
    for others in (moved, pairs[:15], pairs[:8], strata(rng, 16, 24), normal(rng, 16, 24)):
        assert by_pairs(others) is others


@pytest.mark.slow
def test_antithetic_pairs_raise_no_false_alarms() -> None:
    assert not {"differ", "invalid"} & {*verdicts_of_antithetic(200)}


def test_pictures_that_are_also_alike_do_not_only_make_up_for_each_other() -> None:
    """Each is the negative of the one before, nearly, so that the next but one is alike."""
    own = normal(np.random.default_rng(0), 16, 32) - 1.0
    pictures = [own[0]]
    for one in own[1:]:
        pictures.append(-0.8 * pictures[-1] + 0.6 * one)
    found = successive(1.0 + np.stack(pictures))
    assert found is not None
    assert found.correlation < 0.0
    assert not found.makes_up
    pairs = successive(antithetic(np.random.default_rng(0), 16, 32))
    assert pairs is not None
    assert pairs.makes_up
