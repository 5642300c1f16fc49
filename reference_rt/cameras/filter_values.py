"""Reconstruction filters as functions: their values, and where they end, for light that is added to
all pixels around a film point."""

from typing import Any

from reference_rt.cameras.film import BoxSetup, Tabulated, TentSetup, film_filters, weight_in
from reference_rt.jit.kernel import by_class, kernel


@kernel
def _box_value(box: BoxSetup, x: float) -> float:
    return 1.0 if -0.5 <= x < 0.5 else 0.0


@kernel
def _tent_value(tent: TentSetup, x: float) -> float:
    return max(0.0, 1.0 - abs(x) / tent.radius) / tent.radius


@kernel
def _tabulated_value(table: Tabulated, x: float) -> float:
    """The weight in the cell of x times the density there, 1 / (half * cells[k, 2])."""
    cells = table.cells
    at = 0.5 * x / table.half + 0.5 * len(cells)
    if not 0.0 <= at < len(cells):
        return 0.0
    k = table.place[int(at)]
    if cells[k, 2] == 0.0:
        return 0.0
    weight = weight_in(cells, k, (x - cells[k, 0]) / table.half)
    return float(weight / (table.half * cells[k, 2]))


_value_by = by_class(
    "filter_value", {BoxSetup: _box_value, TentSetup: _tent_value, Tabulated: _tabulated_value}
)


@film_filters.operation
def filter_value(setup: Any, x: float) -> float:
    """The filter along one axis, x pixels from the pixel's centre; its integral is 1."""
    found: float = _value_by(setup, x)
    return found


@kernel
def _box_reach(box: BoxSetup) -> float:
    return 0.5 * box.width


@kernel
def _tent_reach(tent: TentSetup) -> float:
    return tent.radius


@kernel
def _tabulated_reach(table: Tabulated) -> float:
    return table.half * len(table.cells)


_reach_by = by_class(
    "filter_reach", {BoxSetup: _box_reach, TentSetup: _tent_reach, Tabulated: _tabulated_reach}
)


@film_filters.operation
def filter_reach(setup: Any) -> float:
    """How far from a pixel's centre the filter is not 0, in pixels."""
    found: float = _reach_by(setup)
    return found
