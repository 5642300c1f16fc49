"""Film: the picture's size, its layers (AOVs) beside its colour, and its reconstruction filter.

Filter importance sampling: film points are drawn from a density made of the filter.  A pixel is the
integral of radiance times the filter around its centre.  Each pixel draws its own
points from the filter (Ernst et al. 2006): pixels share no samples, so that any tiling and any
number of threads give the same bits.  Where a filter is negative, points are drawn from about its
absolute value and have negative weights; the mean is unbiased, since samples are not divided by the
sum of their weights.  Lengths are in pixels.

To add a filter: its description; for a tabulated one the NamedTuple of its profile, a kernel and
its registration; `AnyFilter`; a translator function in `comparisons.mitsuba.translate`; a scene.
"""

import functools
import math
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Field

from reference_rt.core.arrays import FloatArray, IdArray
from reference_rt.core.model import Description, Positive
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.jit.links import Linkable
from reference_rt.sampling.distribution import guide, guided_cell_of, running_sums


class Filter(Description):
    """A separable filter: the product of one function of x and of y, whose integral is 1."""

    def setup(self) -> Any:
        """The NamedTuple that `film_offset` takes."""
        raise NotImplementedError

    def value(self, x: float) -> float:
        """The function at x pixels from the pixel's centre."""
        tabulated: Tabulated = self.setup()
        return float(_profile(tabulated.profile, x)) / tabulated.integral


class BoxFilter(Filter):
    """The mean over the pixel's square."""

    type: Literal["box"] = "box"

    def setup(self) -> "BoxSetup":
        return BoxSetup(1.0)

    def value(self, x: float) -> float:
        return 1.0 if -0.5 <= x < 0.5 else 0.0


class TentFilter(Filter):
    """Falls linearly to zero at `radius` pixels, in x and in y."""

    type: Literal["tent"] = "tent"
    radius: Positive = 1.0
    """Half the filter's width in x and in y, in pixels."""

    def setup(self) -> "TentSetup":
        return TentSetup(self.radius)

    def value(self, x: float) -> float:
        return max(0.0, 1.0 - abs(x) / self.radius) / self.radius


class GaussianFilter(Filter):
    """exp(-x² / 2 s²), lowered to reach zero at 4 s, in x and in y."""

    type: Literal["gaussian"] = "gaussian"
    stddev: Positive = 0.5
    """The standard deviation s, in pixels."""

    def setup(self) -> "Tabulated":
        return _tabulated(Gaussian(self.stddev, math.exp(-8.0)), 4.0 * self.stddev)


Unit = Annotated[float, Field(ge=0, le=1)]


class MitchellFilter(Filter):
    """Two cubics on each side, to 2 pixels (Mitchell & Netravali 1988, eq. 8)."""

    type: Literal["mitchell"] = "mitchell"
    b: Unit = 1.0 / 3.0
    """Blur, from 0 to 1: 1 with `c` = 0 is the cubic B-spline."""
    c: Unit = 1.0 / 3.0
    """Ringing, from 0 to 1: the authors advise b + 2 c = 1."""

    def setup(self) -> "Tabulated":
        return _tabulated(Cubics(self.b, self.c), 2.0)


class CatmullRomFilter(Filter):
    """Mitchell's filter with b = 0 and c = 1/2, which interpolates: sharp, with one ring."""

    type: Literal["catmull_rom"] = "catmull_rom"

    def setup(self) -> "Tabulated":
        return _tabulated(Cubics(0.0, 0.5), 2.0)


class LanczosFilter(Filter):
    """A sinc under the middle lobe of a wider one: sharp, with `lobes` - 1 rings (Duchon 1979)."""

    type: Literal["lanczos"] = "lanczos"
    lobes: Annotated[int, Field(ge=1, le=64)] = 3
    """Lobes on each side, from 1 to 64; also the filter's radius in pixels."""

    def setup(self) -> "Tabulated":
        return _tabulated(WindowedSinc(float(self.lobes)), float(self.lobes), 64 * 2 * self.lobes)


AnyFilter = Annotated[
    BoxFilter | TentFilter | GaussianFilter | MitchellFilter | CatmullRomFilter | LanczosFilter,
    Field(discriminator="type"),
]


class BoxSetup(NamedTuple):
    width: float


class TentSetup(NamedTuple):
    radius: float


class Gaussian(NamedTuple):
    """max(0, exp(-x² / 2 stddev²) - floor)."""

    stddev: float
    floor: float


class Cubics(NamedTuple):
    """Mitchell's and Netravali's parameters."""

    b: float
    c: float


class WindowedSinc(NamedTuple):
    lobes: float


class Tabulated(NamedTuple):
    """A tabulated filter.  It is profile / integral;  starts (cells,): where cells begin, `width`
    wide, first those where it is negative;  cumulative (cells + 1,): running sums of the cells'
    probabilities, and guides, see `distribution.guide`."""

    profile: Gaussian | Cubics | WindowedSinc
    integral: float
    starts: FloatArray
    width: float
    cumulative: FloatArray
    guides: IdArray


MOST_NEGATIVE = 0.125
"""The largest share of points that are drawn where a filter is negative."""


@functools.cache
def _tabulated(
    profile: Gaussian | Cubics | WindowedSinc, radius: float, cells: int = 256
) -> Tabulated:
    """The table of an even profile that ends at `radius` and whose kinks are at edges of cells.

    Cells are 1/64 pixel, or 1/32 of a Gaussian's s, wide; four Gauss points integrate a function
    that is smooth inside a cell to below rounding.

    Cells are as probable as the integral of the profile's absolute value, but for one factor for
    all where it is negative, which come first: together their share is a power of two.  Of n Sobol'
    points exactly that share is then negative, from n = 1 / share² on in both x and y, so that the
    weights add up to n, but for their differences within cells.  For Lanczos' filter and 64 points
    the mean weight has a standard deviation of 0.007 so, and of 0.1 without (measured).  The power
    is near 1.5 times the share of the absolute value, since fewer points suffice for a larger one.
    """
    edges = np.linspace(-radius, radius, cells + 1)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    x = middle[:, None] + half[:, None] * nodes
    values = np.array([float(_profile(profile, float(at))) for at in x.flat]).reshape(x.shape)
    masses = half * (np.abs(values) @ weights)
    masses /= masses.sum()
    negative = values @ weights < 0.0
    if negative.any():
        own = masses[negative].sum()
        share = min(2.0 ** round(math.log2(1.5 * own)), MOST_NEGATIVE)
        masses *= np.where(negative, share / own, (1.0 - share) / (1.0 - own))
    order = np.argsort(~negative, kind="stable")
    cumulative = running_sums(masses[order])
    cumulative /= cumulative[-1]
    if negative.any():
        cumulative[negative.sum()] = share
    return Tabulated(
        profile,
        float(half @ (values @ weights)),
        edges[order],
        2.0 * radius / cells,
        cumulative,
        guide(cumulative[None])[0],
    )


@kernel
def _gaussian(gaussian: Gaussian, x: float) -> float:
    z = x / gaussian.stddev
    return max(0.0, math.exp(-0.5 * z * z) - gaussian.floor)


@kernel
def _cubics(cubics: Cubics, x: float) -> float:
    b, c = cubics.b, cubics.c
    x = abs(x)
    if x < 1.0:
        return (
            ((12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)) * x * x + 6.0 - 2.0 * b
        ) / 6.0
    if x < 2.0:
        # The paper's second cubic, about its double zero at 2.
        r = 2.0 - x
        return ((b + 6.0 * c) * r - 6.0 * c) * r * r / 6.0
    return 0.0


@kernel
def _sinc(x: float) -> float:
    y = math.pi * x
    return 1.0 if y == 0.0 else math.sin(y) / y


@kernel
def _windowed_sinc(window: WindowedSinc, x: float) -> float:
    if abs(x) >= window.lobes:
        return 0.0
    return _sinc(x) * _sinc(x / window.lobes)


_profiles = ByClass("filter_profile")
_profiles.register(Gaussian, _gaussian)
_profiles.register(Cubics, _cubics)
_profiles.register(WindowedSinc, _windowed_sinc)
_profile = _profiles.function


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
def _tabulated_offset(table: Tabulated, u: float) -> tuple[float, float]:
    """Uniform inside a cell of the table; the weight is the filter over the cell's density."""
    cell = guided_cell_of(table.cumulative, table.guides, u)
    low, high = table.cumulative[cell], table.cumulative[cell + 1]
    x = table.starts[cell] + table.width * (u - low) / (high - low)
    return x, _profile(table.profile, x) / table.integral * table.width / (high - low)


_offset = ByClass("film_offset")
_offset.register(BoxSetup, _box_offset)
_offset.register(TentSetup, _tent_offset)
_offset.register(Tabulated, _tabulated_offset)
_offset_by = _offset.function

film_filters = Linkable()
"""The operation `film_offset`, on a filter's setup or on a link to one."""


@film_filters.operation
def film_offset(setup: Any, u: float) -> tuple[float, float]:
    """(offset from the pixel's centre in pixels, weight), along one axis; the expectation of
    weight * g(offset) is the filter's integral of g."""
    dx, weight = _offset_by(setup, u)
    return dx, weight


LayerName = Literal[
    "albedo", "normal", "position", "depth", "id", "variance", "bvh_steps", "intersections"
]


def _each_once(value: Any) -> Any:
    if not isinstance(value, list | tuple):
        raise ValueError("expected a list of layers, such as [albedo, normal]")
    for i, name in enumerate(value):
        if name in value[:i]:
            raise ValueError(f"'{name}' is named twice; expected each layer once")
    return tuple(value)


class Film(Description):
    """The picture: its size in pixels, its reconstruction filter and its layers."""

    width: Annotated[int, Field(ge=1, lt=2**31)] = 256
    """Columns of pixels."""
    height: Annotated[int, Field(ge=1, lt=2**31)] = 256
    """Rows of pixels; row 0 is the top of the picture."""
    filter: AnyFilter = BoxFilter()
    """The reconstruction filter: how a sample's weight in a pixel falls with its distance.
    Default: the mean over the pixel's square."""
    layers: Annotated[tuple[LayerName, ...], BeforeValidator(_each_once)] = ()
    """Which layers (AOVs) are written beside the colour.

    Means over camera rays of the first hit, weighted by the filter, 0 for misses, masked holes
    counting as hits: albedo, the material's own colour, normal, the shading normal without bump
    and normal maps, and position, the point in the world.  For the ray through the centres of pixel
    and lens: depth, the distance from the eye, inf for a miss, and id, the shape's index, -1 for a
    miss.  variance: of the pixel's mean, estimated from its samples; for `sobol` and `grid`, whose
    samples are stratified, an upper estimate.  For the ray through the
    centres, what it costs: bvh_steps, the nodes of the hierarchy whose boxes it is tested against,
    and intersections, the primitives.  Ray casting writes its own layers, and these two.
    """
