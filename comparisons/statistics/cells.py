"""The tests of the image mean, of tiles and of pixels, for two sides with replicates."""

import math
from dataclasses import replace

import numpy as np
from scipy import stats

from comparisons.statistics.metrics import ratio
from comparisons.statistics.scales import (
    DARK,
    IMAGE_LEVEL,
    PIXEL_LEVEL,
    TILE_LEVEL,
    Margins,
    cell_means,
    cell_pixels,
)
from comparisons.statistics.sides import Side, neighbourhood
from comparisons.statistics.unmet import Events, unmet_variance
from comparisons.statistics.welch import MOST_DOF, BiasTest, Error, bias_test, welch_errors


def image_test(a: Side, b: Side, margins: Margins, level: float = 1.0) -> BiasTest:
    """The image mean of each channel, (3,);  level: the share of the family's that is used."""
    reference = b.mean.mean(axis=(0, 1))
    difference = a.mean.mean(axis=(0, 1)) - reference
    errors = welch_errors(a.of_image(), b.of_image(), a, b)
    pixels = float(b.mean.shape[0] * b.mean.shape[1])
    return bias_test(
        difference,
        reference,
        errors,
        margins.image,
        level * IMAGE_LEVEL,
        reference.mean(),
        Events.of_cells(a, b, reference + difference, reference, pixels),
    )


def tile_test(a: Side, b: Side, tile: int, margins: Margins, level: float = 1.0) -> BiasTest:
    """Each channel of each tile, (rows, columns, 3): errors of hue would cancel in luminance."""
    reference = cell_means(b.mean, tile)
    difference = cell_means(a.mean, tile) - reference
    errors = welch_errors(a.of_tiles(tile), b.of_tiles(tile), a, b)
    return bias_test(
        difference,
        reference,
        errors,
        margins.tile,
        level * TILE_LEVEL,
        b.mean.mean(),
        Events.of_cells(a, b, reference + difference, reference, cell_pixels(b.mean, tile)),
    )


def pixel_test(a: Side, b: Side, margins: Margins, level: float = 1.0) -> BiasTest:
    """Each channel of each pixel, (height, width, 3).

    The margin is that of a pixel, but at most half the standard deviation of one picture's pixel:
    whatever a rounded ray could hit differently varies within the pixel, and so is noise. Where
    that is less than the rounding of stored values, the margin is this rounding.

    A pixel with two possible values (a lamp's edge, one sample per pixel) may by chance have one
    value in all pictures of the candidate and the other in all of the reference, without any
    spread. With few replicates such pixels count only if there are more than chance produces.
    """
    of_test = level * PIXEL_LEVEL
    noise_a, noise_b = a.of_pixels(), b.of_pixels()
    own, near = welch_errors(noise_a, noise_b, a, b, single_pixels=True)
    mean = float(b.mean.mean())
    scale = np.maximum(np.abs(b.mean), DARK * abs(mean))
    spread = np.sqrt(np.maximum(a.variance, b.variance))
    hit = np.minimum(margins.pixel, 0.5 * np.minimum(ratio(spread, scale), 1.0))
    margin = margins.constant + np.maximum(hit, ratio(margins.stored * np.abs(b.mean), scale))
    parted = scale.size * (chance_of_parting(a.count, b.count) if b.pictures is not None else 0.0)
    still = spread <= margins.constant * scale
    noisy = neighbourhood(np.where(still, 0.0, 1.0)).max(axis=-1, keepdims=True) > 0.0
    if parted < of_test / 2.0:  # enough replicates: chance does not separate the sides
        near = replace(near, value=np.where(still, own.value, near.value))
    difference = a.mean - b.mean
    missed = np.where(still, 0.0, unmet_variance(a, b))
    unmet = Error(
        np.sqrt(np.maximum(own.value, near.value) ** 2 + missed),
        np.full(difference.shape, float(MOST_DOF)),
    )
    test = bias_test(difference, b.mean, (own, near, unmet), margin, of_test, mean)

    proven = test.differs & noisy
    # The channels of a pixel may depend on each other: pixels are counted, against the expected
    # number of channels.
    if np.count_nonzero(proven.any(axis=-1)) > stats.poisson.isf(of_test, parted):
        return test
    return replace(test, half_width=np.where(proven, np.abs(test.difference), test.half_width))


def chance_of_parting(count_a: int, count_b: int) -> float:
    """The chance that all coin tosses of one side show heads and all of the other tails, for the
    coin with the largest chance."""
    share = count_a / (count_a + count_b)
    return 2.0 * math.exp(count_a * math.log(share) + count_b * math.log1p(-share))
