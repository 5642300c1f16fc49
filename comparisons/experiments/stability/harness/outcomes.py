"""What becomes of the cases of a sweep point, by contestant: how many break the law, the first of
them word for word."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.geometry.frame import UNIT_ROUNDOFF as U32

U = 2.0**-53
"""Unit roundoff: half a unit in the last place of 1."""

FloatArray = npt.NDArray[np.float64]

OURS, MITSUBA = "ours", "mitsuba"
"""Names of contestants; textbook methods go by theirs: "sphere.algebraic"."""

EXAMPLES = 3
"""Failures of a contestant at a sweep point that are kept word for word."""


@dataclass(frozen=True)
class Outcome:
    """The result of a contestant at one sweep point.

    cases: those that were decided;  failures: those of them that break the law;  worst: the largest
    error in the series' unit, of cases that have one, failed or not (inf counts); None where none
    has, or the law is yes or no;  open: undecidable cases, such as rays that touch exactly;
    examples: failures, at most EXAMPLES, as JSON: the input (floats as `float.hex`, so that nothing
    is rounded), what was expected and what was found.
    """

    cases: int
    failures: int
    worst: float | None = None
    open: int = 0
    examples: tuple[Mapping[str, Any], ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.failures <= self.cases:
            raise ValueError(f"{self.failures} failures of {self.cases} cases")
        if self.worst is not None and math.isnan(self.worst):
            raise ValueError("the worst error is NaN: a case that gives NaN has failed, with inf")

    def __add__(self, other: "Outcome") -> "Outcome":
        """The outcome of both sets of cases together."""
        known = [x.worst for x in (self, other) if x.worst is not None]
        return Outcome(
            self.cases + other.cases,
            self.failures + other.failures,
            max(known, default=None),
            self.open + other.open,
            (self.examples + other.examples)[:EXAMPLES],
        )


Outcomes = Mapping[str, Outcome]
"""By contestant."""

Columns = dict[str, Any]
"""The keys and values of the examples of failures: see `outcome`."""


def unit_of(contestant: str) -> float:
    """The unit roundoff that a contestant works in."""
    return U32 if contestant == MITSUBA else U


def outcome(
    wrong: BoolArray,
    columns: Columns,
    undecided: BoolArray | None = None,
    worst: float | None = None,
) -> Outcome:
    """wrong (n,): which cases fail;  undecided (n,): which are left open, wrong or not.

    columns: what the examples show, by key: of an array its row, floats as hex; of a function what
    it returns for the number of the case; anything else as it is.
    """
    count = len(wrong)
    if undecided is not None:
        wrong, count = wrong & ~undecided, count - int(np.count_nonzero(undecided))
    which = np.flatnonzero(wrong)
    examples = tuple(
        {key: _shown(column, k) for key, column in columns.items()}
        for k in which[:EXAMPLES].tolist()
    )
    return Outcome(count, len(which), worst, len(wrong) - count, examples)


def _shown(column: Any, k: int) -> Any:
    if isinstance(column, np.ndarray):
        return hexed(column[k])
    return column(k) if callable(column) else column


def of_errors(errors: FloatArray, allowed: FloatArray | float, columns: Columns) -> Outcome:
    """errors (n,): above `allowed` is a failure, and so is NaN, which counts as inf."""
    errors = np.where(np.isnan(errors), np.inf, errors)
    return outcome(errors > allowed, columns, worst=float(errors.max(initial=0.0)))


def one_case(failed: bool, error: float | None, example: Mapping[str, Any]) -> Outcome:
    """A single case;  error: of `Outcome.worst`, where NaN counts as inf."""
    worst = np.inf if error is not None and np.isnan(error) else error
    return Outcome(1, int(failed), worst, examples=(example,) if failed else ())


def hexed(values: Any) -> Any:
    """Floats as `float.hex`, which rounds nothing; whole numbers and texts as they are."""
    array = np.asarray(values)
    show = float.hex if array.dtype.kind == "f" else lambda x: x
    return [show(x) for x in array.ravel().tolist()] if array.ndim else show(array.item())


def plain(values: Any) -> Callable[[int], Any]:
    """A column of numbers that are rounded for people, as JSON has them."""
    return lambda k: values[k].tolist()


def relative(value: FloatArray, exact: FloatArray) -> FloatArray:
    """|value - exact| / |exact|; 0 where both are 0, inf where one alone is."""
    off = np.abs(value - exact)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(off == 0.0, 0.0, off / np.abs(exact))


def together(parts: Iterable[Outcomes]) -> dict[str, Outcome]:
    """Outcomes added up, contestant by contestant."""
    total: dict[str, Outcome] = {}
    for part in parts:
        for name, one in part.items():
            total[name] = total[name] + one if name in total else one
    return total


def same_bits(expected: FloatArray, found: FloatArray) -> Outcome:
    """A case a pixel; worst: the largest relative difference, inf for NaN, which always fails."""
    other = (expected != found).any(axis=-1)
    size = np.maximum(np.abs(expected), np.abs(found))
    off = np.abs(expected - found) / np.where(size > 0.0, size, 1.0)
    off = np.where(np.isnan(off), np.inf, off)
    return of_pixels(other, {"expected": expected, "found": found}, float(off.max()))


def of_pixels(wrong: BoolArray, pictures: Mapping[str, FloatArray], worst: float) -> Outcome:
    """wrong (height, width): a case a pixel;  pictures: (height, width, c), of which the examples
    show the pixels."""
    y, x = (index.ravel() for index in np.indices(wrong.shape))
    columns = {name: pixels.reshape(wrong.size, -1) for name, pixels in pictures.items()}
    return outcome(wrong.ravel(), {"pixel": np.column_stack([x, y]), **columns}, worst=worst)
