"""The results of the tests in words, and as numbers for JSON; advice for a run that was too noisy.

The advice says how many more samples are needed, and on which side. The samples of both sides can
be raised in a comparison of two renderers. At a gate only the candidate's can: the reference may be
a baseline of few replicates. If these alone are too noisy, no candidate could show agreement, and
the advice is about the reference.
"""

import math
from typing import Any

import numpy as np

from comparisons.results.case import FloatArray
from comparisons.statistics.ranks import Uniformity
from comparisons.statistics.scales import CHANNELS, POWER
from comparisons.statistics.unseen import Unseen
from comparisons.statistics.welch import BiasTest


def channels(values: FloatArray) -> dict[str, float | None]:
    """(3,) by channel."""
    return {name: finite(value) for name, value in zip(CHANNELS, values, strict=True)}


def finite(value: float | np.floating[Any]) -> float | None:
    """The value; None if it is not finite (unbounded, or relative to a black picture)."""
    return float(value) if math.isfinite(value) else None


def percent(fraction: float, *, sign: bool = False) -> str:
    """For example "0.31 %", or "+0.31 %" with its sign."""
    if not math.isfinite(fraction):
        return "∞"
    number = 100.0 * fraction
    # From 100 on, two significant digits would be written with an exponent.
    digits = f"{number:+.2g}" if abs(number) < 99.5 else f"{number:+.0f}"
    return f"{digits if sign else digits.lstrip('+')} %"


def interval(test: BiasTest, at: tuple[int, ...]) -> str:
    """For example "G +0.12 ± 0.05 %", the half width being the confidence interval's."""
    name = CHANNELS[at[-1]]
    if not test.scale[at]:
        return f"{name} {test.difference[at]:+.2g} where the reference is black"
    half_width = percent(test.over_scale(test.half_width)[at])
    return f"{name} {100.0 * test.relative[at]:+.3g} ± {half_width}"


def beyond(test: BiasTest, at: tuple[int, ...]) -> str:
    """The interval, and the margin that it lies outside of."""
    return f"{interval(test, at)}, beyond ±{percent(float(test.margin[at]))}"


def which(test: BiasTest, side: int, what: str, though: str = "") -> str:
    """How many cells of `side` pixels differ, and the worst of them."""
    row, column, _ = test.worst
    differ = test.differs.any(axis=-1)
    return (
        f"{np.count_nonzero(differ)} of {differ.size} {what} differ{though}; the "
        f"worst, at x, y = ({column * side}, {row * side}): {beyond(test, test.worst)}"
    )


def detectable_words(image: BiasTest, tiles: BiasTest, side: int, pixels: BiasTest) -> str:
    """The smallest bias that would have been seen at each scale."""
    of_tiles, of_pixels = (
        test.over_scale(test.detectable).max(axis=-1) for test in (tiles, pixels)
    )
    text = (
        f"the smallest bias of the image mean seen with {100.0 * POWER:g} % power is "
        f"{percent(image.over_scale(image.detectable).max())}; of a tile of {side} x {side} pixels "
        f"it is {percent(float(np.median(of_tiles)))} in half of the tiles and "
        f"{percent(of_tiles.max())} in all"
    )
    half = float(np.median(of_pixels))
    if not math.isfinite(half):
        return f"{text}; single pixels are tested only where there is no noise"
    return f"{text}; of a pixel it is {percent(half)} in half of the pixels"


def unseen_words(found: Unseen) -> str:
    """On what the statement is conditional."""
    return (
        f"this holds for light that the pictures have met: what reaches less than one in "
        f"{found.values:,} pixel values may be missing on both sides; "
        f"{percent(found.met_once)} of the energy was met by one picture alone, and of such light "
        f"at most {percent(found.missing)} is missing by chance"
    )


def image_numbers(test: BiasTest) -> dict[str, Any]:
    """Numbers by channel; names that end in _of_bias or _bias are fractions of the mean."""
    return {
        "relative_bias": channels(test.relative),
        "standard_error_of_bias": channels(test.over_scale(test.standard_error)),
        "half_width_of_bias": channels(test.over_scale(test.half_width)),
        "detectable_bias": channels(test.over_scale(test.detectable)),
        "p_value": channels(test.p_value()),
        "degrees_of_freedom": channels(test.errors[0].dof),
        "margin": float(test.margin[0]),
        "differs": bool(test.differs.any()),
    }


def cell_numbers(test: BiasTest, side: int) -> dict[str, Any]:
    """Numbers of tiles, or of pixels if `side` is 1."""
    row, column, channel = test.worst
    differ = test.differs.any(axis=-1)
    return {
        "tested": differ.size,
        "differ": int(np.count_nonzero(differ)),
        "median_detectable_bias": finite(np.median(test.over_scale(test.detectable))),
        "largest_detectable_bias": finite(test.over_scale(test.detectable).max()),
        "worst_x": column * side,
        "worst_y": row * side,
        "worst_channel": CHANNELS[channel],
        "worst_bias": finite(test.relative[test.worst]),
        "worst_half_width": finite(test.over_scale(test.half_width)[test.worst]),
        "worst_margin": float(test.margin[test.worst]),
        "worst_p_value": finite(float(test.p_value(test.worst))),
    }


def line_numbers(test: BiasTest) -> dict[str, Any]:
    """Numbers of rows and columns, or of modes."""
    differ = test.differs.any(axis=-1)
    return {
        "tested": differ.size,
        "differ": int(np.count_nonzero(differ)),
        "median_detectable_bias": finite(np.median(test.over_scale(test.detectable))),
        "worst": test.worst[0],
        "worst_channel": CHANNELS[test.worst[1]],
        "worst_bias": finite(test.relative[test.worst]),
        "worst_half_width": finite(test.over_scale(test.half_width)[test.worst]),
        "worst_margin": float(test.margin[test.worst]),
        "worst_p_value": finite(float(test.p_value(test.worst))),
    }


def unseen_numbers(found: Unseen | None) -> dict[str, Any] | None:
    """Shares of the energy; None without replicates."""
    if found is None:
        return None
    return {
        "met_once": found.met_once,
        "missing_at_most": finite(found.missing),
        "pixel_values": found.values,
    }


def uniformity_numbers(found: Uniformity | None) -> dict[str, Any] | None:
    """Numbers of the rank test; None if it was not run."""
    if found is None:
        return None
    return {
        "mean_p_value": found.mean,
        "mean_p_value_beyond_margin": found.mean_beyond_margin,
        "expected": found.expected,
        "standard_error": found.error,
        "p_wide": found.p_wide,
        "p_narrow": found.p_narrow,
        "p_reversed": found.p_reversed,
        "blocks": found.blocks,
        "replicates": found.replicates,
    }


def uniformity_words(found: Uniformity) -> str:
    """The mean p-value and its expectation."""
    return (
        f"mean p-value of the blocks {found.mean:.3f}, expected {found.expected:.3f} ± "
        f"{found.error:.2g}"
    )
