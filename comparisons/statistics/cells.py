"""The parts of a picture whose means are compared, and what a bias of each may be."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from comparisons.results.case import FloatArray

CHANNELS = "RGB"

TILE = 16
"""Side of a tile in pixels, unless another is asked for."""

POWER = 0.99
"""The smallest detectable bias is the one that is proven with this chance."""

DARK = 0.1
"""The least value that a bias is divided by, as a fraction of the reference's mean over image and
channels. A darker tile or channel hardly contributes to the picture, while light that leaks in by a
ray epsilon is proportional to its surroundings."""


def divisor(reference: FloatArray, mean: float | np.floating[Any]) -> FloatArray:
    """What biases are divided by;  mean: the reference's, over image and channels."""
    return np.maximum(np.abs(reference), DARK * abs(float(mean)))


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
    """An edge or a contact shadow fills more of a tile than of the image. The most for a row or a
    column, too."""
    pixel: float = 0.05
    """And still more of a pixel: in a picture 256 pixels wide the offset is a fortieth of a pixel,
    and light that leaks along a contact may double the error."""
    stored: float = HALF
    """For a pixel with little noise or none, such as a smooth sky: of the pixel's own value, by
    which texels and pixels that are stored as half floats may be off."""
    constant: float = 1e-5
    """In addition, for sums and products of some tens of float32 numbers; of at least DARK times
    the mean, so that it is all that is permitted in a dark pixel without noise, as a background."""


PAIRED = Margins(image=5e-5, tile=5e-4, pixel=5e-3)
"""For sides that use the same random numbers, and so trace the same paths with the same offsets:
what is left is the rounding of float32, in which a path that grazes an edge goes either way."""


class Cells(NamedTuple):
    """Parts of a picture.

    sums: from pictures (..., height, width, 3) to the sums over each part, (..., parts, 3);
    pixels: how many pixels each has: an array that fits these, or a number.
    """

    sums: Callable[[FloatArray], FloatArray]
    pixels: FloatArray | float

    def means(self, pictures: FloatArray) -> FloatArray:
        """Over each part."""
        return np.asarray(self.sums(pictures) / self.pixels)


def whole(picture: FloatArray) -> Cells:
    """The picture as one part."""
    height, width = picture.shape[-3:-1]
    return Cells(lambda x: np.asarray(x.sum(axis=(-3, -2))), float(height * width))


def tiles(picture: FloatArray, tile: int) -> Cells:
    """Squares of `tile` pixels."""
    return Cells(partial(cell_sums, tile=tile), cell_pixels(picture, tile))


def lines(picture: FloatArray) -> Cells:
    """All rows, then all columns."""
    height, width = picture.shape[-3:-1]

    def sums(x: FloatArray) -> FloatArray:
        return np.concatenate([x.sum(axis=-2), x.sum(axis=-3)], axis=-2)

    return Cells(sums, np.repeat([float(width), float(height)], [height, width])[:, None])


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


def ranks_of(values: FloatArray) -> FloatArray:
    """(R, ...) -> (R, ...): the rank of each among the R, from 1 on; equal ones have their mean."""
    below = [np.count_nonzero(values < row, axis=0) for row in values]
    equal = [np.count_nonzero(values == row, axis=0) for row in values]
    return np.asarray(np.array(below) + 0.5 * (np.array(equal) + 1.0))
