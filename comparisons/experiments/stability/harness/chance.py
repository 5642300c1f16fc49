"""Two-stage tests of means of random numbers: how seldom a right renderer fails by chance.

All that is statistical is in F10, F11, F12 and F14.  A full run asks, of either contestant,

| series | cases | tests of a case |
|---|---|---|
| F10 closed furnace | 8 | 1 |
| F10 open furnace | 432 | 2: no more than all, as much as the integral |
| F11 densities | 135 | 1 |
| F12 light area, radiance, roulette | 52, 26, 24 | 1 |
| F14 half spaces, white layers, unlike colours | 6, 33, 15 | 1 |
| F14 absorption behind glass, phase densities | 14, 18 | 1 |

1,195 tests, each with a false alarm of at most `LEVEL`: by the union bound, a full run of both
contestants has one with a chance of at most 2.4e-5, a quick run with less than 4e-6.

- A picture's mean is suspect where it is `ERRORS` standard errors off, which by chance it is with
  1e-4, the root of `LEVEL`; it fails where `AGAIN` times as many fresh samples are as far off to
  the same side.  Means over 256 pixels and more are near normal; one suspect case in a thousand, as
  heavy tails would have it, is still but 5e-7 of failures.  A fault is seen with 97 % where it is
  6 standard errors of the first samples: 1 % of the value where they know it to 0.17 %.
- Where a weight's variance is infinite its samples do not know how wrong they are: 49 % off was
  less than 3.9 of their standard errors.  A tenth of the value is too much whatever they say; ours
  are known to 1 % and better, a tenth of that.
- Weights between 0 and a known bound are judged by their own variance and that bound, whatever
  their distribution: the empirical Bernstein inequality.
- Histograms are judged by chi-square.

Rectangles' and triangles' solid angles (F12) are integrated by Gauss's rule, without chance.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from scipy import stats

LEVEL = 1e-8
"""The chance that a test without fault fails."""

ERRORS = float(stats.norm.isf(0.5 * math.sqrt(LEVEL)))
"""Standard errors, 3.9, that each of two stages allows, to either side."""

AGAIN = 4
"""Times as many samples the second stage has."""


class Mean(NamedTuple):
    """Of samples, and its standard error."""

    mean: float
    error: float


def off(found: Mean, expected: float, rounding: float) -> float:
    """By how many standard errors, beyond `rounding`, with its sign; NaN for what is not finite."""
    if not math.isfinite(found.mean):
        return math.nan
    beyond = max(0.0, abs(found.mean - expected) - rounding)
    if beyond == 0.0:
        return 0.0
    errors = beyond / found.error if found.error > 0.0 else math.inf
    return math.copysign(errors, found.mean - expected)


def fails(
    sample: Callable[[int], Mean], expected: float, rounding: float, most: float = math.inf
) -> tuple[bool, Mean]:
    """Whether both stages do, and the last one's mean.

    sample: of the stages 0 and 1, independent, the second with `AGAIN` times as many samples;
    rounding: of the mean, absolute;  most: what it may be off by whatever the noise.
    """
    first = sample(0)
    one = _beyond(first, expected, rounding, most)
    if one == 0.0 or math.isnan(one):
        return math.isnan(one), first
    second = sample(1)
    other = _beyond(second, expected, rounding, most)
    return math.isnan(other) or other * one > 0.0, second


def _beyond(found: Mean, expected: float, rounding: float, most: float) -> float:
    """`off` where it is suspect, 0 where not."""
    errors = off(found, expected, rounding)
    near = abs(errors) <= ERRORS and abs(found.mean - expected) <= most
    return 0.0 if near else errors


def bernstein(error: float, most: float, n: int) -> float:
    """How far the mean of n numbers between 0 and `most`, of the standard error `error`, may be
    off, to either side (Maurer and Pontil 2009, "Empirical Bernstein Bounds and Sample Variance
    Penalization", theorem 4)."""
    tail = math.log(4.0 / LEVEL)
    return math.sqrt(2.0 * tail) * error + 7.0 * tail * most / (3.0 * (n - 1))
