"""The results of the tests in words, and as numbers for JSON; advice for a run that was too noisy.

The advice says how many more samples are needed, and on which side. The samples of both sides can
be raised in a comparison of two renderers. At a gate only the candidate's can: the reference may be
a baseline of few replicates. If these alone are too noisy, no candidate could show agreement, and
the advice is about the reference.
"""

import bisect
import math
from typing import Any

import numpy as np
from scipy import special

from comparisons.results.case import FloatArray
from comparisons.statistics.ranks import Uniformity
from comparisons.statistics.rare import Unseen
from comparisons.statistics.scales import CHANNELS, IMAGE_LEVEL, POWER, Margins
from comparisons.statistics.sides import Known, known_side, side_of
from comparisons.statistics.welch import MOST_DOF, BiasTest, image_test, quantiles


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


# ---- how many more samples are needed ------------------------------------------------------------

FEW = 2.0
"""Replicates are called too few if more of them need so many times fewer samples than more samples
per pixel do."""

LITTLE = 1.1
"""Factors below it are said in words: an estimated factor is no more exact (`samples_factor`)."""

ENOUGH = 8.0
"""Degrees of freedom from which on more replicates are as good as more samples per pixel."""

MOST = 1e7
"""Factors beyond it are called infinite."""

_UNKNOWN = "these pictures do not show how many samples are needed: give more replicates"


def noise_free_candidate(
    reference: FloatArray | Known, margins: Margins | None = None, level: float = 1.0
) -> BiasTest | None:
    """The test of the image mean that a candidate equal to the reference, and without noise, would
    get: its `detectable` is the smallest bias that any candidate can show against this reference.

    reference: (R, height, width, 3), or known;  None if it is a single picture, whose noise is not
    known.
    """
    if not isinstance(reference, Known) and len(reference) < 2:
        return None
    side = known_side(reference) if isinstance(reference, Known) else side_of(reference)
    perfect = known_side(Known(side.mean, np.zeros_like(side.mean)))
    return image_test(side, perfect, margins or Margins(), level)


def wanted(
    image: BiasTest,
    limit: float,
    alone: BiasTest | None,
    level: float = 1.0,
    least: float = 0.0,
) -> tuple[str, float]:
    """How many more samples are needed, in words, and the factor of samples per pixel.

    image: the test of this run;  alone: what the reference by itself allows, if only the
    candidate's samples can be raised; None if those of both sides can;  level: that of the test;
    least: the factor that is needed anyway, infinite if it is unknown.
    """
    factor = max(image.samples_factor(limit), least)
    if not math.isfinite(factor):
        return _UNKNOWN, factor
    if alone is not None:
        factor = max(factor_needed(image, limit, alone, level, replicates=False), least)
    elif min(float(np.min(error.dof)) for error in image.errors) >= ENOUGH:
        return _times(factor, factor, ""), factor
    fewer = max(factor_needed(image, limit, alone, level, replicates=True), least)
    if not math.isfinite(fewer) and alone is not None:
        return _too_noisy_a_reference(alone, limit, level), fewer
    return _times(fewer, factor, "" if alone is None else " of the candidate"), factor


def shortfall(alone: BiasTest, limit: float, level: float = 1.0) -> str:
    """Why no candidate can reach `limit` against this reference; "" if one can."""
    seen = alone.over_scale(alone.detectable).max()
    return _too_noisy_a_reference(alone, limit, level) if seen > limit else ""


def _too_noisy_a_reference(alone: BiasTest, limit: float, level: float) -> str:
    seen = float(alone.over_scale(alone.detectable).max())
    if seen > limit:
        replicates = factor_needed(alone, limit, None, level, replicates=True)
        more = _times(replicates, alone.samples_factor(limit), " of the reference")
        return (
            "the noise of the reference is the limit: even with a candidate without noise, a bias "
            f"below {percent(seen)} could be overlooked; {more}"
        )
    return (
        "the noise of the reference is the limit: the difference is too near to the limit to be "
        "decided against this reference, even by a candidate without noise"
    )


def factor_needed(
    image: BiasTest, limit: float, alone: BiasTest | None, level: float, *, replicates: bool
) -> float:
    """The factor of replicates, or of samples per pixel of each, that will probably suffice;
    infinite if none does.

    More replicates also have more degrees of freedom: four replicates of which each tells little
    seem to need a hundred times the samples, and need five times the replicates.  Squared errors of
    both sides add.  Of few replicates neither the difference nor its error is known well: the
    difference counts as far as it exceeds two standard errors, and an error as much as is certain.
    alone, level: as in `wanted`.
    """
    known = _known(image)
    fixed = np.zeros_like(known) if alone is None else np.minimum(_known(alone), known)
    size = np.maximum(np.abs(image.difference) - 2.0 * known, 0.0)
    margin = image.margin * image.scale
    goal = np.minimum(
        limit * image.scale - margin, np.maximum(limit * image.scale - size, size - margin)
    )
    reach_of = quantiles(-math.expm1(math.log1p(-level * IMAGE_LEVEL) / image.difference.size))[1]

    def suffices(factor: float) -> bool:
        value = np.sqrt((known**2 - fixed**2) / factor + fixed**2)
        dof = [error.dof * (factor if replicates else 1.0) for error in image.errors]
        reach = [reach_of[np.clip(d, 1.0, MOST_DOF).astype(np.int64)] * value for d in dof]
        return bool((np.max(reach, axis=0) <= goal).all())

    factors = np.geomspace(1.0, MOST, 400).tolist()
    least = bisect.bisect_left(factors, True, key=suffices)  # the reach falls with the factor
    return float(factors[least]) if least < len(factors) else math.inf


def _known(test: BiasTest) -> FloatArray:
    """The largest of the lower bounds, at 95 %, of the standard errors."""
    bounds = [e.value * np.sqrt(e.dof / special.chdtri(e.dof, 0.05)) for e in test.errors]
    return np.asarray(np.max(bounds, axis=0))


def _times(replicates: float, samples: float, whose: str) -> str:
    if not math.isfinite(replicates):
        return _UNKNOWN
    if max(replicates, samples) < LITTLE:
        return f"slightly more samples{whose} suffice: a tenth more"
    spp = _number(samples)
    if samples > FEW * replicates:
        other = f", or {spp} times the samples per pixel of each" if samples < MOST else ""
        return (
            f"there are too few replicates: it takes about {_number(replicates)} times the "
            f"replicates{whose}{other}"
        )
    return f"it takes about {spp} times the samples{whose}: replicates x {spp} or spp x {spp}"


def _number(factor: float) -> str:
    return f"{factor:.{0 if factor > 10 else 1}f}"
