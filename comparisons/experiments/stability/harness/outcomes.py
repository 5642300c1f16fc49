"""Outcomes out of arrays of errors."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from comparisons.experiments.methods.errors import U
from comparisons.experiments.stability.harness.family import EXAMPLES, MITSUBA, FloatArray, Outcome
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.geometry.float32 import UNIT_ROUNDOFF as U32

Ask = Callable[[int], Mapping[str, Any]]
"""A case by its number, as an example of a failure."""


def unit_of(contestant: str) -> float:
    """The unit roundoff that a contestant works in."""
    return U32 if contestant == MITSUBA else U


def outcome(errors: FloatArray, allowed: FloatArray | float, ask: Ask) -> Outcome:
    """errors (n,): above `allowed` is a failure, and so is NaN, which counts as inf."""
    errors = np.where(np.isnan(errors), np.inf, errors)
    failed: BoolArray = errors > allowed
    which = np.flatnonzero(failed)[:EXAMPLES]
    return Outcome(
        len(errors),
        int(failed.sum()),
        float(errors.max(initial=0.0)),
        examples=tuple(ask(int(i)) for i in which),
    )


def relative(value: FloatArray, exact: FloatArray) -> FloatArray:
    """|value - exact| / |exact|; 0 where both are 0, inf where one alone is."""
    off = np.abs(value - exact)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(off == 0.0, 0.0, off / np.abs(exact))


def hexed(values: Sequence[float] | FloatArray | float) -> Any:
    """Floats as `float.hex`, which rounds nothing."""
    array = np.asarray(values, np.float64)
    return [float(x).hex() for x in array.ravel()] if array.ndim else float(array).hex()


def together(found: Sequence[Mapping[str, Outcome]]) -> dict[str, Outcome]:
    """Of several materials, one."""
    total: dict[str, Outcome] = {}
    for part in found:
        for name, one in part.items():
            total[name] = total[name] + one if name in total else one
    return total
