"""Film: the picture's size, its layers (AOVs) beside its colour, and its reconstruction filter.

Filter importance sampling: film points are drawn from a density made of the filter.  A pixel is the
integral of radiance times the filter around its centre.  Each pixel draws its own
points from the filter (Ernst et al. 2006): pixels share no samples, so that any tiling and any
number of threads give the same bits.  Where a filter is negative, points are drawn from about its
absolute value and have negative weights; the mean is unbiased, since samples are not divided by the
sum of their weights.  With Sobol' points the samples of each sign are a sequence of their own, see
`Strata`.  Lengths are in pixels.

To add a filter: its description, a `TabulatedFilter` by default; `AnyFilter`; a translator function
in `comparisons.translator`; a scene.
"""

import functools
import math
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Field

from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.core.model import Description, Examples, Positive
from reference_rt.jit.kernel import by_class, kernel
from reference_rt.jit.links import Linkable
from reference_rt.sampling.blocks import BLOCK_SAMPLES, SINGLY
from reference_rt.sampling.distribution import guide, guided_cell_of, running_sums
from reference_rt.sampling.independent import combine


class Filter(Description):
    """A separable filter: the product of one function of x and of y, whose integral is 1."""

    def setup(self) -> Any:
        """The NamedTuple that `film_offset` takes."""
        raise NotImplementedError

    def value(self, x: float) -> float:
        """The function at x pixels from the pixel's centre."""
        raise NotImplementedError


class TabulatedFilter(Filter):
    """A filter that is drawn through a table."""

    @property
    def cells(self) -> int:
        """The number of cells of the table."""
        return 256

    @property
    def reach(self) -> float:
        """Where the filter ends."""
        return 2.0

    def profile(self, x: float) -> float:
        """The filter at 0 <= x <= `reach`, times any number.  It is smooth inside a cell."""
        raise NotImplementedError

    def setup(self) -> "Tabulated":
        return _tabulated(self)[0]

    def value(self, x: float) -> float:
        return self.profile(abs(x)) / _tabulated(self)[1] if abs(x) < self.reach else 0.0


class BoxFilter(Filter):
    """The mean over the pixel's square."""

    type: Literal["box"] = "box"

    def setup(self) -> "BoxSetup":
        return BoxSetup(1.0)

    def value(self, x: float) -> float:
        return 1.0 if -0.5 <= x < 0.5 else 0.0


class TentFilter(Filter):
    """Falls linearly to zero at `radius` pixels, in x and in y."""

    EXAMPLES: ClassVar[Examples] = ({}, {"radius": 1.5})
    type: Literal["tent"] = "tent"
    radius: Positive = 1.0
    """Half the filter's width in x and in y, in pixels."""

    def setup(self) -> "TentSetup":
        return TentSetup(self.radius)

    def value(self, x: float) -> float:
        return max(0.0, 1.0 - abs(x) / self.radius) / self.radius


class GaussianFilter(TabulatedFilter):
    """exp(-x² / 2 s²), lowered to reach zero at 4 s, in x and in y."""

    EXAMPLES: ClassVar[Examples] = ({}, {"stddev": 0.8})
    type: Literal["gaussian"] = "gaussian"
    stddev: Positive = 0.5
    """The standard deviation s, in pixels."""

    @property
    def reach(self) -> float:
        return 4.0 * self.stddev

    def profile(self, x: float) -> float:
        return math.exp(-0.5 * (x / self.stddev) ** 2) - math.exp(-8.0)


Unit = Annotated[float, Field(ge=0, le=1)]


class MitchellFilter(TabulatedFilter):
    """Two cubics on each side, to 2 pixels (Mitchell & Netravali 1988, eq. 8)."""

    EXAMPLES: ClassVar[Examples] = ({}, {"b": 0.2, "c": 0.4})
    type: Literal["mitchell"] = "mitchell"
    b: Unit = 1.0 / 3.0
    """Blur, from 0 to 1: 1 with `c` = 0 is the cubic B-spline."""
    c: Unit = 1.0 / 3.0
    """Ringing, from 0 to 1: the authors advise b + 2 c = 1."""

    def profile(self, x: float) -> float:
        b, c = self.b, self.c
        if x < 1.0:
            cubic = (12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)
            return (cubic * x * x + 6.0 - 2.0 * b) / 6.0
        # The paper's second cubic, about its double zero at 2.
        r = 2.0 - x
        return ((b + 6.0 * c) * r - 6.0 * c) * r * r / 6.0


class CatmullRomFilter(TabulatedFilter):
    """Mitchell's filter with b = 0 and c = 1/2, which interpolates: sharp, with one ring."""

    type: Literal["catmull_rom"] = "catmull_rom"

    def profile(self, x: float) -> float:
        return MitchellFilter(b=0.0, c=0.5).profile(x)


class LanczosFilter(TabulatedFilter):
    """A sinc under the middle lobe of a wider one: sharp, with `lobes` - 1 rings (Duchon 1979)."""

    EXAMPLES: ClassVar[Examples] = ({}, {"lobes": 2})
    type: Literal["lanczos"] = "lanczos"
    lobes: Annotated[int, Field(ge=1, le=64)] = 3
    """Lobes on each side, from 1 to 64; also the filter's radius in pixels."""

    @property
    def cells(self) -> int:
        return 64 * 2 * self.lobes

    @property
    def reach(self) -> float:
        return float(self.lobes)

    def profile(self, x: float) -> float:
        return float(np.sinc(x) * np.sinc(x / self.lobes))


AnyFilter = Annotated[
    BoxFilter | TentFilter | GaussianFilter | MitchellFilter | CatmullRomFilter | LanczosFilter,
    Field(discriminator="type"),
]


class BoxSetup(NamedTuple):
    width: float


class TentSetup(NamedTuple):
    radius: float


_DEGREE = 5


STRATA = 64
"""Samples that are shared out among the strata of a filter's signs."""


class Strata(NamedTuple):
    """A pixel's samples by the filter's signs: positive, negative in y alone, in x alone, in both.

    Each stratum has samples of its own pixel's numbers: a sequence that is stratified by itself.
    With one sequence for all, the difference between positive and negative samples was noise of
    everything that a path depends on, as if its numbers were independent (measured on a checkered
    ball, 64 samples: 1.7 to 2.0 times the variance).

    of (BLOCK_SAMPLES, STRATA): the strata of STRATA samples in turn, in orders that shift those of
    each BLOCK_SAMPLES in all ways;  rank, of the same shape: how many of its stratum are before it;
    size (4,): how many each stratum has;  weight (4,): the share of a stratum in the filter's
    points over that.
    """

    of: IntArray
    rank: IntArray
    size: IntArray
    weight: FloatArray


class Tabulated(NamedTuple):
    """A tabulated filter.  cells (n, 9), first those where the filter is negative: the middle of a
    cell; the middle of the numbers that draw it, and the inverse of half their width; coefficients
    of the weight, a polynomial from -1 to 1 in the cell;  place (n,): the row of each cell, along
    the axis;  half: half the width of a cell;
    cumulative (n + 1,): running sums of the cells' probabilities, and guides, see
    `distribution.guide`;  share: of the points where it is negative, 0 if it is nowhere;  strata:
    empty for none."""

    cells: FloatArray
    place: IntArray
    half: float
    cumulative: FloatArray
    guides: IdArray
    share: float
    strata: Strata


MOST_NEGATIVE = 0.125
"""The largest share of points that are drawn where a filter is negative."""


@functools.cache
def _tabulated(filter_of: TabulatedFilter) -> tuple[Tabulated, float]:
    """The table of a filter whose kinks are at edges of cells, and the integral of its profile.

    Cells are 1/64 pixel, or 1/32 of a Gaussian's s, wide; four Gauss points integrate a function
    that is smooth inside a cell to below rounding, and so does a polynomial of degree 5 through its
    values at Chebyshev's nodes: to 1e-14 of the filter's maximum.  (Measured: weights
    from the exponential function took a tenth of the time of a picture.)

    Cells are as probable as the integral of the profile's absolute value, but for one factor for
    all where it is negative, which come first: together their share is a power of two.  Of n Sobol'
    points exactly that share is then negative, from n = 1 / share² on in both x and y, so that the
    weights add up to n, but for their differences within cells.  For Lanczos' filter and 64 points
    the mean weight has a standard deviation of 0.007 so, and of 0.1 without (measured).  The power
    is near 1.5 times the share of the absolute value, since fewer points suffice for a larger one.
    """
    radius, count = filter_of.reach, filter_of.cells
    half = radius / count
    middles = half * np.arange(1 - count, count, 2)

    def at(nodes: FloatArray) -> FloatArray:
        x = np.abs(middles[:, None] + half * nodes)
        return np.array([filter_of.profile(float(at)) for at in x.flat]).reshape(x.shape)

    nodes, weights = np.polynomial.legendre.leggauss(4)
    values = at(nodes)
    masses = np.abs(values) @ weights
    masses /= masses.sum()
    negative = values @ weights < 0.0
    share, strata = 0.0, _NO_STRATA
    if negative.any():
        own = masses[negative].sum()
        share = min(2.0 ** round(math.log2(1.5 * own)), MOST_NEGATIVE)
        strata = _strata(float(own), share)
        masses *= np.where(negative, share / own, (1.0 - share) / (1.0 - own))
    order = np.argsort(~negative, kind="stable")
    cumulative = running_sums(masses[order])
    cumulative /= cumulative[-1]
    if negative.any():
        cumulative[negative.sum()] = share
    integral = half * (values @ weights).sum()
    nodes = np.polynomial.chebyshev.chebpts1(_DEGREE + 1)
    polynomials = np.linalg.solve(np.vander(nodes, increasing=True), at(nodes).T).T
    drawn = np.diff(cumulative)
    inverse = np.divide(2.0, drawn, out=np.zeros(count), where=drawn > 0.0)
    polynomials = polynomials[order] * (half / integral * inverse[:, None])
    middles_of_u = 0.5 * (cumulative[1:] + cumulative[:-1])
    cells = np.column_stack([middles[order], middles_of_u, inverse, polynomials])
    guides = guide(cumulative[None])[0]
    place = np.argsort(order)
    return Tabulated(cells, place, half, cumulative, guides, share, strata), float(integral)


_NOTHING = np.zeros((0, STRATA), np.int64)
_NO_STRATA = Strata(_NOTHING, _NOTHING, np.zeros(0, np.int64), np.zeros(0))


def _strata(mass: float, share: float) -> Strata:
    """mass: of the filter's absolute value along an axis, the part where it is negative.  Strata
    have about as many samples as mass, which is best for noise that is the same everywhere, and
    are evenly spread over each BLOCK_SAMPLES samples."""
    masses = np.outer((1.0 - mass, mass), (1.0 - mass, mass)).ravel()
    if STRATA * masses[1] < 0.5:
        return _NO_STRATA
    size = np.maximum(1, np.round(STRATA * masses)).astype(np.int64)
    size[0] = STRATA - size[1:].sum()
    places = np.concatenate([(np.arange(n) + 0.5) / n for n in size])
    turns = np.repeat(np.arange(4), size)[np.argsort(places, kind="stable")]
    low = np.arange(BLOCK_SAMPLES)
    of = turns.reshape(-1, BLOCK_SAMPLES)[:, low ^ low[:, None]].transpose(1, 0, 2)
    of = of.reshape(BLOCK_SAMPLES, STRATA)
    is_same = of[:, :, None] == of[:, None, :]
    rank = np.tril(is_same, -1).sum(axis=2)
    shares = np.outer((1.0 - share, share), (1.0 - share, share)).ravel()
    return Strata(of, rank, size, shares * STRATA / size)


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
    k, cells = np.uint64(guided_cell_of(table.cumulative, table.guides, u)), table.cells
    z = min(max((u - cells[k, 1]) * cells[k, 2], -1.0), 1.0)
    return cells[k, 0] + table.half * z, weight_in(cells, k, z)


@kernel
def weight_in(cells: FloatArray, k: Any, z: float) -> float:
    """The weight at z, from -1 to 1, in row k of the cells."""
    z2 = z * z
    weight = (cells[k, 3] + cells[k, 4] * z) + (cells[k, 5] + cells[k, 6] * z) * z2
    weight += (cells[k, 7] + cells[k, 8] * z) * (z2 * z2)
    return float(weight)


_offset_by = by_class(
    "film_offset", {BoxSetup: _box_offset, TentSetup: _tent_offset, Tabulated: _tabulated_offset}
)

film_filters = Linkable()
"""The operations `film_offset` and `stratum_of`, and those of `filter_values.py`, on a filter's
setup or on a link to one."""


@film_filters.operation
def film_offset(setup: Any, u: float) -> tuple[float, float]:
    """(offset from the pixel's centre in pixels, weight), along one axis; the expectation of
    weight * g(offset) is the filter's integral of g."""
    dx, weight = _offset_by(setup, u)
    return dx, weight


class Stratum(NamedTuple):
    """Which numbers a sample of a pixel takes: those of sample `number` of `pixel`;  part_x,
    part_y: (begin, length) of the part of [0, 1) in which the film numbers are;  weight: a factor
    of the sample."""

    pixel: int
    number: int
    part_x: tuple[float, float]
    part_y: tuple[float, float]
    weight: float


@kernel
def no_stratum(pixel: int, sample: int) -> Stratum:
    """A sample's own numbers."""
    return Stratum(pixel, sample, (0.0, 1.0), (0.0, 1.0), 1.0)


@kernel
def _whole(setup: Any, seed: int, pixel: int, sample: int) -> Stratum:
    return no_stratum(pixel, sample)


@kernel
def _stratum_of_table(table: Tabulated, seed: int, pixel: int, sample: int) -> Stratum:
    """The order in which a pixel has the strata begins anywhere, by a hash: each sample is in each
    stratum as often as it should be, so that any number of samples is unbiased."""
    strata = table.strata
    if len(strata.of) == 0:
        return no_stratum(pixel, sample)
    turn = sample // STRATA
    key = combine(combine(np.uint64(seed), np.uint64(pixel + 4 * SINGLY)), np.uint64(turn))
    order = np.int64(key & np.uint64(BLOCK_SAMPLES - 1))
    at = (sample % STRATA) ^ np.int64((key >> np.uint64(32)) & np.uint64(STRATA - BLOCK_SAMPLES))
    k = strata.of[order, at]
    negative, positive = (0.0, table.share), (table.share, 1.0 - table.share)
    return Stratum(
        pixel + k * SINGLY,
        turn * strata.size[k] + strata.rank[order, at],
        negative if k >= 2 else positive,
        negative if k % 2 == 1 else positive,
        strata.weight[k],
    )


_stratum_by = by_class(
    "stratum", {BoxSetup: _whole, TentSetup: _whole, Tabulated: _stratum_of_table}
)


@film_filters.operation
def stratum_of(setup: Any, seed: int, pixel: int, sample: int) -> Stratum:
    """Which numbers a sample with Sobol' points takes."""
    found: Stratum = _stratum_by(setup, seed, pixel, sample)
    return found


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
