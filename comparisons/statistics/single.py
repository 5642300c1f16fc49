"""Tests for a side of a single picture, whose noise is estimated from the difference itself.

The difference of the two pictures is noise about the bias. Its spread over small blocks within a
tile gives the standard error of the tile's mean; all blocks together give that of the image mean,
so that each part of the picture has its own noise level (White 1980). This assumes that the noise
of neighbouring blocks is independent.

A gain changes bright blocks more than dark ones. So the gain of each channel is fitted first, and
the spread is that of what remains; a block that alone decides about the gain would hide its own
noise, so each remainder is divided by one minus its leverage (MacKinnon and White 1985). Any other
bias that varies inside a tile, such as a contact shadow, counts as noise: it widens the interval.

Without replicates a wrong pixel cannot be distinguished from a firefly. Pixels are tested only
where there is no noise, that is, where the difference is constant in the neighbourhood.

A single picture may have missed rare paths, such as those of a caustic, so that its spread is too
small; the replicates of the other side may have sampled them. So the single picture's noise counts
as at least the other side's, times the ratio of the two in the median tile.
"""

from dataclasses import dataclass

import numpy as np

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import (
    Margins,
    cell_means,
    cell_pixels,
    cell_sums,
    divisor,
    tiles,
    whole,
)
from comparisons.statistics.metrics import ratio
from comparisons.statistics.scales import IMAGE, PIXELS, TILES
from comparisons.statistics.sides import NEIGHBOURS, Known, known_side, neighbourhood, side_of
from comparisons.statistics.welch import BiasTest, Error, bias_test

BLOCK = 4
"""Side of a block in pixels: larger than the radius of a usual reconstruction filter."""

COARSE = 2 * BLOCK
"""The image's standard error is also estimated from blocks of this side, which is larger if the
noise of neighbouring small blocks is correlated."""


def single_tests(
    candidate: FloatArray, reference: FloatArray | Known, tile: int, margins: Margins
) -> tuple[dict[str, BiasTest], int]:
    """The tests by the names of their scales, for pictures (R, h, w, 3) with R = 1 on a side; and
    the side of a tile, rounded to whole blocks."""
    mean = reference.mean if isinstance(reference, Known) else reference.mean(axis=0)
    difference = candidate.mean(axis=0) - mean
    tile = max(tile // COARSE, 1) * COARSE
    level = float(mean.mean())
    fine, coarse = (_Blocks.of(difference, mean, tile, side) for side in (BLOCK, COARSE))
    of_image, of_tiles = fine.image(), fine.tiles()
    # A tile has too few coarse blocks to measure its noise, but the image has enough.
    known = np.isfinite(coarse.image().value) & (of_image.value > 0.0)
    wider = np.where(known, coarse.image().value, 1.0) / np.where(known, of_image.value, 1.0)
    of_tiles = Error(of_tiles.value * np.maximum(wider, 1.0), of_tiles.dof)
    rare_image, rare_tiles = _rare(candidate, reference, difference, tile)
    of_whole = bias_test(
        difference.mean(axis=(0, 1)),
        mean.mean(axis=(0, 1)),
        (of_image, coarse.image(), *rare_image),
        margins.image,
        IMAGE.level,
        level,
    )
    of_each = bias_test(
        cell_means(difference, tile),
        cell_means(mean, tile),
        (of_tiles, *rare_tiles),
        margins.tile,
        TILES.level,
        level,
    )
    of_pixels = _pixels(difference, mean, margins)
    return {IMAGE.name: of_whole, TILES.name: of_each, PIXELS.name: of_pixels}, tile


FULL = 0.5
"""Leverage from which no gain is fitted to a block: its remainder would be its noise divided by
less than a half."""


CONTRAST = 0.01
"""Largest squared difference, as a fraction of the squared contrast of the reference, at which a
gain is fitted. The reference's own noise is part of the difference: fitted to it, a gain removes
at most this fraction of the variance."""

FEWEST_FREE = 14.0
"""Least degrees of freedom at which a single picture tells how many samples are needed: the
standard error is then known within 20 %. Of 12 renders of a box at 1,024 samples those with fewer
asked for 3 to 300 times the samples where 2.5 times was right."""

ALIKE = 1.5
"""Largest ratio of the standard errors by small and large blocks, or by the difference and by the
other side's noise, at which the difference counts as noise: that of other biases does not fall."""


def single_factor(image: BiasTest, limit: float) -> float:
    """As `BiasTest.samples_factor`; infinite where a single picture cannot tell, because few bright
    pixels make its noise, or because the difference is unlike noise."""
    dof = min(float(np.min(error.dof)) for error in image.errors)
    fine, coarse, *rare = (error.value for error in image.errors)
    spread = np.maximum(fine, coarse)
    unlike = any(np.any(spread > ALIKE * other) for other in (fine, *rare))
    if dof < FEWEST_FREE or unlike:
        return np.inf
    return image.samples_factor(limit)


@dataclass(frozen=True)
class _Blocks:
    """Sums over tiles of squares and fourth powers of block sums about their tile's mean, and the
    numbers of blocks and of pixels; all (rows, columns, 3)."""

    squares: FloatArray
    fourths: FloatArray
    blocks: FloatArray
    pixels: FloatArray

    @classmethod
    def of(cls, difference: FloatArray, mean: FloatArray, tile: int, side: int) -> "_Blocks":
        """mean: the reference's picture, whose gain is fitted."""
        per_tile = tile // side
        count = cell_pixels(cell_sums(difference, side), per_tile)
        rest = _without_gain(_about_tiles(difference, tile, side), _about_tiles(mean, tile, side))
        bessel = np.where(count > 1, count / np.maximum(count - 1.0, 1.0), 1.0)
        shape = cell_sums(rest, per_tile).shape
        return cls(
            cell_sums(rest**2, per_tile) * bessel,
            cell_sums(rest**4, per_tile) * bessel**2,
            np.broadcast_to(count, shape),
            np.broadcast_to(cell_pixels(difference, tile), shape),
        )

    def tiles(self) -> Error:
        """The standard error of each tile's mean."""
        free = np.maximum(self.blocks - 1.0, 1.0)
        error = np.where(self.blocks > 1, np.sqrt(self.squares) / self.pixels, np.inf)
        return Error(error, _dof(self.squares, self.fourths, self.blocks, free))

    def image(self) -> Error:
        """The standard error of the image mean."""
        squares, fourths, blocks, pixels = (
            values.sum(axis=(0, 1))
            for values in (self.squares, self.fourths, self.blocks, self.pixels)
        )
        free = np.maximum(self.blocks - 1.0, 0.0).sum(axis=(0, 1))
        error = np.where(free > 0, np.sqrt(squares) / pixels, np.inf)
        return Error(error, _dof(squares, fourths, blocks, np.maximum(free, 1.0)))


def _about_tiles(picture: FloatArray, tile: int, side: int) -> FloatArray:
    """Sums over blocks of `side`, (rows, columns, 3), of the picture minus its tile's mean."""
    sums, per_tile = cell_sums(picture, side), tile // side
    count = cell_pixels(sums, per_tile)
    # A tile of one block has no spread of its own: use the spread about the image's mean.
    means = np.where(count > 1, cell_means(picture, tile), picture.mean(axis=(0, 1)))
    spread = np.repeat(np.repeat(means, per_tile, axis=0), per_tile, axis=1)
    pixels = cell_pixels(picture, side)
    return np.asarray(sums - pixels * spread[: sums.shape[0], : sums.shape[1]])


def _without_gain(difference: FloatArray, reference: FloatArray) -> FloatArray:
    """What a gain of each channel leaves of the difference, by least squares; the difference where
    the reference's contrast is not far above it."""
    power = (reference**2).sum(axis=(0, 1))
    power = np.where(power > 0.0, power, 1.0)
    gain = (difference * reference).sum(axis=(0, 1)) / power
    leverage = reference**2 / power
    rest = difference - gain * reference
    clear = (rest**2).sum(axis=(0, 1)) < CONTRAST * power
    # A block that has all the contrast of the picture says nothing about its own noise.
    fitted = clear & (leverage < FULL)
    return np.where(fitted, rest / (1.0 - np.minimum(leverage, FULL)), difference)


def _dof(
    squares: FloatArray, fourths: FloatArray, blocks: FloatArray, free: FloatArray
) -> FloatArray:
    """As `Side._dof`, but not more than there are free blocks."""
    kurtosis = blocks * fourths / np.where(squares > 0.0, squares, 1.0) ** 2
    return np.asarray(np.minimum(free, 2.0 * free / np.maximum(kurtosis - 1.0, 1.0)))


def _rare(
    candidate: FloatArray, reference: FloatArray | Known, difference: FloatArray, tile: int
) -> tuple[list[Error], list[Error]]:
    """Standard errors of the image and of tiles from the noise of the other side's replicates; none
    if that is a single picture too."""
    # Differences of neighbouring pixels, which hardly contain a bias.
    steps = np.diff(difference, axis=1) ** 2
    if isinstance(reference, Known):
        many = known_side(reference)
        of_one = reference.variance[:, 1:] + reference.variance[:, :-1]
    elif len(candidate) == len(reference):
        return [], []
    else:
        many = side_of(candidate if len(candidate) > 1 else reference)
        assert many.pictures is not None
        # One replicate minus the mean of the others, like the single picture minus their mean.
        left_out = (many.pictures[0] - many.mean) * many.count / (many.count - 1.0)
        of_one = np.diff(left_out, axis=1) ** 2
    if difference.shape[1] < 2:
        return [], []
    ours, theirs = cell_sums(steps, tile), cell_sums(of_one, tile)
    noisy = (ours > 0.0) & (theirs > 0.0)
    factor = float(np.median(ours[noisy] / theirs[noisy])) if noisy.any() else 0.0
    image, each = many.of(whole(difference)), many.of(tiles(difference, tile))
    return (
        [Error(np.sqrt(factor * image.pixels), np.asarray(image.pixels_dof))],
        [Error(np.sqrt(factor * each.pixels), np.asarray(each.pixels_dof))],
    )


def _pixels(difference: FloatArray, reference: FloatArray, margins: Margins) -> BiasTest:
    """The test of pixels without noise; all others get an infinite interval."""
    scale = divisor(reference, float(reference.mean()))
    around = neighbourhood(difference)
    variance = neighbourhood(difference**2) - around**2
    whole = min(difference.shape[:2]) >= NEIGHBOURS
    still = whole & (variance <= (margins.constant * scale) ** 2)
    spread = np.sqrt(np.maximum(variance, 0.0))
    error = Error(np.where(still, spread, np.inf), np.full(difference.shape, np.inf))
    margin = margins.constant + ratio(margins.stored * np.abs(reference), scale)
    return bias_test(difference, reference, (error,), margin, PIXELS.level, float(reference.mean()))
