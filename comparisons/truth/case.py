"""A case of truth: a scene file, and a function that computes its picture without a renderer."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from importlib import import_module
from typing import TypeVar

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

AREAS = {
    "rays": "rays and cameras",
    "photometry": "photometry",
    "materials": "materials",
    "visibility": "visibility",
    "transport": "transport",
    "whitted": "recursive ray tracing",
    "solids": "solids, instances, meshes",
    "signal": "signal",
    "media": "media",
    "scattering": "scattering",
    "atmospheres": "half spaces and slabs",
}
"""The areas: the module of each, and its title."""

QUADRATURE = 1e-10
"""Relative error of what a quadrature computes, at most; tests halve the cells to see it."""


@dataclass(frozen=True)
class Expected:
    """What a right picture holds.

    pixels: (height, width, 3), the mean over each pixel's footprint (with the scene's filter), NaN
    where the formula states nothing;  bound: relative error of the formula itself, of the mean of
    any region.
    """

    pixels: FloatArray
    bound: float = QUADRATURE

    def __post_init__(self) -> None:
        if self.pixels.ndim == 2:
            object.__setattr__(self, "pixels", np.repeat(self.pixels[..., None], 3, axis=2))

    @cached_property
    def stated(self) -> npt.NDArray[np.bool_]:
        """(height, width): the pixels that the formula states."""
        return np.asarray(np.isfinite(self.pixels).all(axis=-1))


@dataclass(frozen=True)
class Case:
    """name: of the case and its scene file;  area: a key of AREAS;  formula: in one line, with
    LaTeX between dollars;  tests: what a renderer must do for it;  source: of the formula;
    derivation: in a few sentences."""

    name: str
    area: str
    formula: str
    tests: str
    source: str
    derivation: str
    compute: Callable[..., Expected]


@dataclass(frozen=True)
class Derivative(Case):
    """A case whose formula is the derivative of another's picture by a parameter of its scene.

    of: that case;  parameter: the path in the scene;  argument: of the function `of.compute`, the
    parameter's value;  spp, step: of differences of a renderer; None: the scene's, and as many as
    are usual.
    """

    of: Case
    parameter: str
    argument: str
    spp: int | None
    step: float | None


_CASES: dict[str, Case] = {}
_DERIVATIVES: dict[str, Derivative] = {}

Formula = Callable[..., Expected]


def case(formula: str, tests: str, source: str = "elementary") -> Callable[[Formula], Formula]:
    """Register a function as the case of its name, in the area of its module."""

    def register(function: Formula) -> Formula:
        area = function.__module__.rpartition(".")[2]
        name = function.__name__
        text = " ".join((function.__doc__ or "").split())
        _CASES[name] = Case(name, area, formula, tests, source, text, function)
        return function

    return register


def derivative(
    parameter: str, of: Formula, argument: str, formula: str, *,
    spp: int | None = None, step: float | None = None,
) -> Callable[[Formula], Formula]:  # fmt: skip
    """Register a function as the derivative of a case, in the case's module; see `Derivative`."""

    def register(function: Formula) -> Formula:
        case = _CASES[of.__name__]
        name = function.__name__
        text = " ".join((function.__doc__ or "").split())
        tests = f"`{case.name}` by `{parameter}`"
        _DERIVATIVES[name] = Derivative(
            name, case.area, formula, tests, case.source, text, function,
            case, parameter, argument, spp, step,
        )  # fmt: skip
        return function

    return register


C = TypeVar("C", bound=Case)


def _in_order(known: dict[str, C]) -> dict[str, C]:
    for area in AREAS:
        import_module(f"comparisons.truth.areas.{area}")
    order = list(AREAS)
    return dict(sorted(known.items(), key=lambda item: order.index(item[1].area)))


def cases() -> dict[str, Case]:
    """All cases by name, in the order of AREAS."""
    return _in_order(_CASES)


def derivatives() -> dict[str, Derivative]:
    """All derivatives by name, in the order of AREAS."""
    return _in_order(_DERIVATIVES)


def chosen(names: Sequence[str], known: Mapping[str, C] | None = None) -> list[C]:
    """The cases of these names, areas, or patterns such as 'glass_*'; all for none, or for "all".

    known: the cases by name, default `cases()`.  Raises ValueError for one that matches nothing.
    """
    known = cases() if known is None else known  # type: ignore[assignment]
    assert known is not None
    selected: dict[str, C] = {}
    for name in names or ("all",):
        some = [
            one
            for one in known.values()
            if name in ("all", one.area) or fnmatchcase(one.name, name)
        ]
        if not some:
            raise ValueError(
                f"there is no case '{name}'; expected all, a pattern such as 'glass_*', an area "
                f"({', '.join(AREAS)}) or a case: {', '.join(known)}"
            )
        selected |= {one.name: one for one in some}
    return list(selected.values())
