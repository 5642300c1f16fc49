"""The vocabulary of all families: contestants, the context of a sweep point, and its outcome."""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

OURS, MITSUBA = "ours", "mitsuba"
"""Names of contestants; textbook methods go by theirs: "sphere.algebraic"."""

EXAMPLES = 3
"""Failures of a contestant at a sweep point that are kept word for word."""

Effort = Literal["quick", "full"]


class Draw(NamedTuple):
    """The context that the cases of a sweep point are drawn in.

    rng: the same for the same seed, family, series and x, whatever else is measured;  cases: how
    many to draw, the sweep's number for this effort;  mitsuba: whether Mitsuba takes part;
    folder: for files, empty, removed afterwards;  effort: for what `cases` does not decide.
    """

    rng: np.random.Generator
    cases: int
    mitsuba: bool
    folder: Path
    effort: Effort = "quick"


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


class Shot(NamedTuple):
    """An image of a failure: pixels (height, width, 3) uint8 sRGB, row 0 on top, and one sentence
    that says what is to be seen."""

    pixels: npt.NDArray[np.uint8]
    caption: str


def generator(seed: int, family: str, series: str, x: float) -> np.random.Generator:
    """The random numbers of one sweep point, independent of every other's."""
    return np.random.default_rng((seed, zlib.crc32(f"{family} {series} {x!r}".encode())))


def pixel_grid(pixels: int, half: float) -> tuple[FloatArray, FloatArray]:
    """x, y (pixels², ) of the middles of a picture's pixels, from -half to half; row 0 on top."""
    ticks = (np.arange(pixels) + 0.5) / pixels * (2.0 * half) - half
    x, y = np.meshgrid(ticks, -ticks)
    return x.ravel(), y.ravel()
