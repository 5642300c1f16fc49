"""The two sides of a comparison, and the noise estimated from their replicates."""

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import correlate1d

from comparisons.results.case import FloatArray
from comparisons.statistics.metrics import ratio
from comparisons.statistics.rare import event, met_once

# ---- the scales of a bias: margins, test levels, and the means of tiles --------------------------


CHANNELS = "RGB"

TILE = 16
"""Side of a tile in pixels, unless another is asked for."""

IMAGE_LEVEL = 0.0005
"""Chance of a false alarm of the tests of the image mean, all channels together."""

TILE_LEVEL = 0.0002
PIXEL_LEVEL = 0.0002
UNIFORMITY_LEVEL = 0.0001
"""The same for the other families: all together at most one correct case in a thousand is reported
to differ. The image mean has the largest share because its interval also states the equivalence."""

POWER = 0.99
"""The smallest detectable bias is the one that is proven with this chance."""

DARK = 0.1
"""The least value that a bias is divided by, as a fraction of the reference's mean over image and
channels. A darker tile or channel hardly contributes to the picture, while light that leaks in by a
ray epsilon is proportional to its surroundings."""

ROUNDING = 2.0**-24
"""Half a unit in the last place of float32: the least relative standard error that is believed."""

HALF = 2.0**-11
"""Largest relative rounding of a half float (IEEE 754 binary16), 0.049 %. Many renderers hold
textures and skies in this format, and many EXR files are written in it."""


@dataclass(frozen=True)
class Margins:
    """Permitted relative bias at each scale. The defaults are for a reference that computes in
    float32 and offsets rays from surfaces by (1 + max|p|) * 8.9e-5, as Mitsuba does."""

    image: float = 0.001
    """About five times that offset in a scene of unit size."""
    tile: float = 0.01
    """An edge or a contact shadow fills more of a tile than of the image."""
    pixel: float = 0.05
    """And still more of a pixel: in a picture 256 pixels wide the offset is a fortieth of a pixel,
    and light that leaks along a contact may double the error."""
    stored: float = HALF
    """For a pixel with little noise or none, such as a smooth sky: of the pixel's own value, by
    which texels and pixels that are stored as half floats may be off."""
    constant: float = 1e-5
    """In addition, for sums and products of some tens of float32 numbers; of at least DARK times
    the mean, so that it is all that is permitted in a dark pixel without noise, as a background."""


def cell_sums(images: FloatArray, tile: int) -> FloatArray:
    """(..., height, width, 3) -> (..., rows, columns, 3); the last ones maybe narrower."""
    height, width = images.shape[-3], images.shape[-2]
    # Along the rows first: these sums read adjacent memory, and the rest is small.
    rows = np.add.reduceat(images, np.arange(0, height, tile), axis=-3)
    return np.asarray(np.add.reduceat(rows, np.arange(0, width, tile), axis=-2))


def tile_sums(values: FloatArray, tile: int = TILE) -> FloatArray:
    """(height, width) -> (tiles,): sums over tiles, row by row; the last ones maybe narrower."""
    rows = np.add.reduceat(values, np.arange(0, values.shape[0], tile), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, values.shape[1], tile), axis=1).ravel())


def cell_pixels(images: FloatArray, tile: int) -> FloatArray:
    """(rows, columns, 1): the number of pixels in each tile."""
    height, width = images.shape[-3], images.shape[-2]
    tall = np.diff(np.arange(0, height, tile), append=height)
    wide = np.diff(np.arange(0, width, tile), append=width)
    return np.outer(tall, wide)[:, :, None].astype(np.float64)


def cell_means(images: FloatArray, tile: int) -> FloatArray:
    """(..., height, width, 3) -> (..., rows, columns, 3)."""
    return np.asarray(cell_sums(images, tile) / cell_pixels(images, tile))


FAINTEST = 1e-150
"""Variances that are smaller count as none: their squares would be 0."""

NEIGHBOURS = 5
"""Side in pixels of the square from which the noise of a pixel is estimated a second time."""


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

    def of_tiles(self, tile: int) -> Noise:
        """The noise of tiles of one picture, (rows, columns, 3)."""
        pixels = cell_pixels(self.mean, tile)
        variance = cell_sums(self.variance, tile)
        summed = variance / pixels**2
        dof = self._dof(variance, cell_sums(self.fourth, tile), pixels)
        if self.pictures is None:
            return Noise(summed, dof, summed, dof)
        own = cell_means(self.pictures, tile).var(axis=0, ddof=1)
        return Noise(own, float(self.count - 1), summed, dof)

    def of_image(self) -> Noise:
        """The noise of the mean of one picture, (3,)."""
        size = float(self.mean.shape[0] * self.mean.shape[1])
        variance = self.variance.sum(axis=(0, 1))
        summed = variance / size**2
        dof = self._dof(variance, self.fourth.sum(axis=(0, 1)), size)
        if self.pictures is None:
            return Noise(summed, dof, summed, dof)
        own = self.pictures.mean(axis=(1, 2)).var(axis=0, ddof=1)
        return Noise(own, float(self.count - 1), summed, dof)

    def of_pixels(self) -> Noise:
        """The noise of single pixels, (h, w, 3); `Noise.pixels` comes from their neighbours."""
        around = neighbourhood(self.variance)
        n = float(NEIGHBOURS**2)
        dof = self._dof(n * around, n * neighbourhood(self.fourth), n)
        own_dof = np.inf if self.pictures is None else float(self.count - 1)
        return Noise(self.variance, own_dof, around, dof)

    @functools.cached_property
    def met_once(self) -> FloatArray:
        """(h, w, 3): the energy of one picture that only one replicate has met; of a known mean,
        for which this is unknown, zero."""
        return np.zeros_like(self.mean) if self.pictures is None else met_once(self.pictures)

    def event(self, scale: FloatArray) -> FloatArray:
        """(3,): the energy of an event of rare light in a pixel of one picture over `scale`, (h, w,
        3) and positive; of a known mean, that of a Poisson variable's events, the variance over the
        mean."""
        if self.pictures is not None:
            return event(self.met_once, scale)
        lit = np.where(self.variance > 0.0, np.abs(self.mean), 0.0).sum(axis=(0, 1))
        energy = (self.variance / scale).sum(axis=(0, 1))
        return np.where(lit > 0.0, ratio(energy, lit), 0.0)

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


def side_of(images: FloatArray) -> Side:
    """A side with replicates (R >= 2, h, w, 3)."""
    mean = images.mean(axis=0)
    squares = np.zeros_like(mean)
    fourth = np.zeros_like(mean)
    for image in images:  # one at a time: fits the cache, several times as fast
        square = (image - mean) ** 2
        squares += square
        fourth += square * square
    return Side(images, mean, squares / (len(images) - 1), fourth / len(images), len(images))


def known_side(known: Known) -> Side:
    """A side of which only the mean and its variance are known."""
    return Side(None, known.mean, known.variance, known.variance**2, 1)


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
