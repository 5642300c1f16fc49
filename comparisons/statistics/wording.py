"""The results of the tests in words, and as numbers for JSON."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import CHANNELS, POWER
from comparisons.statistics.ranks import Uniformity
from comparisons.statistics.scales import IMAGE, PIXELS, TILES, Place, Scale
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


def words_of(scale: Scale, test: BiasTest, place: Place, alone: bool = True) -> str:
    """That some of a scale's tests differ, and the worst of them;  alone: no scale before does."""
    differ = test.differs.any(axis=-1)
    return scale.finds.format(
        count=np.count_nonzero(differ),
        tests=differ.size,
        what=scale.what,
        though=f", though {scale.though}" if alone else "",
        place=place.words,
        beyond=f"{interval(test, test.worst)}, beyond ±{percent(float(test.margin[test.worst]))}",
    )


def detectable_words(tests: Mapping[str, BiasTest], side: int) -> str:
    """The smallest bias that would have been seen of the image, of a tile and of a pixel."""
    of_image, of_tiles, of_pixels = (
        tests[scale.name].over_scale(tests[scale.name].detectable).max(axis=-1)
        for scale in (IMAGE, TILES, PIXELS)
    )
    text = (
        f"the smallest bias of the image mean seen with {100.0 * POWER:g} % power is "
        f"{percent(float(of_image))}; of a tile of {side} x {side} pixels "
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


def numbers_of(test: BiasTest, place: Place) -> dict[str, Any]:
    """Numbers of the many tests of a scale, the worst of which is at `place`."""
    differ = test.differs.any(axis=-1)
    detectable = test.over_scale(test.detectable)
    of_cells = {"largest_detectable_bias": finite(detectable.max())} if differ.ndim == 2 else {}
    return {
        "tested": differ.size,
        "differ": int(np.count_nonzero(differ)),
        "median_detectable_bias": finite(np.median(detectable)),
        **of_cells,
        **place.numbers,
        "worst_channel": CHANNELS[test.worst[-1]],
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
