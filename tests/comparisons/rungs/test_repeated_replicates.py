"""Replicates that repeat others, bit for bit or but for rounding, are invalid in any pattern;
independent ones are not, whatever their noise and their rounding."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from noise import fireflies, lognormal, normal
from renderers_that_share import RENDERERS, independent

from comparisons.results.case import FloatArray
from comparisons.rungs.input import input_rung
from comparisons.statistics.repeated import Rounding

LAWS = {law.__name__: law for law in (normal, lognormal, fireflies)}

PATTERNS = {
    "all the same": [0, 0, 0, 0, 0, 0, 0, 0],
    "two in turn": [0, 1, 0, 1, 0, 1, 0, 1],
    "three in turn": [0, 1, 2, 0, 1, 2, 0, 1],
    "the first is the last": [0, 1, 2, 3, 4, 5, 6, 0],
    "each twice": [0, 0, 1, 1, 2, 2, 3, 3],
    "one half is the other": [0, 1, 2, 3, 0, 1, 2, 3],
    "one pair": [0, 1, 2, 3, 4, 2, 5, 6],
}
"""Which picture each of eight replicates is."""


def in_another_order(x: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Sums of float32 that threads add in another order each time."""
    return x * (1.0 + 1e-6 * rng.standard_normal(x.shape))


def to_8_bits(x: FloatArray) -> FloatArray:
    """Encoded as sRGB, and decoded again, after an exposure."""
    shown = np.clip(0.4 * x, 0.0, 1.0)
    encoded = np.where(
        shown <= 0.0031308, 12.92 * shown, 1.055 * np.maximum(shown, 1e-9) ** (1 / 2.4) - 0.055
    )
    codes = np.round(255.0 * encoded) / 255.0
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4) / 0.4


ROUNDED: dict[str, Callable[[FloatArray], FloatArray]] = {
    "not rounded": lambda x: x,
    "half floats": lambda x: x.astype(np.float16).astype(np.float64),
    "8 bits": to_8_bits,
}


def is_hidden(law: str, pattern: str, rounded: str, ordered: bool) -> bool:
    """All replicates differ by coarse rounding alone, as those of many samples do, and no other
    picture than the reference shows that they share noise: events that are rare hide that."""
    same = pattern == "all the same" and not ordered
    return same and rounded != "not rounded" and law != "normal"


REPEATED = [
    case for case in product(LAWS, PATTERNS, ROUNDED, (True, False)) if not is_hidden(*case)
]


@pytest.mark.cases(14)
@pytest.mark.parametrize(("law", "pattern", "rounded", "ordered"), REPEATED)
def test_repeated_replicates_are_invalid(
    law: str, pattern: str, rounded: str, ordered: bool
) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        candidate = LAWS[law](rng, 8, 32)[PATTERNS[pattern]]
        if not ordered:
            candidate = in_another_order(candidate, rng)
        found = input_rung(ROUNDED[rounded](candidate), LAWS[law](rng, 16, 32))
        assert found.status == "invalid"
        assert "the same" in found.reason or "share noise" in found.reason


def right(law: str, count: int, seed: int) -> FloatArray:
    rng = np.random.default_rng([seed, count])
    return (LAWS | RENDERERS)[law](rng, count, 24)


def alarms(law: str, rounded: str, seeds: range, noise: float = 1.0) -> list[str]:
    """noise: so many times that of the law."""
    found = []
    for seed in seeds:
        a, b = right(law, 8, seed), right(law, 16, 1000 + seed)
        mean = b.mean(axis=0)
        a = ROUNDED[rounded](np.maximum(mean + noise * (a - mean), 0.0))
        reason = input_rung(a, b).reason
        if "the same" in reason or "share noise" in reason:
            found.append(f"{law} {rounded} {noise}: {reason}")
    return found


@pytest.mark.cases(8)
@pytest.mark.parametrize("rounded", ROUNDED)
@pytest.mark.parametrize("law", [*LAWS, *RENDERERS])
def test_independent_replicates_are_not_repeated(law: str, rounded: str) -> None:
    assert not alarms(law, rounded, range(2))


@pytest.mark.slow
@pytest.mark.parametrize("rounded", ROUNDED)
@pytest.mark.parametrize("law", [*LAWS, *RENDERERS])
def test_independent_replicates_are_not_repeated_in_many_cases(law: str, rounded: str) -> None:
    assert not alarms(law, rounded, range(40))


@pytest.mark.cases(2)
@pytest.mark.parametrize("noise", [0.1, 1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("rounded", ["half floats", "8 bits"])
def test_noise_that_rounding_hides_is_not_repeated(rounded: str, noise: float) -> None:
    """The candidate has many more samples than the reference."""
    for law in LAWS:
        found = alarms(law, rounded, range(3), noise)
        assert not [one for one in found if "bit for bit" not in one], found


def test_pictures_without_noise_are_not_repeated() -> None:
    """Both sides are deterministic, or differ in the last bits."""
    rng = np.random.default_rng(0)
    picture = normal(rng, 1, 24)
    for made in (lambda x: x, lambda x: in_another_order(x, rng)):
        for rounded in ROUNDED.values():
            a, b = (rounded(made(np.repeat(picture, 8, axis=0))) for _ in range(2))
            assert input_rung(a, b).status == "agree"


def test_a_step_is_that_of_the_values() -> None:
    rng = np.random.default_rng(0)
    x = independent("8 point lights", rng, 4, 16)
    assert not Rounding(x).coarse
    for name in ("half floats", "8 bits"):
        rounded = Rounding(ROUNDED[name](x))
        assert rounded.coarse
        assert np.all(rounded.step > 0.0)
        assert rounded.repeats() == []
