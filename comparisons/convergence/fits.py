"""Straight lines through logarithms, and the time at which a curve reaches an error."""

import math
from typing import Literal, NamedTuple

import numpy as np
from scipy import optimize, stats

from comparisons.convergence.estimates import LEVEL, Estimate
from reference_rt.shapes.shape import FloatArray

DRAWS = 1000
"""Of a curve within its scatter: the ends of a 95 % band are then known to a tenth of its width."""

LAST = 4
"""Rungs that a curve is continued by: the first ones may fall otherwise (stratified samples need
some number to tell), fewer say little about a slope."""

SEED = 20260101
"""Of the draws: the same measurements give the same bands."""

How = Literal["interpolated", "extrapolated", "below", "bias"]
"""Between rungs; beyond the last; reached by the first rung already; never, for a bias."""


class Line(NamedTuple):
    """log y = intercept + slope log x;  low, high: of the slope, with a confidence of LEVEL."""

    slope: float
    low: float
    high: float
    intercept: float


class Points(NamedTuple):
    """A contestant's curve, of n rungs: samples, seconds and errors, with the standard errors of
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
    """When a curve has come down to an error.

    log_seconds (DRAWS,): for each drawn curve, the measured one first;  how: for that one;  spp:
    samples a pixel there.
    """

    log_seconds: FloatArray
    how: How
    spp: float

    @property
    def seconds(self) -> Estimate:
        return band(np.exp(self.log_seconds))


def time_to(points: Points, error: float) -> Reached | None:
    """When the curve has come down to `error`; None where it is too short to tell, or rises.

    Between rungs by a line through the logarithms; beyond the last by the line through the LAST
    ones over samples, and seconds that grow in proportion to samples from a fixed start.
    """
    log_n = np.log(points.spp)
    times, falls = drawn(points)
    goal = math.log(error)
    found = [_crossing(log_n, t, e, goal) for t, e in zip(times, falls, strict=True)]
    last, measured_n = slice(-LAST, None), found[0]
    how: How = "interpolated"
    if goal >= falls[0, 0]:
        how, measured_n = "below", (times[0, 0], log_n[0])
    elif measured_n is None:
        how = "extrapolated"
    if how == "extrapolated" and len(log_n) < 2:
        return None
    start, per_sample = linear_time(points.spp, points.seconds)

    def beyond(t: FloatArray, e: FloatArray) -> tuple[float, float] | None:
        slope, height = np.polyfit(log_n[last], e[last], 1, w=1.0 / _positive(points)[last])
        if slope >= 0.0:
            return None
        n = max((goal - height) / slope, log_n[-1])
        if n > 60.0:  # e^60 samples: the curve does not fall
            return None
        later = math.log(start + per_sample * math.exp(n))
        return later + float(t[-1]) - math.log(start + per_sample * points.spp[-1]), n

    log_seconds = np.full(DRAWS, math.inf)
    for k, crossing in enumerate(found):
        if falls[k, 0] <= goal:
            log_seconds[k] = times[k, 0]
        else:
            at = crossing or (beyond(times[k], falls[k]) if len(log_n) > 1 else None)
            log_seconds[k] = at[0] if at else math.inf
    if how == "extrapolated":
        measured_n = beyond(times[0], falls[0])
    if measured_n is None:
        return None
    return Reached(log_seconds, how, math.exp(measured_n[1]))


def _positive(points: Points) -> FloatArray:
    """Standard errors to weight by; all alike where nothing scatters."""
    return np.where(points.log_errors_error > 0.0, points.log_errors_error, 1.0)


def _crossing(
    log_n: FloatArray, log_t: FloatArray, log_e: FloatArray, goal: float
) -> tuple[float, float] | None:
    """Logarithms of the time and the samples where the curve first comes down to `goal`."""
    for k in range(1, len(log_n)):
        if log_e[k] <= goal < log_e[k - 1]:
            part = (goal - log_e[k - 1]) / (log_e[k] - log_e[k - 1])
            return (
                float(log_t[k - 1] + part * (log_t[k] - log_t[k - 1])),
                float(log_n[k - 1] + part * (log_n[k] - log_n[k - 1])),
            )
    return None


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


__all__ = [
    "DRAWS",
    "How",
    "Line",
    "Points",
    "Reached",
    "band",
    "drawn",
    "linear_time",
    "log_line",
    "time_to",
]
