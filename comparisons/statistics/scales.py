"""The scales at which biases are tested: one row of SCALES each, with its level, test and words.

A column that is 2 % dark changes each tile by an eighth of that. A vignette whose mean is kept
changes each tile by less than its margin. Both are many standard errors off in a sum of their own:
over a row or a column, or over the picture times a wave (the modes of the discrete cosine transform
up to the second order, of which the mean is the first, and the sum of two for what is round).
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import special

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import (
    TILE,
    Cells,
    Margins,
    divisor,
    lines,
    tiles,
    whole,
)
from comparisons.statistics.metrics import ratio
from comparisons.statistics.rare import Events, unmet_variance
from comparisons.statistics.sides import Side, neighbourhood
from comparisons.statistics.welch import MOST_DOF, BiasTest, Error, bias_test, welch_errors


class Pair(NamedTuple):
    """The sides of a comparison, with replicates or a known mean;  tile: side in pixels."""

    a: Side
    b: Side
    margins: Margins
    tile: int = TILE


def _of_means(pair: Pair, cells: Cells, margin: FloatArray | float, level: float) -> BiasTest:
    """The means over parts of the picture, each channel by itself: errors of hue would cancel in
    luminance."""
    a, b = pair.a, pair.b
    return bias_test(
        cells.means(a.mean) - cells.means(b.mean),
        cells.means(b.size),
        welch_errors(a.of(cells), b.of(cells), a, b),
        margin,
        level,
        float(b.size.mean()),
        Events.of(a, b, cells),
    )


def image_test(pair: Pair, level: float) -> BiasTest:
    """(3,)"""
    return _of_means(pair, whole(pair.b.mean), pair.margins.image, level)


def tile_test(pair: Pair, level: float) -> BiasTest:
    """(rows, columns, 3)"""
    return _of_means(pair, tiles(pair.b.mean, pair.tile), pair.margins.tile, level)


def pixel_test(pair: Pair, level: float) -> BiasTest:
    """(height, width, 3)

    The margin is that of a pixel, but at most half the standard deviation of one picture's pixel:
    whatever a rounded ray could hit differently varies within the pixel, and so is noise. Where
    that is less than the rounding of stored values, the margin is this rounding.

    A pixel with two possible values (a lamp's edge, one sample per pixel) may by chance have one
    value in all pictures of the candidate and the other in all of the reference, without any
    spread. With few replicates such pixels count only if there are more than chance produces.
    """
    a, b, margins, _ = pair
    own, near = welch_errors(a.of_pixels(), b.of_pixels(), a, b, single_pixels=True)
    mean = float(b.size.mean())
    scale = divisor(b.size, mean)
    spread = np.sqrt(np.maximum(a.variance, b.variance))
    hit = np.minimum(margins.pixel, 0.5 * np.minimum(ratio(spread, scale), 1.0))
    margin = margins.constant + np.maximum(hit, ratio(margins.stored * np.abs(b.size), scale))
    parted = scale.size * (chance_of_parting(a.count, b.count) if b.pictures is not None else 0.0)
    still = spread <= margins.constant * scale
    noisy = neighbourhood(np.where(still, 0.0, 1.0)).max(axis=-1, keepdims=True) > 0.0
    if parted < level / 2.0:  # enough replicates: chance does not separate the sides
        near = replace(near, value=np.where(still, own.value, near.value))
    difference = a.mean - b.mean
    missed = np.where(still, 0.0, unmet_variance(a, b))
    unmet = Error(
        np.sqrt(np.maximum(own.value, near.value) ** 2 + missed),
        np.full(difference.shape, float(MOST_DOF)),
    )
    test = bias_test(difference, b.size, (own, near, unmet), margin, level, mean)

    proven = test.differs & noisy
    # The channels of a pixel may depend on each other: pixels are counted, against the expected
    # number of channels.
    count = np.count_nonzero(proven.any(axis=-1))
    if count and special.pdtrc(count - 1, parted) <= level:  # a Poisson number is as large
        return test
    return replace(test, half_width=np.where(proven, np.abs(test.difference), test.half_width))


def chance_of_parting(count_a: int, count_b: int) -> float:
    """The chance that all coin tosses of one side show heads and all of the other tails, for the
    coin with the largest chance."""
    share = count_a / (count_a + count_b)
    return 2.0 * math.exp(count_a * math.log(share) + count_b * math.log1p(-share))


ORDERS = ((0, 1), (1, 0), (0, 2), (1, 1), (2, 0))
"""Half waves along y and along x of each mode but the last, which is the sum of whole waves along
both: the falloff of a lens has two thirds of its strength in each of them."""

FEWEST = 8
"""Side in pixels of a picture from which on lines and modes are tested: smaller ones are a tile."""


def line_test(pair: Pair, level: float) -> BiasTest | None:
    """Of all rows, then of all columns, (height + width, 3); None for small pictures."""
    b, margins = pair.b, pair.margins
    if min(b.mean.shape[:2]) < FEWEST:
        return None
    cells = lines(b.mean)
    steps = _steps(b.mean) / cells.pixels
    scale = divisor(cells.means(b.size), float(b.size.mean()))
    edges = margins.pixel * ratio(steps, scale)
    return _of_means(pair, cells, np.minimum(margins.image + edges, margins.tile), level)


def _steps(mean: FloatArray) -> FloatArray:
    """(height + width, 3): the sums over each line of the larger step to a neighbouring line.

    An edge that a renderer moves by a fraction of a pixel (`Margins.pixel`) changes its pixels by
    that fraction of the step there; where a line resembles its neighbours, none is to be moved.
    """
    steps = []
    for axis in (0, 1):
        step = np.abs(np.diff(mean, axis=axis))
        none = np.zeros_like(step.take([0], axis=axis))
        before, after = (np.concatenate(x, axis=axis) for x in ((none, step), (step, none)))
        steps.append(np.maximum(before, after).sum(axis=1 - axis))
    return np.concatenate(steps)


def mode_test(pair: Pair, level: float) -> BiasTest | None:
    """The root mean square of each mode of the difference, (modes, 3), with the mode's sign; None
    for small pictures.

    What differs at one place, as a shadow that begins too late, has at most twice as much in a mode
    as in the mean: Mitsuba's offset makes less than half of `margins.image` there, a fifth in the
    mean.
    """
    a, b, margins, _ = pair
    height, width = b.mean.shape[:2]
    if min(height, width) < FEWEST:
        return None
    waves = np.stack([np.outer(_wave(y, height), _wave(x, width)) for y, x in ORDERS])
    waves = np.concatenate([waves, waves[2:3] + waves[4:5]])
    waves /= np.sqrt((waves**2).mean(axis=(1, 2), keepdims=True))
    once, twice, four = (partial(_along, waves**n) for n in (1, 2, 4))
    pixels = np.full((len(waves), 1), float(height * width))
    noise_a, noise_b = (side.of_sums(once, twice, four, pixels) for side in (a, b))
    mean = np.broadcast_to(b.size.mean(axis=(0, 1)), (len(waves), 3))
    # At a crest an event counts by its height; either side may have missed it, since waves have
    # both signs.
    event = np.abs(waves).max(axis=(1, 2))[:, None] * Events.of(a, b, whole(b.mean)).largest()
    return bias_test(
        once(a.mean - b.mean) / pixels,
        mean,
        welch_errors(noise_a, noise_b, a, b),
        0.5 * margins.image,
        level,
        float(mean.mean()),
        Events(event, event),
    )


def _wave(order: int, size: int) -> FloatArray:
    return np.asarray(np.cos(np.pi * order * (np.arange(size) + 0.5) / size))


def _along(waves: FloatArray, images: FloatArray) -> FloatArray:
    """(..., height, width, 3) -> (..., modes, 3)."""
    return np.asarray(np.einsum("mhw,...hwc->...mc", waves, images, optimize=True))


# ---- the rows ------------------------------------------------------------------------------------


class Place(NamedTuple):
    """Which of the tests of a scale one is: in words, and as numbers for JSON."""

    words: str
    numbers: dict[str, int]


class Scale(NamedTuple):
    """A family of tests that share one level (Šidák 1967).

    name: the key of its numbers;  what: that is tested, for people;  level: chance of a false alarm
    of all its tests together;  test: at a level; None where the picture is too small;  finds: what
    is said where some differ;  though: what does not, or is judged before;  place: of an index into
    the tests, for the picture's shape and the side of a tile.
    """

    name: str
    what: str
    level: float
    test: Callable[[Pair, float], BiasTest | None]
    finds: str
    though: str = ""
    place: Callable[[tuple[int, ...], tuple[int, ...], int], Place] = lambda *_: Place("", {})


def _of_tile(at: tuple[int, ...], shape: tuple[int, ...], tile: int) -> Place:
    row, column = (tile * int(k) for k in at[:2])
    return Place(f"at x, y = ({column}, {row})", {"worst_x": column, "worst_y": row})


def _of_pixel(at: tuple[int, ...], shape: tuple[int, ...], tile: int) -> Place:
    return _of_tile(at, shape, 1)


def _of_line(at: tuple[int, ...], shape: tuple[int, ...], tile: int) -> Place:
    index, height = at[0], shape[0]
    words = f"row {index}" if index < height else f"column {index - height}"
    return Place(words, {"worst": index})


def _of_mode(at: tuple[int, ...], shape: tuple[int, ...], tile: int) -> Place:
    index = at[0]
    if index == len(ORDERS):
        return Place("from the middle to the corners", {"worst": index})
    y, x = ORDERS[index]
    what = {1: "half a wave", 2: "a whole wave"}
    waves = [f"{what[n]} along {axis}" for n, axis in ((x, "x"), (y, "y")) if n]
    return Place(" and ".join(waves), {"worst": index})


_SOME = "{count} of {tests} {what} differ{though}; the worst, {place}: {beyond}"
_SMOOTH = "brightness differs smoothly over the picture{though}: {place}, {beyond}"

IMAGE, TILES, PIXELS, LINES, MODES = SCALES = (
    Scale("image", "image mean", 5e-4, image_test, "the image mean differs: {beyond}"),
    Scale("tiles", "tiles", 1e-4, tile_test, _SOME, "not the image mean", _of_tile),
    Scale("pixels", "pixels", 1e-4, pixel_test, _SOME, "not a whole tile", _of_pixel),
    Scale("lines", "rows and columns", 5e-5, line_test, _SOME, "no tile and no pixel", _of_line),
    Scale("modes", "smooth patterns", 5e-5, mode_test, _SMOOTH, "not its mean", _of_mode),
)
"""In the order in which they are told.  Their levels, with those of the ranks (`ranks.LEVEL`) and
of the order of both sides' replicates (`order.ORDER_LEVEL`), add up to one false alarm in a
thousand.  The image mean has the largest share because its interval also states the equivalence."""
