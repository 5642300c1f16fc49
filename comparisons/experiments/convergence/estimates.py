"""Errors of pictures against a reference that is noisy itself, without that noise.

With x a picture, r the reference and v the variance of r, both independent of x,

    E[(x - r)²] = (E[x] - E[r])² + Var[x] + v,

so that (x - r)² - v̂, with an unbiased v̂, has the expectation of the squared error against what r
estimates.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import stats

from comparisons.experiments.convergence.data import Reference, Rung, weights
from reference_rt.core.arrays import FloatArray

LEVEL = 0.95
"""Confidence of bands."""

BIAS_LEVEL = 0.99
"""Confidence of the upper bound of a bias."""

SEEN_LEVEL = 0.9999
"""Confidence of the lower bound; a bias is significant if that is above 0.  It is high because each
method of each scene is tested."""


class Estimate(NamedTuple):
    """A number, and the band that holds it with a confidence of LEVEL."""

    value: float
    low: float
    high: float


class Bias(NamedTuple):
    """The mean squared bias: the error that remains at any number of samples.

    squared: unbiased estimate, which may be negative;  low, high: one-sided bounds with confidences
    SEEN_LEVEL and BIAS_LEVEL.
    """

    squared: float
    low: float
    high: float

    @property
    def is_seen(self) -> bool:
        return self.low > 0.0


def errors(picture: FloatArray, reference: Reference) -> tuple[float, float]:
    """The mean squared error over pixels and channels and the relative one, without the
    reference's variance; may be negative by chance.

    The weights of the relative error come from the noisy reference too, which changes the result by
    about the error times the reference's own relMSE.
    """
    squared = (picture - reference.mean) ** 2 - reference.variance
    return float(squared.mean()), float((weights(reference.mean) * squared).mean())


def common_error(reference: Reference, weight: FloatArray | float) -> float:
    """The standard error that all errors against a reference share: of the mean of weight times
    (r - E[r])² - v̂.

    For normal r the variance of the first term is 2 v², that of v̂ from n pictures 2 v² / (n - 1).
    The channels of a pixel are taken to err together, pixels apart.
    """
    per_pixel: FloatArray = (weight * reference.variance).mean(axis=-1)
    factor = 2.0 + 2.0 / max(reference.count - 1, 1)
    return math.sqrt(factor * float((per_pixel**2).sum())) / per_pixel.size


def mean_of(values: FloatArray, common: float = 0.0) -> Estimate:
    """The mean of replicates (n,) with Student's interval; `common`: a standard error that all of
    them share."""
    value = float(values.mean())
    if len(values) < 2:
        return Estimate(value, -math.inf, math.inf)
    error = math.hypot(standard_error(values), common)
    half = float(stats.t.ppf(0.5 + LEVEL / 2.0, len(values) - 1)) * error
    return Estimate(value, value - half, value + half)


def standard_error(values: FloatArray) -> float:
    """Of the mean of independent values (n >= 2,)."""
    return float(values.std(ddof=1)) / math.sqrt(len(values))


def bias_of(rung: Rung, reference: Reference, weight: FloatArray | float = 1.0) -> Bias:
    """The mean over pixels and channels of weight times the squared bias.

    The squared difference of the means less the variances of both is the same as the mean of the
    products of what two different replicates differ by from two different reference pictures: no
    noise meets itself, and the expectation is the squared bias.  Its error is that of a mean over
    pixels, which are independent through a box filter; Student's quantile stands for the normal
    one, by the effective number of pixels: a few may hold most of the noise (in a Cornell box of
    1728 pixels, 19).
    """
    noise = rung.variance / rung.replicates + reference.variance
    products = (weight * ((rung.mean - reference.mean) ** 2 - noise)).mean(axis=-1).ravel()
    squared = float(products.mean())
    if rung.replicates < 2 or len(products) < 2:
        return Bias(squared, -math.inf, math.inf)
    freedom = max(1.0, effective_number(products) - 1.0)
    below, above = stats.t.ppf([SEEN_LEVEL, BIAS_LEVEL], freedom) * standard_error(products)
    return Bias(squared, float(squared - below), float(squared + above))


def effective_number(values: FloatArray) -> float:
    """How many values of one size would scatter as these do, (sum x²)² / sum x⁴: a few bright
    pixels may hold most of the noise (Kish's effective sample size, of the squares)."""
    squares = values**2
    total = float((squares**2).sum())
    return float(squares.sum()) ** 2 / total if total > 0.0 else float(len(values))


def against(rung: Rung, reference: Reference) -> Rung:
    """The rung with its errors against another reference of the same scene.

    Their mean is exact, from the mean and the variance of the replicates; the deviations of single
    replicates from it are kept, because a better reference changes them little.
    """
    if rung.reference == reference.checksum:
        return rung
    n = rung.replicates
    squared = (rung.mean - reference.mean) ** 2 + rung.variance * ((n - 1) / n) - reference.variance
    mse, relmse = squared.mean(), (weights(reference.mean) * squared).mean()
    return replace(
        rung,
        mse=rung.mse + (mse - rung.mse.mean()),
        relmse=rung.relmse + (relmse - rung.relmse.mean()),
        reference=reference.checksum,
    )


class Accumulator:
    """Accumulates replicates by Welford's running mean and sum of squares, so that only one picture
    is in memory.  done: replicates from an earlier run."""

    def __init__(self, asked: int, reference: Reference, done: Rung | None = None) -> None:
        self.asked, self.spp = asked, asked
        self._reference = reference
        self._mean = np.zeros_like(reference.mean)
        self._squares = np.zeros_like(reference.mean)
        self._rows: list[tuple[float, float, float]] = []
        if done is not None:
            self.spp = done.spp
            self._mean += done.mean
            self._squares += done.squares
            columns = (done.seconds.tolist(), done.mse.tolist(), done.relmse.tolist())
            self._rows.extend(zip(*columns, strict=True))

    @property
    def count(self) -> int:
        """The number of replicates."""
        return len(self._rows)

    def add(self, picture: FloatArray, spp: int, seconds: float) -> None:
        self.spp = spp
        self._rows.append((seconds, *errors(picture, self._reference)))
        step = picture - self._mean
        self._mean += step / len(self._rows)
        self._squares += step * (picture - self._mean)

    def rung(self) -> Rung:
        """The rung of the replicates added so far, at least one."""
        seconds, mse, relmse = np.array(self._rows).T
        mean, squares = self._mean.copy(), self._squares.copy()
        known = self._reference.checksum
        return Rung(self.asked, self.spp, seconds, mse, relmse, mean, squares, known)
