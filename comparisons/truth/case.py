"""A case of truth: a scene file, and a function that computes its picture without a renderer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from importlib import import_module

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
    compute: Callable[[], Expected]


_CASES: dict[str, Case] = {}

Formula = Callable[[], Expected]


def case(formula: str, tests: str, source: str = "elementary") -> Callable[[Formula], Formula]:
    """Register a function as the case of its name, in the area of its module."""

    def register(function: Formula) -> Formula:
        area = function.__module__.rpartition(".")[2]
        name = function.__name__
        text = " ".join((function.__doc__ or "").split())
        _CASES[name] = Case(name, area, formula, tests, source, text, function)
        return function

    return register


def cases() -> dict[str, Case]:
    """All cases by name, in the order of AREAS."""
    for area in AREAS:
        import_module(f"comparisons.truth.areas.{area}")
    order = list(AREAS)
    return dict(sorted(_CASES.items(), key=lambda item: order.index(item[1].area)))


def chosen(names: Sequence[str]) -> list[Case]:
    """The cases of these names, areas, or patterns such as 'glass_*'; all for none, or for "all".
    Raises ValueError for one that matches nothing."""
    known = cases()
    selected: dict[str, Case] = {}
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
