"""Welch's test of many means at once, with the noise of both sides."""

import functools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from comparisons.results.case import FloatArray
from comparisons.statistics.cells import (
    POWER,
    ROUNDING,
    divisor,
)
from comparisons.statistics.metrics import ratio
from comparisons.statistics.rare import Events
from comparisons.statistics.sides import Noise, Side

MOST_DOF = 1000
"""Cap on degrees of freedom: beyond it the quantile is the normal one within 1 %."""


@dataclass(frozen=True)
class Error:
    """A standard error of differences and its degrees of freedom."""

    value: FloatArray
    dof: FloatArray


@dataclass(frozen=True)
class BiasTest:
    """Welch tests, one per entry: arrays of one shape, in units of radiance unless stated."""

    difference: FloatArray
    """mean(candidate) - mean(reference)"""
    scale: FloatArray
    """The divisor of a relative bias: the reference's mean, at least DARK times its image mean."""
    errors: tuple[Error, ...]
    """Standard errors by several estimates: a bias is proven only if it is so with each."""
    margin: FloatArray
    """Permitted bias as a fraction of `scale`."""
    half_width: FloatArray
    """Of the confidence interval, at the family's level."""
    detectable: FloatArray
    """The smallest true bias that such a run proves to exceed the margin, with a chance of POWER,
    if the estimated standard error is correct."""
    rare: FloatArray
    """The energy of rare light, of the other side's mean, that may be missing by chance: less than
    this cannot be proven to be missing, however little noise there is."""

    @property
    def standard_error(self) -> FloatArray:
        """The largest of the estimates."""
        return np.asarray(np.max([error.value for error in self.errors], axis=0))

    @property
    def relative(self) -> FloatArray:
        """The bias as a fraction of `scale`."""
        return self.over_scale(self.difference)

    @property
    def strength(self) -> FloatArray:
        """The bias beyond the margin over `half_width`: above 1 where it is proven."""
        return ratio(np.abs(self.difference) - self.margin * self.scale, self.half_width)

    @property
    def differs(self) -> npt.NDArray[np.bool_]:
        """Where the confidence interval lies wholly outside ± margin."""
        return np.abs(self.difference) - self.half_width > self.margin * self.scale

    @functools.cached_property
    def worst(self) -> tuple[int, ...]:
        """Index of the greatest strength; the largest bias among equal ones."""
        strength = self.strength
        greatest = np.where(strength == strength.max(), np.abs(self.difference), -1.0)
        index = np.unravel_index(greatest.argmax(), greatest.shape)
        return tuple(int(i) for i in index)

    def p_value(self, at: tuple[int, ...] | slice = slice(None)) -> FloatArray:
        """p-value of the hypothesis |bias| <= margin, two-sided, not corrected for multiple
        tests."""
        beyond = (np.abs(self.difference) - self.margin * self.scale)[at]
        each = [
            2.0 * special.stdtr(error.dof[at], -ratio(beyond, error.value[at]))
            for error in self.errors
        ]
        return np.asarray(np.minimum(1.0, np.max(each, axis=0)))

    def over_scale(self, values: FloatArray) -> FloatArray:
        """`values` as a fraction of `scale`; infinite if the reference's whole picture is black."""
        return ratio(values, self.scale)

    def within(self, limit: float) -> npt.NDArray[np.bool_]:
        """Where the interval lies wholly inside ± limit (a fraction of `scale`)."""
        return np.abs(self.difference) + self.half_width <= limit * self.scale

    def samples_factor(self, limit: float) -> float:
        """The factor of samples at which the detectable bias falls to `limit`, and each interval
        lies inside ± limit or beyond the margin.

        The latter with a chance of about POWER, if the present differences are the true ones. The
        standard errors of both runs scatter; the factor suffices in about 19 of 20 cases.
        """
        dof = min(float(np.min(error.dof)) for error in self.errors)
        cushion = (1.0 + special.ndtri(0.95) / math.sqrt(dof)) ** 2
        reach = self.detectable - self.margin * self.scale
        inside = limit * self.scale - np.abs(self.difference)
        beyond = np.abs(self.difference) - self.margin * self.scale
        wanted = np.minimum((limit - self.margin) * self.scale, np.maximum(inside, beyond))
        # The reach falls by the square root of the factor, that of rare light by the factor.
        less = self.rare * (wanted - np.where(self.rare > 0.0, reach, wanted))
        factor = ratio(reach**2 + less, wanted**2)
        return float(cushion * factor.max())


UNEQUAL = 4.0
"""Where one side's pictures have this many times the variance of the other's, they have fewer
samples, and their noise is of another law: the mean of more samples is less skewed. Two estimators
of the same samples seldom differ as much."""


def welch_errors(
    noise_a: Noise, noise_b: Noise, a: Side, b: Side, single_pixels: bool = False
) -> tuple[Error, Error]:
    """The standard errors of a difference of means, between replicates and from pixels.

    The side with fewer replicates counts as at least as noisy as the other, for it has seen fewer
    rare paths, unless its mean is the more exact one. A single pixel may have met such paths on one
    side alone, so that there the side with the less exact mean counts as at least as noisy, if the
    pictures of the sides have unequal samples. The noise of unequal samples, and that of a known
    mean, is scaled by the ratio of the median pixel.

    Degrees of freedom are Welch and Satterthwaite's, with the ratio of the variances from pixels,
    which is well known. The ratio of few replicates' own variances is not: at the level of one test
    among many it gave up to 95 times the promised false alarms (measured).
    """
    own_a, own_b, pixels_a, pixels_b = noise_a.own, noise_b.own, noise_a.pixels, noise_b.pixels
    dof_a, dof_b = noise_a.own_dof, noise_b.own_dof
    ratio_of_one = noise_ratio(a, b)
    less_exact_a = a.count < ratio_of_one * b.count
    factor, raises_a, raises_b = 1.0, a.count < b.count, b.count < a.count
    if b.pictures is None:
        factor, raises_a, raises_b = ratio_of_one, True, False
    elif single_pixels and are_unequal(ratio_of_one):
        factor, raises_a, raises_b = ratio_of_one, less_exact_a, not less_exact_a
        dof_a = dof_b = np.minimum(dof_a, dof_b)  # of either side's replicates
    elif not single_pixels:
        raises_b = raises_b and not less_exact_a
    if raises_a:
        own_a, pixels_a = np.maximum(own_a, factor * own_b), np.maximum(pixels_a, factor * pixels_b)
    elif raises_b:
        own_b, pixels_b = np.maximum(own_b, own_a / factor), np.maximum(pixels_b, pixels_a / factor)
    shares = pixels_a / a.count, pixels_b / b.count
    return (
        Error(np.sqrt(own_a / a.count + own_b / b.count), satterthwaite(*shares, dof_a, dof_b)),
        Error(
            np.sqrt(shares[0] + shares[1]),
            satterthwaite(*shares, noise_a.pixels_dof, noise_b.pixels_dof),
        ),
    )


def noise_ratio(a: Side, b: Side) -> float:
    """How many times as noisy (variance) one picture of `a` is as one of `b`, in the median pixel;
    a known mean counts as one picture.  0 if no pixel has noise on both sides."""
    noisy = (a.variance > 0.0) & (b.variance > 0.0)
    if not noisy.any():
        return 0.0
    # The variances are of some replicates; their medians are low by chi-square's.
    low_a, low_b = (
        1.0
        if side.pictures is None
        else float(special.chdtri(side.count - 1, 0.5)) / (side.count - 1)
        for side in (a, b)
    )
    return float(np.median(a.variance[noisy] / b.variance[noisy])) * low_b / low_a


def are_unequal(noise: float) -> bool:
    """Whether pictures whose `noise_ratio` this is have unequal numbers of samples."""
    return noise > UNEQUAL or 0.0 < noise < 1.0 / UNEQUAL


def satterthwaite(
    a: FloatArray, b: FloatArray, dof_a: FloatArray | float, dof_b: FloatArray | float
) -> FloatArray:
    """Degrees of freedom of the sum of two variances; the smaller of both where there is none."""
    total = a + b
    noisy = total > 0.0
    share = np.where(noisy, a, 0.5) / np.where(noisy, total, 1.0)
    least = np.minimum(dof_a, dof_b)
    together = 1.0 / np.maximum(share**2 / dof_a + (1.0 - share) ** 2 / dof_b, 1e-300)
    return np.asarray(np.where(noisy, together, least))


def bias_test(
    difference: FloatArray,
    reference: FloatArray,
    errors: tuple[Error, ...],
    margin: FloatArray | float,
    level: float,
    image_mean: float,
    events: Events | None = None,
) -> BiasTest:
    """Compare entry by entry, at `level` for all entries together (Šidák 1967).

    events: of rare light. They make a third standard error: the largest of the others, with the
    scatter of as much missing light as there is difference.
    """
    scale = divisor(reference, image_mean)
    level_of_one = -math.expm1(math.log1p(-level) / difference.size)
    critical_of, reach_of = quantiles(level_of_one)
    half_width, reach = np.zeros_like(scale), np.zeros_like(scale)
    # Rounding is a bound, not an estimate: it is added without a quantile.
    rounding = ROUNDING * scale
    believed = []
    for error in errors:
        dof = np.clip(error.dof, 1.0, MOST_DOF)
        whole = dof.astype(np.int64)  # rounded down, to the safe side
        half_width = np.maximum(half_width, critical_of[whole] * error.value + rounding)
        reach = np.maximum(reach, reach_of[whole] * error.value + rounding)
        believed.append(Error(np.hypot(error.value, rounding), dof))
    margins = np.broadcast_to(np.asarray(margin, dtype=np.float64), scale.shape)
    rare = np.zeros_like(scale)
    if events is not None:
        largest = np.max([error.value for error in errors], axis=0)
        noisy = largest > rounding  # without any noise there is no light that is seldom met
        missed = np.where(noisy, np.abs(difference) * events.missed_by(difference), 0.0)
        unmet = np.sqrt(largest**2 + missed)
        half_width = np.maximum(half_width, critical_of[MOST_DOF] * unmet + rounding)
        believed.append(Error(np.hypot(unmet, rounding), np.full(scale.shape, float(MOST_DOF))))
        # The reach x of a bias that is the margin and x: x^2 = k^2 (error^2 + event (margin + x)).
        k = float(reach_of[MOST_DOF])
        rare = np.where(noisy, k**2 * events.largest(), 0.0)
        fixed = (k * largest) ** 2 + rare * margins * scale
        reach = np.maximum(reach, 0.5 * rare + np.sqrt((0.5 * rare) ** 2 + fixed) + rounding)
    detectable = margins * scale + reach
    return BiasTest(difference, scale, tuple(believed), margins, half_width, detectable, rare)


@functools.lru_cache(maxsize=64)
def quantiles(level: float) -> tuple[FloatArray, FloatArray]:
    """By whole degrees of freedom: Student's two-sided quantile, and the true bias, in standard
    errors, that exceeds it with a chance of POWER.

    The latter is the quantile of the non-central t after Jennett and Welch (1939): the estimated
    standard error scatters about the true one by 1 / sqrt(2 dof). Within 3 % even for dof = 1.
    """
    dof = np.maximum(np.arange(MOST_DOF + 1.0), 1.0)
    critical = np.asarray(-special.stdtrit(dof, level / 2.0))
    reach = critical + special.ndtri(POWER) * np.sqrt(1.0 + critical**2 / (2.0 * dof))
    return critical, reach
