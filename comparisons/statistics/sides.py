"""The two sides of a comparison, and the noise estimated from their replicates."""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import correlate1d

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import Cells
from comparisons.statistics.filtered import excess_by_filter
from comparisons.statistics.metrics import ratio

Sums = Callable[[FloatArray], FloatArray]
"""From pictures (..., height, width, 3) to sums over parts of them."""

FAINTEST = 1e-150
"""Variances that are smaller count as none: their squares would be 0."""

NEIGHBOURS = 5
"""Side in pixels of the square from which the noise of a pixel is estimated a second time."""

ALONE = 0.5
"""A pixel's largest value is energy met once if it exceeds the second largest by this fraction of
the range of all replicates. Of 16 normal numbers 0.2 % do so, and of 16 exponential ones 11 %."""


@dataclass(frozen=True)
class Known:
    """A reference with known mean and known variance of that mean, (height, width, 3) each."""

    mean: FloatArray
    variance: FloatArray


@dataclass(frozen=True)
class Noise:
    """Variances of means, and their degrees of freedom; all arrays of one shape (or scalars).

    own: from the spread of the means between replicates, without assumptions about pixels;
    pixels: the sum of the variances of single pixels, as if these were independent.
    """

    own: FloatArray
    own_dof: FloatArray | float
    pixels: FloatArray
    pixels_dof: FloatArray | float


@dataclass(frozen=True)
class Side:
    """pictures: (R, h, w, 3), None if only moments are known;  mean, variance (of one picture) and
    fourth central moment (squared variance if known) of each pixel: (h, w, 3);  count: R, or 1 for
    a mean that is known."""

    pictures: FloatArray | None
    mean: FloatArray
    variance: FloatArray
    fourth: FloatArray
    count: int
    filtered: float = 0.0
    """Of a known mean the excess of the variance of sums of pixels (see `excess_by_filter`)."""
    signed: bool = False
    """Whether the pictures are of values of both signs, such as derivatives."""

    def of(self, cells: Cells) -> Noise:
        """The noise of the means over parts of one picture."""
        return self.of_sums(cells.sums, cells.sums, cells.sums, cells.pixels)

    def of_sums(
        self, sums: Sums, squares: Sums, fourths: Sums, pixels: FloatArray | float
    ) -> Noise:
        """The noise of weighted sums over one picture's pixels, divided by `pixels`;  squares,
        fourths: sums with the weights' squares and fourth powers."""
        variance = squares(self.variance)
        summed = (1.0 + self.filtered) * variance / pixels**2
        dof = self._dof(variance, fourths(self.fourth), pixels) / (1.0 + self.filtered)
        if self.pictures is None:
            return Noise(summed, dof, summed, dof)
        own = (sums(self.pictures) / pixels).var(axis=0, ddof=1)
        return Noise(own, float(self.count - 1), summed, dof)

    def of_pixels(self) -> Noise:
        """The noise of single pixels, (h, w, 3); `Noise.pixels` comes from their neighbours."""
        around = neighbourhood(self.variance)
        n = float(NEIGHBOURS**2)
        dof = self._dof(n * around, n * neighbourhood(self.fourth), n)
        own_dof = np.inf if self.pictures is None else float(self.count - 1)
        return Noise(self.variance, own_dof, around, dof)

    @functools.cached_property
    def size(self) -> FloatArray:
        """(h, w, 3): what biases are divided by: the mean, and the mean's size where values have
        both signs.  That is estimated by one half of the replicates with the signs of the other:
        the size of a mean of noise alone would be the noise's."""
        if not self.signed:
            return self.mean
        if self.pictures is None:
            return np.abs(self.mean)
        one, two = self.pictures[::2].mean(axis=0), self.pictures[1::2].mean(axis=0)
        return np.asarray(0.5 * (one * np.sign(two) + two * np.sign(one)))

    @functools.cached_property
    def met_once(self) -> FloatArray:
        """(h, w, 3): the energy of one picture that only one replicate has met; of a known mean,
        for which this is unknown, zero."""
        if self.pictures is None:
            return np.zeros_like(self.mean)
        return met_once(np.abs(self.pictures) if self.signed else self.pictures)

    def event(self, scale: FloatArray, weight: FloatArray | float = 1.0) -> FloatArray:
        """(3,): the energy of an event of rare light in a pixel of one picture over `scale`, (h, w,
        3) and >= 0, weighted by itself and by `weight`; 0 if there is none.

        If every event has the same multiple of its pixel's `scale`, this is that multiple; if all
        have one energy, it is that over the mean scale where they fell.  The events of a known mean
        are a Poisson variable's, whose energy is the variance over the mean.
        """
        if self.pictures is None:
            energy = np.where(self.variance > 0.0, np.abs(self.mean), 0.0)
            squares = self.variance
        else:
            energy = self.met_once
            squares = energy**2
        sums = (x.sum(axis=(0, 1)) for x in (weight * squares, weight * energy * scale))
        return ratio(*sums)

    def _dof(
        self, variance: FloatArray, fourth: FloatArray, pixels: FloatArray | float
    ) -> FloatArray:
        """Degrees of freedom of a sum of `pixels` variances: 2 n / (kurtosis - 1) (Box 1953).

        n for normal noise; about the number of fireflies if these have most of the variance. Known
        variances count as known with one degree of freedom each (Satterthwaite 1946).
        """
        positive = np.where(variance > FAINTEST, variance, 1.0)
        if self.pictures is None:
            return np.asarray(positive**2 / np.where(variance > FAINTEST, fourth, 1.0))
        excess = pixels * fourth / (positive * (1.0 - 1.0 / self.count)) ** 2 - 1.0
        # The kurtosis is at least 1, but for rounding.
        return np.asarray(2.0 * pixels * (self.count - 1) / np.maximum(excess, 1.0))


def side_of(images: FloatArray | Known, signed: bool = False) -> Side:
    """A side with replicates (R >= 2, h, w, 3), or with a known mean of independent pixels."""
    if isinstance(images, Known):
        return known_side(images, signed=signed)
    mean = images.mean(axis=0)
    squares = np.zeros_like(mean)
    fourth = np.zeros_like(mean)
    for image in images:  # one at a time: fits the cache, several times as fast
        square = (image - mean) ** 2
        squares += square
        fourth += square * square
    variance = squares / (len(images) - 1)
    return Side(images, mean, variance, fourth / len(images), len(images), signed=signed)


def known_side(known: Known, other: FloatArray | None = None, signed: bool = False) -> Side:
    """A side of which only the mean and its variance are known;  other: the other side's mean,
    which shows whether its pixels share noise."""
    shared = 0.0 if other is None else excess_by_filter(other, known.mean, known.variance)
    return Side(None, known.mean, known.variance, known.variance**2, 1, shared, signed)


def met_once(pictures: FloatArray) -> FloatArray:
    """(R, h, w, 3) -> (h, w, 3): the energy, in one replicate, that only this one has met."""
    most = np.maximum(pictures[0], pictures[1])
    second = np.minimum(pictures[0], pictures[1])
    least = second.copy()
    for picture in pictures[2:]:  # one at a time: fits the cache
        np.maximum(second, np.minimum(most, picture), out=second)
        np.maximum(most, picture, out=most)
        np.minimum(least, picture, out=least)
    excess = most - second
    return np.asarray(np.where(excess > ALONE * (most - least), excess, 0.0))


def neighbourhood(values: FloatArray) -> FloatArray:
    """The mean over the square of NEIGHBOURS around each pixel, (h, w, 3)."""
    # Not by a running sum, which carries the rounding error of a firefly along its row.
    weights = np.full(NEIGHBOURS, 1.0 / NEIGHBOURS)
    rows = correlate1d(values, weights, axis=0, mode="reflect")
    return np.asarray(correlate1d(rows, weights, axis=1, mode="reflect"))


def picture_array(values: npt.ArrayLike, name: str, dimensions: int) -> FloatArray:
    """`values` as float64 of `dimensions`, the last being three channels. Raises ValueError."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != dimensions or array.shape[-1] != 3 or array.size == 0:
        expected = "(R, height, width, 3)" if dimensions == 4 else "(height, width, 3)"
        raise ValueError(f"{name}: expected {expected}, got {array.shape}")
    return array
