"""Formulae of the very numbers that floats are, in so many bits that floats of them are right."""

from collections.abc import Callable
from typing import Any

import numpy as np
from flint import arb, ctx

from comparisons.experiments.stability.harness.outcomes import FloatArray

BITS = 300
"""Squares of slopes at an alpha of 1e-4 and of cosines of 1e-12 leave 190 of them."""


def exactly(formula: Callable[..., Any], *columns: FloatArray) -> FloatArray:
    """(n,) or (n, k): what the formula makes of each row of columns, as floats.

    It gets the numbers of a row (of a column (n, 3) a list of three) as `arb` and returns a number
    or some.
    """
    with ctx.workprec(BITS):
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return np.array([_floats(formula(*map(_exact, row))) for row in rows])


def _exact(x: Any) -> Any:
    return [arb(v) for v in x] if isinstance(x, list) else arb(x)


def _floats(x: Any) -> Any:
    return [float(v) for v in x] if isinstance(x, tuple | list) else float(x)


def dot(a: list[arb], b: list[arb]) -> arb:
    return sum((p * q for p, q in zip(a, b, strict=True)), arb(0))


def cross(a: list[arb], b: list[arb]) -> list[arb]:
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]
