"""Tests of rows, columns and smooth patterns, whose errors neither tiles nor pixels show.

A column that is 2 % dark changes each tile by an eighth of that. A vignette whose mean is kept
changes each tile by less than its margin. Both are many standard errors off in a sum of their own:
over a row or a column, or over the picture times a wave (the modes of the discrete cosine transform
up to the second order, of which the mean is the first, and the sum of two for what is round).
"""

from functools import partial

import numpy as np

from comparisons.results.case import FloatArray
from comparisons.statistics.metrics import ratio
from comparisons.statistics.scales import DARK, LINE_LEVEL, MODE_LEVEL, Margins
from comparisons.statistics.sides import Side
from comparisons.statistics.unmet import Events, of_image
from comparisons.statistics.welch import BiasTest, bias_test, welch_errors

ORDERS = ((0, 1), (1, 0), (0, 2), (1, 1), (2, 0))
"""Half waves along y and along x of each mode but the last, which is the sum of whole waves along
both: the falloff of a lens has two thirds of its strength in each of them."""

FEWEST = 8
"""Side in pixels of a picture from which on lines and modes are tested: smaller ones are a tile."""


def line_test(a: Side, b: Side, margins: Margins, level: float = 1.0) -> BiasTest | None:
    """The means of all rows, then of all columns, (height + width, 3); None for small pictures."""
    height, width = b.mean.shape[:2]
    if min(height, width) < FEWEST:
        return None
    pixels = np.repeat([float(width), float(height)], [height, width])[:, None]
    noise_a, noise_b = (side.of_sums(_lines, _lines, _lines, pixels) for side in (a, b))
    reference = _lines(b.mean) / pixels
    mean = float(b.mean.mean())
    steps = _steps(b.mean) / pixels
    edges = margins.pixel * ratio(steps, np.maximum(np.abs(reference), DARK * abs(mean)))
    return bias_test(
        _lines(a.mean) / pixels - reference,
        reference,
        welch_errors(noise_a, noise_b, a, b),
        np.minimum(margins.image + edges, margins.tile),
        level * LINE_LEVEL,
        mean,
        Events.of_cells(a, b, _lines, pixels),
    )


def _steps(mean: FloatArray) -> FloatArray:
    """(height + width, 3): the sums over each line of the larger step to a neighbouring line.

    An edge that a renderer moves by a fraction of a pixel (`Margins.pixel`) changes its pixels by
    that fraction of the step there; where a line resembles its neighbours, none is to be moved.
    """
    found = []
    for axis in (0, 1):
        step = np.abs(np.diff(mean, axis=axis))
        none = np.zeros_like(step.take([0], axis=axis))
        before, after = (np.concatenate(x, axis=axis) for x in ((none, step), (step, none)))
        found.append(np.maximum(before, after).sum(axis=1 - axis))
    return np.concatenate(found)


def mode_test(a: Side, b: Side, margins: Margins, level: float = 1.0) -> BiasTest | None:
    """The root mean square of each mode of the difference, (modes, 3), with the mode's sign; None
    for small pictures.

    What differs at one place, as a shadow that begins too late, has at most twice as much in a mode
    as in the mean: Mitsuba's offset makes less than half of `margins.image` there, a fifth in the
    mean.
    """
    height, width = b.mean.shape[:2]
    if min(height, width) < FEWEST:
        return None
    waves = np.stack([np.outer(_wave(y, height), _wave(x, width)) for y, x in ORDERS])
    waves = np.concatenate([waves, waves[2:3] + waves[4:5]])
    waves /= np.sqrt((waves**2).mean(axis=(1, 2), keepdims=True))
    once, twice, four = (partial(_along, waves**n) for n in (1, 2, 4))
    pixels = np.full((len(waves), 1), float(height * width))
    noise_a, noise_b = (side.of_sums(once, twice, four, pixels) for side in (a, b))
    mean = np.broadcast_to(b.mean.mean(axis=(0, 1)), (len(waves), 3))
    # At a crest an event counts by its height; either side may have missed it, since waves have
    # both signs.
    event = np.abs(waves).max(axis=(1, 2))[:, None] * of_image(a, b).largest()
    return bias_test(
        once(a.mean - b.mean) / pixels,
        mean,
        welch_errors(noise_a, noise_b, a, b),
        0.5 * margins.image,
        level * MODE_LEVEL,
        float(mean.mean()),
        Events(event, event),
    )


def named_line(index: int, height: int) -> str:
    """Of an index into the lines of `line_test`."""
    return f"row {index}" if index < height else f"column {index - height}"


def named_mode(index: int) -> str:
    """Of an index into the modes of `mode_test`."""
    if index == len(ORDERS):
        return "from the middle to the corners"
    y, x = ORDERS[index]
    what = {1: "half a wave", 2: "a whole wave"}
    parts = [f"{what[n]} along {axis}" for n, axis in ((x, "x"), (y, "y")) if n]
    return " and ".join(parts)


def _wave(order: int, size: int) -> FloatArray:
    return np.asarray(np.cos(np.pi * order * (np.arange(size) + 0.5) / size))


def _along(waves: FloatArray, images: FloatArray) -> FloatArray:
    """(..., height, width, 3) -> (..., modes, 3)."""
    return np.asarray(np.einsum("mhw,...hwc->...mc", waves, images, optimize=True))


def _lines(images: FloatArray) -> FloatArray:
    """(..., height, width, 3) -> (..., height + width, 3)."""
    return np.concatenate([images.sum(axis=-2), images.sum(axis=-3)], axis=-2)
