"""The noise of two renderers: whether both use the same random numbers, and whether the pixels of
one share them."""

import math
from dataclasses import dataclass

import numpy as np

from comparisons.results.case import FloatArray
from comparisons.statistics.sides import neighbourhood, side_of
from comparisons.statistics.welch import noise_ratio

FEWEST = 4
"""Least number of replicates of a side: fewer have too few pairs that do not belong together."""

LEAST = 0.1
"""Least correlation that matters: the variance of a difference is then a tenth smaller."""

CLEARLY = 8.0
"""Standard errors, from the pairs that do not belong together."""

ALIKE = 0.2
"""Difference of the correlation of pixels between two sides that is told: a side that rounds, or
that stratifies its samples over pixels, is not so far from 0."""


@dataclass(frozen=True)
class Streams:
    """correlation: of the residuals of replicate k of both sides, about their means;  error: its
    standard error;  shared: whether they clearly belong together."""

    correlation: float
    error: float
    shared: bool

    @property
    def words(self) -> str:
        """For the reader."""
        found = f"{self.correlation:.3f} ± {self.error:.2g}"
        if self.shared:
            return (
                "paired: replicate k has the same random numbers on both sides (the residuals have "
                f"a correlation of {found}), so that the noise is that of their differences"
            )
        return (
            "not paired: the sides have different random numbers (the residuals have a "
            f"correlation of {found})"
        )


def streams_of(a: FloatArray, b: FloatArray) -> Streams:
    """Of replicates (R, height, width, 3) each.  Replicates i of one side and j of the other, i !=
    j, do not belong together: their correlations show what there is by chance, also where all
    pixels share a few random numbers."""
    count = min(len(a), len(b))
    if count < FEWEST:
        return Streams(0.0, 1.0, False)
    # Of the neighbourhood: a pixel's own variance is high where its residuals are.
    scale = np.sqrt(neighbourhood(a.var(axis=0) + b.var(axis=0)))
    weight = np.where(scale > 0.0, 1.0 / np.where(scale > 0.0, scale, 1.0), 0.0)
    one, two = (((x[:count] - x.mean(axis=0)) * weight).reshape(count, -1) for x in (a, b))
    lengths = np.outer(np.linalg.norm(one, axis=1), np.linalg.norm(two, axis=1))
    products = one @ two.T / np.maximum(lengths, 1e-300)
    others = products[~np.eye(count, dtype=bool)]
    # About their own means, those of i != j have a share -1 / (R - 1) of that of pairs.
    correlation = float(np.diag(products).mean() - others.mean()) * (count - 1) / count
    error = max(float(others.std()) / math.sqrt(count), 1.0 / math.sqrt(one.size))
    return Streams(correlation, error, abs(correlation) > max(LEAST, CLEARLY * error))


def of_pixels(pictures: FloatArray) -> tuple[float, tuple[int, int]]:
    """The largest correlation of the residuals of two pixels at any distance, and that distance, to
    the right and down, of replicates (R, height, width, 3); (0, (0, 0)) without noise."""
    residuals = pictures - pictures.mean(axis=0)
    scale = residuals.std(axis=0)
    z = np.where(scale > 0.0, residuals / np.where(scale > 0.0, scale, 1.0), 0.0)
    height, width = z.shape[1:3]
    padded = np.fft.rfft2(z, s=(2 * height, 2 * width), axes=(1, 2))
    power = np.fft.irfft2((np.abs(padded) ** 2).sum(axis=(0, 3)), s=(2 * height, 2 * width))
    lit = np.fft.rfft2(scale[..., 0] > 0.0, s=(2 * height, 2 * width))
    pairs = np.fft.irfft2(np.abs(lit) ** 2, s=(2 * height, 2 * width))
    many = pairs >= max(MANY, 0.1 * pairs[0, 0])
    if not power[0, 0] > 0.0 or not many[0, 0]:
        return 0.0, (0, 0)
    found = np.where(many, power / np.maximum(pairs, 1.0), 0.0) / (power[0, 0] / pairs[0, 0])
    found = found[:, : width + 1]
    found[0, 0] = 0.0
    y, x = (int(i) for i in np.unravel_index(int(np.argmax(found)), found.shape))
    return float(found[y, x]), (x, y if y < height else y - 2 * height)


MANY = 256
"""Least number of pairs of pixels at a distance."""


def notes_of(a: FloatArray, b: FloatArray, paired: bool, sides: tuple[str, str]) -> tuple[str, ...]:
    """What differs in the noise, which no mean shows: another number of samples, and pixels that
    share random numbers.  No verdict: samplers may differ where pictures agree."""
    found = []
    (one, here), (two, there) = of_pixels(a), of_pixels(b)
    if abs(one - two) > ALIKE:
        whose, at, other = (sides[0], here, two) if one > two else (sides[1], there, one)
        found.append(
            f"noise: the pixels of {whose} pictures share random numbers: the noise of two that "
            f"are ({at[0]}, {at[1]}) apart has a correlation of {max(one, two):.2f} (the other "
            f"side's: {other:.2f}): a seed that pixels share, a wide filter, or a denoiser"
        )
    ratio = noise_ratio(side_of(a), side_of(b))
    error = math.sqrt(4.0 / (max(min(len(a), len(b)) - 1, 1) * np.prod(a.shape[1:])))
    if ratio > 0.0 and not paired and abs(math.log(ratio)) > max(TOLD, CLEARLY * error):
        found.append(
            f"noise: {sides[0]} pictures have {ratio:.3g} times the variance of {sides[1]}"
        )
    return tuple(found)


TOLD = 0.1
"""Logarithm of the ratio of variances from which it is told."""
