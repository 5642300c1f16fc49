"""Errors of pictures against a reference that is noisy itself, without that noise.

With x a picture, r the reference and v the variance of r, both independent of x,

    E[(x - r)²] = (E[x] - E[r])² + Var[x] + v,

so that (x - r)² - v̂, with an unbiased v̂, has the expectation of the squared error against what r
estimates."""

import math
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import optimize, stats

from comparisons.experiments.convergence.store import Reference, Rung, weights
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


# ---- lines through logarithms -------------------------------------------------------------------


DRAWS = 1000
"""Resampled curves: the ends of a 95 % band are then known to a tenth of its width."""

LAST = 6
"""The last rungs, at most, from which a curve is extrapolated."""

SEED = 20260101
"""Seed of the resampling: the same measurements give the same bands."""

How = Literal["interpolated", "extrapolated", "below", "bias", "unknown"]
"""The target lies between rungs; beyond the last; the first rung is below it already; it is never
reached because of a bias; there are too few rungs."""


class Line(NamedTuple):
    """log y = intercept + slope log x;  low, high: of the slope, with a confidence of LEVEL."""

    slope: float
    low: float
    high: float
    intercept: float


class Points(NamedTuple):
    """A method's curve, of n rungs: samples, seconds and errors, with the standard errors of
    the logarithms of the latter two and the degrees of freedom that those of the errors have; (n,)
    each but the last.  All errors are positive."""

    spp: FloatArray
    seconds: FloatArray
    errors: FloatArray
    log_seconds_error: FloatArray
    log_errors_error: FloatArray
    freedom: int


def log_line(x: FloatArray, y: FloatArray, log_error: FloatArray, freedom: int) -> Line | None:
    """The line through (log x, log y), each point weighted by its scatter; None for less than two.

    log_error (n,): standard error of log y, estimated with `freedom` degrees of freedom.  A scatter
    from few replicates is itself uncertain, and would give weight where it is small by chance:
    the variances are averaged with their common one as two guesses of like standing.  Where the
    points lie further from the line than their scatter allows, the slope's interval grows by the
    root of chi² per degree of freedom, but never shrinks.
    """
    n = len(x)
    if n < 2:
        return None
    u, v = np.log(x), np.log(y)
    variance = 0.5 * (log_error**2 + (log_error**2).mean())
    if not variance.min() > 0.0:
        variance = np.ones(n)
    weight = 1.0 / variance
    u0 = float((weight * u).sum() / weight.sum())
    spread = float((weight * (u - u0) ** 2).sum())
    slope = float((weight * (u - u0) * v).sum()) / spread
    intercept = float((weight * (v - slope * u)).sum() / weight.sum())
    off = float((weight * (v - intercept - slope * u) ** 2).sum())
    grown = max(1.0, off / (n - 2)) if n > 2 else 1.0
    degrees = n - 2 if grown > 1.0 else n * freedom
    half = float(stats.t.ppf(0.5 + LEVEL / 2.0, degrees)) * math.sqrt(grown / spread)
    return Line(slope, slope - half, slope + half, intercept)


def drawn(points: Points) -> tuple[FloatArray, FloatArray]:
    """DRAWS curves within the scatter: logarithms of seconds and of errors (DRAWS, n), the first
    of each being what was measured."""
    rng = np.random.default_rng(SEED)
    shape = (DRAWS, len(points.spp))
    moved = rng.standard_normal(shape) * points.log_seconds_error
    erred = rng.standard_t(points.freedom, shape) * points.log_errors_error
    moved[0] = erred[0] = 0.0
    return np.log(points.seconds) + moved, np.log(points.errors) + erred


class Reached(NamedTuple):
    """Where a curve falls to an error.

    log_seconds (DRAWS,): of each resampled curve, the measured one first;  how, spp (samples per
    pixel): of the measured one.
    """

    log_seconds: FloatArray
    how: How
    spp: float

    @property
    def seconds(self) -> Estimate:
        return band(np.exp(self.log_seconds))


def time_to(points: Points, error: float, independent: bool = False) -> Reached | None:
    """When the curve has come down to `error`; None where it is too short to tell, or rises, or
    where its times do not.

    Between rungs by a line through the logarithms.  Beyond the last one by what theory has: of
    stratified samples one part of the variance falls as 1 / n, as that of independent ones does
    (`independent`: all of it), and what the strata catch faster, at discontinuities as n^(-3/2)
    (Mitchell 1996, "Consequences of stratified sampling in graphics"); a and c of a / n + c /
    n^(3/2) come from the LAST rungs, neither negative.  A line through the logarithms would go on
    falling as it does at first: in a Cornell box, from 8 to 64 samples, it promised 0.83 of the
    error that 1024 samples had.  Seconds are a start and a share for each sample, from all rungs.
    """
    if len(points.spp) == 0:
        return None
    goal, log_n = math.log(error), np.log(points.spp)
    times, falls = drawn(points)
    draws = np.arange(DRAWS)
    under: npt.NDArray[np.bool_] = np.less_equal(falls, goal)
    inside = np.asarray(under.any(axis=1))
    k = np.where(inside, under.argmax(axis=1), 0)
    before = np.maximum(k - 1, 0)
    drop = falls[draws, k] - falls[draws, before]
    part = np.where(k > 0, (goal - falls[draws, before]) / np.where(drop < 0.0, drop, -1.0), 1.0)
    log_seconds = times[draws, before] + part * (times[draws, k] - times[draws, before])
    log_spp = log_n[before] + part * (log_n[k] - log_n[before])
    if not inside.all():
        if len(log_n) < 2:
            return None
        far = _continued(points, times, falls, goal, independent)
        log_seconds, log_spp = np.where(inside, (log_seconds, log_spp), far)
    if not math.isfinite(log_seconds[0]):
        return None
    how: How = "extrapolated" if not inside[0] else "interpolated" if k[0] > 0 else "below"
    return Reached(log_seconds, how, math.exp(log_spp[0]))


def _continued(
    points: Points, times: FloatArray, falls: FloatArray, goal: float, independent: bool
) -> tuple[FloatArray, FloatArray]:
    """Logarithms of seconds and samples (DRAWS,) at which curves reach `goal` beyond their last
    rung; infinite where the measured one does not fall, or its seconds do not rise: more samples
    would seem to cost nothing."""
    spp = points.spp[-LAST:]
    scatter = np.where(points.log_errors_error > 0.0, points.log_errors_error, 1.0)[-LAST:]
    falling = np.polyfit(np.log(spp), falls[0, -LAST:], 1, w=1.0 / scatter)[0] < 0.0
    start, per_sample = linear_time(points.spp, points.seconds)
    if not (falling and per_sample > 0.0):
        return np.full(DRAWS, np.inf), np.full(DRAWS, np.inf)
    terms = _one_term if independent else _two_terms
    a, c = terms(spp, np.exp(falls[:, -LAST:]), scatter * points.errors[-LAST:])
    # With x = 1 / sqrt(n): a x² + c x³ = error, convex and rising, by Newton's method from above.
    error = math.exp(goal)
    with np.errstate(divide="ignore"):
        x = np.minimum(np.sqrt(error / a), np.cbrt(error / c))
    for _ in range(50):
        x = x - ((a + c * x) * x * x - error) / ((2.0 * a + 3.0 * c * x) * x)
    log_spp = np.maximum(-2.0 * np.log(x), math.log(spp[-1]))
    log_seconds = np.log(start + per_sample * np.exp(log_spp)) + (times[:, -1] - times[0, -1])
    return log_seconds, log_spp


def _two_terms(
    spp: FloatArray, errors: FloatArray, scatter: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(a, c) of error = a / n + c / n^(3/2), neither negative, by least squares: (DRAWS,) each of
    errors (DRAWS, n) at n samples of scatter (n,)."""
    u, v = 1.0 / (spp * scatter), 1.0 / (spp**1.5 * scatter)
    on_u, on_v = errors / scatter @ u, errors / scatter @ v
    uu, uv, vv = u @ u, u @ v, v @ v
    a = (vv * on_u - uv * on_v) / (uu * vv - uv * uv)
    c = (uu * on_v - uv * on_u) / (uu * vv - uv * uv)
    both = (a >= 0.0) & (c >= 0.0)
    return (
        np.where(both, a, np.where(a < 0.0, 0.0, on_u / uu)),
        np.where(both, c, np.where(a < 0.0, on_v / vv, 0.0)),
    )


def _one_term(
    spp: FloatArray, errors: FloatArray, scatter: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The same with c = 0."""
    u = 1.0 / (spp * scatter)
    a = errors / scatter @ u / (u @ u)
    return a, np.zeros_like(a)


def linear_time(spp: FloatArray, seconds: FloatArray) -> tuple[float, float]:
    """(a, b), neither negative, of seconds = a + b spp, with least squares of relative errors."""
    rows = np.column_stack([np.ones_like(spp), spp]) / seconds[:, None]
    (start, per_sample), _ = optimize.nnls(rows, np.ones(len(spp)))
    return float(start), float(per_sample)


def band(values: FloatArray) -> Estimate:
    """The first of drawn values, and the quantiles that hold LEVEL of all."""
    tail = 0.5 - LEVEL / 2.0
    # Quantiles that exist: infinities are not to be interpolated with.
    low, high = np.quantile(values, [tail, 1.0 - tail], method="inverted_cdf")
    return Estimate(float(values[0]), float(low), float(high))
