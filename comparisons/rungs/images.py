"""The rung of whole pictures: every image metric against its threshold.

Without noise each metric has a fixed threshold.  With noise the threshold is the metric's value
from noise alone (`comparisons.statistics.metric_null`) plus an allowance.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from comparisons.results.case import FloatArray, Images, Metrics, RungResult
from comparisons.statistics.cells import divisor
from comparisons.statistics.filtered import excess_by_filter
from comparisons.statistics.metric_null import (
    LEVEL,
    NOISE_LIMIT,
    can_draw,
    is_known,
    noise_alone,
    noise_ratio,
)
from comparisons.statistics.metrics import decibels, has_flip
from comparisons.statistics.rare import image_missed
from comparisons.statistics.shared_noise import excess_by_sharing
from comparisons.statistics.sides import side_of

MEAN_BIAS = 0.001
"""Permitted relative bias of a channel's mean: Mitsuba's ray epsilon causes some, as in the
statistics; without noise 6e-5 was measured.  A gain of 0.5 %, the least that matters, is five times
the permitted bias."""

NOISE_FREE = {
    "ssim": (
        0.9999,
        "float32 moves an edge across a sample here and there (measured: 0.999996 and better); a "
        "shift by a tenth of a pixel gives 0.997",
    ),
    "flip": (
        0.001,
        "a pixel in a thousand that is wholly another; a gain of 0.5 % gives 0.013, a shift by a "
        "fiftieth of a pixel 0.002 to 0.005",
    ),
    "psnr": (
        50.0,
        "dB; a pixel in 10^5 that is wholly another (measured: 65 and better); a gain of 2 % "
        "gives 45",
    ),
    "relative_rmse": (
        0.005,
        "of the reference's root mean square: a gain of 0.5 %",
    ),
    "relmse": (
        1e-4,
        "a gain of 1 % (measured: 9e-6 and less)",
    ),
}
"""Thresholds of pictures without noise, and their reasons.  With noise no threshold is stricter."""


class Gate(NamedTuple):
    """One metric: its value, its value from noise alone, its threshold, and whether it passed.

    NaN where a value is not known, and as the threshold of a metric that is not judged.
    """

    value: float
    by_noise: float
    threshold: float
    passed: bool

    def as_json(self) -> dict[str, Any]:
        return {name: _finite(value) for name, value in self._asdict().items()}


def images_rung(
    images: Images, metrics: Metrics, replicates: tuple[FloatArray, FloatArray] | None
) -> RungResult:
    """Compare the two pictures by metrics, which see errors that average out in the rungs below.

    replicates: the noisy pictures (replicates, height, width, 3) of the candidate and the
    reference, two or more of each, whose means `images` are;  None for pictures without noise.
    The pictures differ if any one metric is beyond its threshold.
    """
    if metrics.nonfinite:
        return RungResult("images", "invalid", f"{metrics.nonfinite} pixels are not finite")
    if np.array_equal(images.candidate, images.reference):
        return RungResult(
            "images", "agree", "the pictures are equal", {"noisy": replicates is not None}
        )
    numbers: dict[str, Any] = {"noisy": replicates is not None}
    facts, failed = [], []
    sharing = 1.0
    if replicates is not None:
        ratio, standard_error = noise_ratio(*replicates)
        numbers |= {
            "difference_over_noise": _finite(ratio),
            "standard_error": standard_error,
            "difference_over_noise_limit": NOISE_LIMIT,
        }
        facts.append(
            f"the squared difference is {ratio:.3g} ± {standard_error:.2g} times that of the noise"
        )
        sharing = _sharing(replicates)
        highest = NOISE_LIMIT * sharing
        # Five standard errors: the mean over tiles is near normal, one false alarm in 10^6.
        if ratio - 5.0 * standard_error > NOISE_LIMIT and ratio > highest:
            failed.append(f"{facts[0]}, expected {highest:.3g} at most")
        if sharing > 1.0:
            numbers["excess_by_sharing"] = _finite(sharing)
            facts.append(
                "pixels far from each other share random numbers, so that metrics have no threshold"
            )
    filtered = _filtered(images, replicates)
    if filtered > 0.0:
        numbers["excess_by_filter"] = filtered
        facts.append(
            "the reference's pixels share noise, as through a filter, which its variance does not "
            "tell: only the squared difference and the bias are judged"
        )
    gates = {
        **_metric_gates(images, metrics, replicates, sharing, filtered > 0.0),
        "bias": _bias(images, replicates, filtered),
    }
    numbers |= {name: gate.as_json() for name, gate in gates.items()}
    for name, gate in gates.items():
        if not gate.passed:
            failed.append(f"{LABEL[name]} {gate.value:.4g}, expected {_expected(name, gate)}")
    if failed:
        return RungResult("images", "differ", "; ".join(failed), numbers)
    facts.append(
        ", ".join(
            f"{LABEL[name]} {gate.value:.4g}"
            for name, gate in gates.items()
            if not math.isnan(gate.value)
        )
    )
    if not has_flip():
        facts.append("FLIP is left out: flip-evaluator is not installed")
    return RungResult("images", "agree", "; ".join(facts), numbers)


LABEL = {
    "ssim": "SSIM",
    "flip": "FLIP",
    "psnr": "PSNR",
    "relative_rmse": "relative RMSE",
    "relmse": "relMSE",
    "bias": "bias of the mean",
}

MORE_IS_BETTER = ("ssim", "psnr")


def _expected(name: str, gate: Gate) -> str:
    text = f"{gate.threshold:.4g} at {'least' if name in MORE_IS_BETTER else 'most'}"
    return f"{text} (noise alone: {gate.by_noise:.4g})" if math.isfinite(gate.by_noise) else text


def _metric_gates(
    images: Images,
    metrics: Metrics,
    replicates: tuple[FloatArray, FloatArray] | None,
    sharing: float,
    filtered: bool,
) -> dict[str, Gate]:
    """filtered: a known reference's pixels share noise;  sharing: as found by `excess_by_sharing`.
    If so, or above 1, the resampled noise does not show how far the metrics scatter, and only the
    squared difference and bias are judged."""
    size = math.sqrt(float((images.reference**2).mean()))

    def values(errors: FloatArray) -> dict[str, float]:
        """The metrics from the means of their maps."""
        dissimilarity, flip, encoded2, squared, relative2 = errors.tolist()
        return {
            "ssim": 1.0 - dissimilarity,
            "flip": flip,
            "psnr": decibels(encoded2),
            "relative_rmse": math.sqrt(squared) / size if size else math.inf,
            "relmse": relative2,
        }

    measured = {
        "ssim": metrics.ssim,
        "flip": metrics.flip,
        "psnr": metrics.psnr,
        "relative_rmse": metrics.rmse / size if size else math.inf,
        "relmse": metrics.relmse,
    }
    by_noise = dict.fromkeys(measured, math.nan)
    worst = {name: threshold for name, (threshold, _) in NOISE_FREE.items()}
    if replicates is not None and (filtered or sharing > 1.0 or not can_draw(replicates)):
        return {name: Gate(value, math.nan, math.nan, True) for name, value in measured.items()}
    if replicates is not None:
        found, expected, highest = noise_alone(images, replicates)
        measured, by_noise = values(found), values(expected)
        for name, value in values(highest).items():
            better = min if name in MORE_IS_BETTER else max
            worst[name] = better(worst[name], value)
    gates = {}
    for name, value in measured.items():
        passed = value >= worst[name] if name in MORE_IS_BETTER else value <= worst[name]
        # SSIM is not defined for pictures below 3 x 3 pixels; the others judge these.
        gates[name] = Gate(value, by_noise[name], worst[name], passed or math.isnan(value))
    return gates


def _sharing(replicates: tuple[FloatArray, FloatArray]) -> float:
    """The larger `excess_by_sharing` of the sides whose replicates are known."""
    return max((excess_by_sharing(x) for x in replicates if not is_known(x)), default=1.0)


def _filtered(images: Images, replicates: tuple[FloatArray, FloatArray] | None) -> float:
    """As `excess_by_filter`; 0 unless the reference's variance is known."""
    if replicates is None or not is_known(replicates[1]):
        return 0.0
    spread = 0.5 * (replicates[1][0] - replicates[1][1])
    return excess_by_filter(images.candidate, images.reference, spread**2)


def _bias(
    images: Images, replicates: tuple[FloatArray, FloatArray] | None, filtered: float = 0.0
) -> Gate:
    """The largest bias of a channel's mean, relative to the reference's;  filtered: the excess of
    the variance of a known reference's mean."""
    mean = images.reference.mean(axis=(0, 1))
    difference = np.abs(images.candidate.mean(axis=(0, 1)) - mean)
    scale = divisor(mean, float(mean.mean()))
    noise = reach = np.zeros(3)
    if replicates is not None:
        ours, theirs = (_error_of_mean(x) for x in replicates)
        noise = np.hypot(ours, math.sqrt(1.0 + filtered) * theirs)
        dof = min(_BY_PIXELS if is_known(x) else len(x) - 1 for x in replicates)
        of_one = LEVEL / 6.0  # three channels, two sides
        missed = -special.ndtri(of_one) * np.sqrt(_missed(replicates))
        reach = np.hypot(special.stdtrit(dof, of_one) * noise, missed)
    excess = difference - MEAN_BIAS * scale - reach
    worst = int(np.argmax(excess))
    if not scale[worst]:
        value = math.inf if difference[worst] else 0.0
        return Gate(value, math.nan, MEAN_BIAS, not excess[worst] > 0.0)
    value, by_noise = difference[worst] / scale[worst], noise[worst] / scale[worst]
    threshold = MEAN_BIAS + reach[worst] / scale[worst]
    return Gate(float(value), float(by_noise), float(threshold), not excess[worst] > 0.0)


_BY_PIXELS = 1000
"""Degrees of freedom of an error that is estimated from many pixels."""


def _missed(replicates: tuple[FloatArray, FloatArray]) -> FloatArray:
    """(3,): the variance of the mean's difference by rare light that a side may have missed (see
    `statistics.rare`)."""
    if any(is_known(x) or len(x) < 2 for x in replicates):
        return np.zeros(3)
    return image_missed(*(side_of(x) for x in replicates))


def _error_of_mean(pictures: FloatArray) -> FloatArray:
    """(3,): the standard error of the mean over replicates and pixels."""
    if is_known(pictures):
        pixels = pictures[0, ..., 0].size
        sums = ((pictures[0] - pictures[1]) ** 2).sum(axis=(0, 1)) / 4.0
        return np.asarray(np.sqrt(sums) / pixels)
    means = pictures.mean(axis=(1, 2))
    return np.asarray(means.std(axis=0, ddof=1) / math.sqrt(len(pictures)))


def _finite(value: float) -> float | None:
    """For JSON, which has neither NaN nor infinity."""
    return value if math.isfinite(value) else None
