"""What a bias is measured by: margins, levels, and the means of tiles."""

from dataclasses import dataclass

import numpy as np

from comparisons.results.case import FloatArray

CHANNELS = "RGB"

TILE = 16
"""Side of a tile in pixels, unless another is asked for."""

IMAGE_LEVEL = 0.0005
"""False alarms of the tests of the image mean, all channels together."""

TILE_LEVEL = 0.0002
PIXEL_LEVEL = 0.0002
UNIFORMITY_LEVEL = 0.0001
"""The same of the other families: with IMAGE_LEVEL at most one case in a thousand that is right is
said to differ. Each family is one question, so the shares need not be alike; the image mean has the
largest because its interval is also what is stated as equivalence."""

POWER = 0.99
"""Chance of being proven that defines the smallest detectable bias."""

DARK = 0.1
"""Floor of what a bias is relative to, as a fraction of the reference's mean over image and
channels. A tile or a channel darker than this has next to no share in the picture, while light that
leaks in by a ray epsilon is proportional to its surroundings."""

ROUNDING = 2.0**-24
"""Half a unit in the last place of float32: the least relative standard error that is believed."""


@dataclass(frozen=True)
class Margins:
    """Relative bias that is permitted at each scale. The values are those for a reference that
    computes in float32, as Mitsuba does, and leaves a surface by (1 + max|p|) * 8.9e-5."""

    image: float = 0.001
    """In a scene of unit size, about five times that offset."""
    tile: float = 0.01
    """An edge or a contact shadow fills more of a tile than of the image."""
    pixel: float = 0.05
    """And more of a pixel still: where a picture is 256 pixels wide, the offset is a fortieth of
    one, and light that leaks along a contact may double it."""
    constant: float = 1e-5
    """Of a pixel without noise, such as the background or a lamp that is seen directly. Nothing
    varies inside it that a rounded ray could meet otherwise, so there is only the rounding of the
    value, of sums and products of some tens of float32 numbers."""


def cell_sums(images: FloatArray, tile: int) -> FloatArray:
    """(..., height, width, 3) -> (..., rows, columns, 3); the last ones maybe narrower."""
    height, width = images.shape[-3], images.shape[-2]
    # Along the rows first: the sums are of adjacent memory, and what is left is small.
    rows = np.add.reduceat(images, np.arange(0, height, tile), axis=-3)
    return np.asarray(np.add.reduceat(rows, np.arange(0, width, tile), axis=-2))


def cell_pixels(images: FloatArray, tile: int) -> FloatArray:
    """(rows, columns, 1): the number of pixels in each tile."""
    height, width = images.shape[-3], images.shape[-2]
    tall = np.diff(np.arange(0, height, tile), append=height)
    wide = np.diff(np.arange(0, width, tile), append=width)
    return np.outer(tall, wide)[:, :, None].astype(np.float64)


def cell_means(images: FloatArray, tile: int) -> FloatArray:
    """(..., height, width, 3) -> (..., rows, columns, 3)."""
    return np.asarray(cell_sums(images, tile) / cell_pixels(images, tile))
