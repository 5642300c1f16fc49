"""Pictures of any radiance: a factor on both sides changes no verdict, also where squares of values
are no numbers."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

import comparisons
from comparisons.results.case import Case
from reference_rt.core.arrays import FloatArray
from reference_rt.util.errors import ImageError


def pictures(seed: int, count: int = 8) -> FloatArray:
    y, x = np.mgrid[:24, :32]
    mean = (1.0 + 0.5 * np.sin(x / 5.0) * np.cos(y / 4.0))[..., None] * np.array([1.0, 0.7, 0.4])
    return mean * np.random.default_rng(seed).gamma(40.0, 1.0 / 40.0, (count, 24, 32, 1))


A, B = pictures(1), pictures(2)

PAIRS = {
    "the same law": (A, B),
    "a gain": (1.05 * A, B),
    "a gain, shared random numbers": (1.0003 * A, A),
    "shifted": (np.roll(A, 1, axis=2), B),
    "the same pictures": (A, A),
    "replicates that are the same": (A[[0] * 8], B),
    "black": (0.0 * A, B),
}


def told(case: Case) -> tuple[str, ...]:
    """The verdict, and what each rung says."""
    return (case.verdict, *(f"{rung.name} {rung.status}" for rung in case.rungs))


JUDGES: tuple[Callable[[FloatArray, FloatArray], Case], ...] = (
    comparisons.gate_pair,
    lambda a, b: comparisons.gate(list(a), reference=list(b)),
    lambda a, b: comparisons.gate(a[0], reference=b[0], noise_free=True),
)


@cache
def plain(name: str, judge: Callable[[FloatArray, FloatArray], Case]) -> tuple[str, ...]:
    return told(judge(*PAIRS[name]))


@pytest.mark.parametrize("power", [-1040, -500, -140, 126])
@pytest.mark.parametrize("name", PAIRS)
def test_a_factor_on_both_sides_changes_no_verdict(name: str, power: int) -> None:
    """1e-300 is 2^-997, 1e-150 is 2^-498."""
    a, b = PAIRS[name]
    scale = 2.0**power
    for judge in JUDGES:
        scaled = judge(scale * a, scale * b)
        assert told(scaled) == plain(name, judge)
        if abs(power) > 150 and scaled.verdict != "unchanged":
            assert any("all values are multiplied by 2^" in note for note in scaled.notes)


@pytest.mark.parametrize("power", [-1000, -30, 0, 30, 100])
def test_a_gain_without_noise_is_named_at_any_exposure(power: int) -> None:
    """Absolute tolerances would name conventions of renderers that dark pixels do not show."""
    clean = 2.0**power * A[0]
    case = comparisons.gate(1.02 * clean, reference=clean, noise_free=True)
    assert case.cause is not None
    assert case.cause.name == "constant gain of 1.02"


@pytest.mark.parametrize("scale", [1e150, 1e300])
def test_values_beyond_float32_are_refused(scale: float) -> None:
    for judge in (comparisons.gate_pair, lambda a, b: comparisons.gate(a, reference=b)):
        with pytest.raises(ImageError, match=r"expected radiance within 3.4e\+38"):
            judge(scale * A, scale * B)
