"""What methods are asked: series of settings, from ordinary to extreme."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.geometry.exact.dyadic import BoolArray, Fixed
from reference_rt.textbook import Method

FloatArray = npt.NDArray[np.float64]


class Draw(NamedTuple):
    """What settings are drawn with: random numbers, how many rays, a folder for meshes."""

    rng: np.random.Generator
    rays: int
    folder: Path


@dataclass(frozen=True)
class Trial:
    """Rays at one shape, or at neighbours: what they meet is the first over all `parts`.

    parts: parameters of the family;  o, d (n, 3), in no order;  size: the shape's largest extent;
    ideal: parameters of what the parts should be, where their own tables are rounded into something
    else.
    """

    parts: tuple[Any, ...]
    o: FloatArray
    d: FloatArray
    size: float
    ideal: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Series:
    """Settings that become more extreme: `make(draw, x)` for x in `values`.

    name: "distance";  axis: what x is, "" where there is one setting alone;  about: one sentence;
    extreme: from which x on a setting counts as extreme;  relative: whether errors count in units
    of t alone, not of t and the shape's size: where t near zero is what matters.
    """

    name: str
    axis: str
    about: str
    values: tuple[float, ...]
    extreme: float
    make: Callable[[Draw, float], list[Trial]]
    relative: bool = False


class Truth(NamedTuple):
    """What rays (n,) meet: t in fixed point, NEVER for a miss;  touching: a line runs exactly
    through an edge or touches, so that either answer is right."""

    t: Fixed
    touching: BoolArray


@dataclass(frozen=True)
class Family:
    """Methods that answer the same question.

    exact(part, o, d): the truth about one part;  checked(x, wanted): rays of a setting that exact
    arithmetic is asked about, where it is slow;  build(method, part): seconds to build what the
    method needs first, where that takes time.
    """

    name: str
    methods: dict[str, Method]
    series: tuple[Series, ...]
    exact: Callable[[Any, FloatArray, FloatArray], Truth]
    checked: Callable[[float, int], int] = lambda _x, wanted: wanted
    build: Callable[[str, Any], float] | None = None


def unit_vectors(rng: np.random.Generator, n: int) -> FloatArray:
    """(n, 3), evenly over the sphere."""
    v = rng.normal(size=(n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def across(rng: np.random.Generator, v: FloatArray) -> FloatArray:
    """Unit vectors at right angles to the vectors v (n, 3)."""
    return unit_rows(np.cross(v, unit_vectors(rng, len(v))))


def unit_rows(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def powers(*exponents: int, base: float = 10.0) -> tuple[float, ...]:
    return tuple(float(base**k) for k in exponents)
