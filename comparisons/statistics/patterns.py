"""Tests of rows, columns and smooth patterns, whose errors neither tiles nor pixels show.

A column that is 2 % dark changes each tile by an eighth of that. A vignette whose mean is kept
changes each tile by less than its margin. Both are many standard errors off in a sum of their own:
over a row or a column, or over the picture times a cosine (the modes of the discrete cosine
transform up to the second order, of which the mean is the first).
"""

from functools import partial

import numpy as np

from comparisons.results.case import FloatArray
from comparisons.statistics.scales import LINE_LEVEL, MODE_LEVEL, Margins
from comparisons.statistics.sides import Side
from comparisons.statistics.unmet import Events, of_image
from comparisons.statistics.welch import BiasTest, bias_test, welch_errors

ORDERS = ((0, 1), (1, 0), (0, 2), (1, 1), (2, 0))
"""Half waves of each mode along y and along x."""

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
    return bias_test(
        _lines(a.mean) / pixels - reference,
        reference,
        welch_errors(noise_a, noise_b, a, b),
        margins.tile,
        level * LINE_LEVEL,
        b.mean.mean(),
        Events.of_cells(a, b, _lines, pixels),
    )


def mode_test(a: Side, b: Side, margins: Margins, level: float = 1.0) -> BiasTest | None:
    """The amplitudes of the difference's modes, (modes, 3), of which the picture's mean would be
    another; None for small pictures."""
    height, width = b.mean.shape[:2]
    if min(height, width) < FEWEST:
        return None
    waves = np.stack([np.outer(_wave(y, height), _wave(x, width)) for y, x in ORDERS])
    once, twice, four = (partial(_along, waves**n) for n in (1, 2, 4))
    power = (waves**2).sum(axis=(1, 2))[:, None]
    noise_a, noise_b = (side.of_sums(once, twice, four, power) for side in (a, b))
    mean = np.broadcast_to(b.mean.mean(axis=(0, 1)), (len(ORDERS), 3))
    # At a crest an event counts as much as in the mean, but for the power; either side may have
    # missed it, since waves have both signs.
    event = float(height * width) / power * of_image(a, b).largest()
    return bias_test(
        once(a.mean - b.mean) / power,
        mean,
        welch_errors(noise_a, noise_b, a, b),
        margins.image,
        level * MODE_LEVEL,
        float(mean.mean()),
        Events(event, event),
    )


def named_line(index: int, height: int) -> str:
    """Of an index into the lines of `line_test`."""
    return f"row {index}" if index < height else f"column {index - height}"


def named_mode(index: int) -> str:
    """Of an index into ORDERS."""
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
