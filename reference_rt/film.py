"""Film: the picture's size, and reconstruction filters as densities to draw film points from.

A pixel is the integral of radiance times the filter around its centre.  Each pixel draws its own
points from the filter (filter importance sampling, Ernst et al. 2006): pixels share no samples, so
that any tiling and any number of threads give the same bits.
"""

import math
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

from reference_rt.description import Description, Positive
from reference_rt.kernel import ByClass, kernel
from reference_rt.shapes.shape import FloatArray


class BoxFilter(Description):
    """The pixel's own square, evenly."""

    type: Literal["box"] = "box"

    def setup(self) -> "BoxSetup":
        return BoxSetup(1.0)


class TentFilter(Description):
    """Falls linearly to zero at `radius` pixels, in x and in y."""

    type: Literal["tent"] = "tent"
    radius: Positive = 1.0

    def setup(self) -> "TentSetup":
        return TentSetup(self.radius)


class GaussianFilter(Description):
    """exp(-x² / 2 s²), lowered to reach zero at 4 s, in x and in y."""

    type: Literal["gaussian"] = "gaussian"
    stddev: Positive = 0.5
    """s, in pixels."""

    def setup(self) -> "GaussianSetup":
        edges = np.linspace(-4.0 * self.stddev, 4.0 * self.stddev, GAUSSIAN_CELLS + 1)
        floor = math.exp(-8.0)
        integrals = [_gaussian_integral(float(x), self.stddev, floor) for x in edges]
        cumulative = np.array(integrals) / integrals[-1]
        return GaussianSetup(self.stddev, floor, integrals[-1], edges, cumulative)


AnyFilter = Annotated[BoxFilter | TentFilter | GaussianFilter, Field(discriminator="type")]


class Film(Description):
    """The picture: its size in pixels and its reconstruction filter."""

    width: Annotated[int, Field(ge=1, lt=2**31)] = 256
    height: Annotated[int, Field(ge=1, lt=2**31)] = 256
    filter: AnyFilter = BoxFilter()


class BoxSetup(NamedTuple):
    width: float


class TentSetup(NamedTuple):
    radius: float


GAUSSIAN_CELLS = 256
"""Cells of the table that draws from the Gaussian; the weights undo what it approximates."""


class GaussianSetup(NamedTuple):
    """The filter is (exp(-x² / 2 stddev²) - floor) / integral; edges and cumulative (cells + 1,)
    are its distribution, linear between them."""

    stddev: float
    floor: float
    integral: float
    edges: FloatArray
    cumulative: FloatArray


def _gaussian_integral(x: float, stddev: float, floor: float) -> float:
    """The integral of exp(-x² / 2 s²) - floor from -4 s to x."""
    z = x / (stddev * math.sqrt(2.0))
    area = stddev * math.sqrt(math.pi / 2.0) * (math.erf(z) + math.erf(4.0 / math.sqrt(2.0)))
    return area - floor * (x + 4.0 * stddev)


@kernel
def _box_offset(box: BoxSetup, u: float) -> tuple[float, float]:
    return box.width * (u - 0.5), 1.0


@kernel
def _tent_offset(tent: TentSetup, u: float) -> tuple[float, float]:
    """The inverse of the tent's distribution, half by half."""
    if u < 0.5:
        return tent.radius * (math.sqrt(2.0 * u) - 1.0), 1.0
    return tent.radius * (1.0 - math.sqrt(2.0 * (1.0 - u))), 1.0


@kernel
def _gaussian_offset(gaussian: GaussianSetup, u: float) -> tuple[float, float]:
    """Linear inside a cell of the table; the weight is the filter over that cell's density."""
    edges, cumulative = gaussian.edges, gaussian.cumulative
    cell = int(np.searchsorted(cumulative, u, "right")) - 1
    cell = min(max(cell, 0), len(edges) - 2)
    low, high = cumulative[cell], cumulative[cell + 1]
    span = edges[cell + 1] - edges[cell]
    x = edges[cell] + span * (u - low) / (high - low)
    z = x / gaussian.stddev
    value = max(0.0, math.exp(-0.5 * z * z) - gaussian.floor) / gaussian.integral
    return x, value * span / (high - low)


_offset = ByClass("film_offset")
_offset.register(BoxSetup, _box_offset)
_offset.register(TentSetup, _tent_offset)
_offset.register(GaussianSetup, _gaussian_offset)
film_offset = _offset.function
"""film_offset(setup, u) -> (offset from the pixel's centre in pixels, weight), along one axis; the
expectation of weight * g(offset) is the filter's integral of g."""
