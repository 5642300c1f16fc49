"""Families of intersection methods, and the parameter sweeps (series) that they are measured in."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from comparisons.experiments.methods.vectors import across, unit_rows, unit_vectors
from comparisons.geometry.exact.dyadic import BoolArray, Fixed
from reference_rt import textbook
from reference_rt.core.arrays import FloatArray
from reference_rt.textbook import Method


class Draw(NamedTuple):
    """What a setting is generated from: the random generator, the number of rays, and a folder for
    mesh files."""

    rng: np.random.Generator
    rays: int
    folder: Path


@dataclass(frozen=True)
class Trial:
    """Rays and the shape, or the adjacent shapes, that they are traced against.  The answer is the
    nearest hit over all `parts`.

    parts: parameters of the shapes, as the family's methods take them;  o, d (n, 3): rays in random
    order;  size: the shape's largest extent;  ideal: the parameters that the exact answer is
    computed from, where those in `parts` are rounded; empty: `parts`.
    """

    parts: tuple[Any, ...]
    o: FloatArray
    d: FloatArray
    size: float
    ideal: tuple[Any, ...] = ()


Make = Callable[[Draw, float], list[Trial]]


@dataclass(frozen=True)
class Series:
    """A parameter sweep from ordinary to extreme: `make(draw, x)` for each x of `values`.

    axis: what x is, "" for a series of one setting;  about: a description for the page;  extreme:
    settings with x at or above this count as extreme;  relative: errors are in units of t alone
    instead of t plus the shape's size, for series in which t near zero matters.
    """

    name: str
    axis: str
    about: str
    values: tuple[float, ...]
    extreme: float
    make: Make
    relative: bool = False


class Truth(NamedTuple):
    """The exact answer for rays (n,).  t: in fixed point, NEVER for a miss;  touching: the ray is
    tangent, or goes exactly through an edge, so that hit and miss are both right."""

    t: Fixed
    touching: BoolArray


@dataclass(frozen=True)
class Family:
    """Methods that answer the same question about the same shape.

    exact(part, o, d): the exact answer for one part;  also: methods besides those that
    `reference_rt.textbook` registers for the family;  checked(x, wanted): how many rays of a
    setting are checked by exact arithmetic, fewer where it is slow;  build(method, part): seconds
    to build the method's acceleration structure, None for families without one.
    """

    name: str
    exact: Callable[[Any, FloatArray, FloatArray], Truth]
    also: tuple[Method, ...] = ()
    checked: Callable[[float, int], int] = lambda _x, wanted: wanted
    build: Callable[[str, Any], float] | None = None
    series: list[Series] = field(default_factory=list)

    @cached_property
    def methods(self) -> dict[str, Method]:
        """By name."""
        registered = [textbook.METHODS[name] for name in textbook.names(self.name)]
        return {method.name: method for method in (*registered, *self.also)}

    def sweep(
        self,
        name: str,
        axis: str = "",
        values: tuple[float, ...] = (1.0,),
        extreme: float = 0.0,
        *,
        relative: bool = False,
    ) -> Callable[[Make], Make]:
        """A decorator that adds a `Series` made by the function; its docstring is the series'
        description on the page."""

        def add(make: Make) -> Make:
            about = " ".join((make.__doc__ or "").split())
            self.series.append(Series(name, axis, about, values, extreme, make, relative))
            return make

        return add


def powers(*exponents: int, base: float = 10.0) -> tuple[float, ...]:
    return tuple(float(base**k) for k in exponents)


__all__ = [
    "Draw",
    "Family",
    "FloatArray",
    "Series",
    "Trial",
    "Truth",
    "across",
    "powers",
    "unit_rows",
    "unit_vectors",
]
