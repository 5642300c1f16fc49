"""Pictures against a formula: which regions are off, by how many standard errors.

Regions are the whole picture and 4 x 4 tiles, in three channels, of the pixels that the formula
states.  The residual of a region is the mean of picture minus formula.  It may be as large as the
formula's error and the rounding of the candidate's numbers allow, and beyond that as noise does.

Noise.  With replicates, each pixel's variance is that between them; with a single picture, that of
residuals within a tile.  Where a filter or a sampler ties neighbouring pixels to each other, tiles
vary more, between replicates (of a single picture: its quarters of tiles), than their pixels say:
all variances grow by that factor, which is that of the picture as a whole, at least 1.  (A single
picture shows it only where pixels are tied within a quarter of a tile: filters need replicates.)  A
variance that few pixels make is not well known: degrees of freedom are Satterthwaite's, and at most
those of the factor.

A pixel may have missed what few samples meet, such as a corner of a lamp: no variance shows that.
One that is off by r without variance counts as such: as many events as make r, each of the size s
that noisy pixels show (variance over radiance), have the variance s r.

False alarms.  Each of the tests of a case uses an equal part of LEVEL (Bonferroni), by Student's t.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import stats

from comparisons.truth.case import Expected, FloatArray

LEVEL = 1e-4
"""The chance that a right renderer fails a case: 1.7 % for all of 166."""

TILES = 4
"""Tiles along each side of a picture."""

ROUNDINGS = 256
"""Roundings of the candidate's numbers, of its unit roundoff each, that a pixel may be off: a path
has some tens of operations for each of a few vertices."""

POWER = 0.01
"""The standard error of the whole picture, relatively, from which the noise is too high."""

Verdict = Literal["right", "off", "noisy", "invalid"]


@dataclass(frozen=True)
class Judged:
    """verdict, reason: for the reader;  value, expected: means of the pixels that are stated, of
    the three channels;  errors: standard errors of the worst region, beyond what is allowed;
    threshold: how many are too many;  percent: of the whole picture, of the channel that is most
    off;  power: the whole picture's standard error in percent, of the channel with most;  worst:
    the region."""

    verdict: Verdict
    reason: str
    value: tuple[float, ...] = ()
    expected: tuple[float, ...] = ()
    errors: float = math.nan
    threshold: float = math.nan
    percent: float = math.nan
    power: float = math.nan
    worst: str = ""


def unit_roundoff(pictures: FloatArray) -> float:
    """Of the coarsest format that holds all values: half, single or double precision."""
    with np.errstate(over="ignore"):
        for kind, unit in ((np.float16, 2.0**-11), (np.float32, 2.0**-24)):
            if np.array_equal(pictures.astype(kind).astype(float), pictures):
                return unit
    return 2.0**-53


def rounding(pictures: FloatArray) -> float:
    """Relative error that the candidate's numbers explain.

    What is stored as half has been computed in single precision.
    """
    unit = unit_roundoff(pictures)
    return ROUNDINGS * unit if unit < 2.0**-11 else 2.0**-11 + ROUNDINGS * 2.0**-24


def judge(
    expected: Expected, pictures: Sequence[npt.ArrayLike] | FloatArray, level: float = LEVEL
) -> Judged:
    """The verdict on replicates (replicates, height, width, 3)."""
    given = np.asarray(pictures, float)
    height, width = expected.pixels.shape[:2]
    if given.shape[1:] != expected.pixels.shape:
        size = f"{given.shape[2]} x {given.shape[1]}"
        return Judged("invalid", f"is {size} pixels; expected {width} x {height}")
    if not np.isfinite(given).all():
        return Judged("invalid", f"{int((~np.isfinite(given)).sum())} values are not finite")
    stated = expected.stated
    truth = np.where(stated[..., None], expected.pixels, 0.0)
    residual = np.where(stated[..., None], given - truth, 0.0)
    labels = _labels(height, width, TILES)
    count = _sums(stated.astype(float), labels)
    sums = _sums(residual.mean(axis=0), labels)
    variance, squares, dof = _variances(residual, np.abs(truth), stated, labels)
    scale = _sums(np.abs(truth), labels)
    # The last row is the whole picture.
    count, sums, variance, squares, scale = (
        np.concatenate([a, a.sum(axis=0, keepdims=True)])
        for a in (count[:, None], sums, variance, squares, scale)
    )
    used = count[:, 0] > 0
    count, sums, variance, squares, scale = (
        a[used] for a in (count, sums, variance, squares, scale)
    )
    relative = expected.bound + rounding(given)
    allowed = relative * (scale / count + scale[-1] / count[-1])
    mean, error = sums / count, np.sqrt(variance) / count
    beyond = np.maximum(np.abs(mean) - allowed, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.where(beyond > 0.0, beyond / error, 0.0)
        free = np.where(squares > 0.0, variance**2 / squares, np.inf)
    thresholds = stats.t.isf(level / (2.0 * errors.size), np.clip(free, 1.0, dof))
    at = np.unravel_index(int(np.argmax(errors / thresholds)), errors.shape)
    region, channel = at
    largest, threshold = float(errors[at]), float(thresholds[at])
    whole = np.where(scale[-1] > 0.0, scale[-1] / count[-1], scale[-1].mean() / count[-1])
    off, most = 100.0 * mean[-1] / whole, 100.0 * error[-1] / whole
    truths = (truth.sum(axis=(0, 1)) / count[-1]).tolist()
    names = [f"tile {k // TILES + 1}, {k % TILES + 1}" for k in range(TILES**2)] + ["whole picture"]
    worst = f"{np.array(names)[used][region]}, {('red', 'green', 'blue')[channel]}"
    shown = f"{worst}: {mean[at]:+.3g} of {scale[at] / count[region, 0]:.4g}"
    verdict: Verdict = "right"
    reason = f"within {largest:.2g} standard errors, of {threshold:.2g} that are allowed"
    if largest > threshold:
        many = f"{largest:.3g} standard errors" if math.isfinite(largest) else "without noise"
        verdict, reason = "off", f"{shown}, {many}"
    elif float(most.max()) > 100.0 * POWER:
        verdict = "noisy"
        reason = f"the standard error is {most.max():.2g} %; expected at most {100 * POWER:g} %"
    return Judged(
        verdict, reason, tuple((truths + mean[-1]).tolist()), tuple(truths), largest, threshold,
        float(off[np.argmax(np.abs(off))]), float(most.max()), worst,
    )  # fmt: skip


def _labels(height: int, width: int, parts: int) -> npt.NDArray[np.int64]:
    """(height, width): the number of each pixel's tile."""
    rows = np.arange(height) * parts // height
    columns = np.arange(width) * parts // width
    return np.asarray(rows[:, None] * parts + columns)


def _sums(values: FloatArray, labels: npt.NDArray[np.int64]) -> FloatArray:
    """(tiles, ...): sums over tiles of (height, width, ...)."""
    sums = np.zeros((int(labels.max()) + 1, *values.shape[2:]))
    np.add.at(sums, labels, values)
    return sums


COMMON = 0.9
"""The quantile of the sizes of events that noisy pixels show, for those that none of them show."""


def _variances(
    residual: FloatArray,
    truth: FloatArray,
    stated: npt.NDArray[np.bool_],
    labels: npt.NDArray[np.int64],
) -> tuple[FloatArray, FloatArray, float]:
    """(tiles, 3): variances of the sums of tiles, and the squares of these over their degrees of
    freedom;  the degrees of freedom of their factor."""
    count = _sums(stated.astype(float), labels)
    n = len(residual)
    if n > 1:
        pixels = residual.var(axis=0, ddof=1) / n
        noisy = (pixels > 0.0) & (truth > 0.0)
        size = np.quantile(pixels[noisy] / truth[noisy], COMMON) if noisy.any() else 0.0
        missed = np.where(pixels > 0.0, 0.0, size * np.abs(residual.mean(axis=0)))
        of_pixels, squares = _sums(pixels + missed, labels), _sums(pixels**2, labels) / (n - 1)
        tiles = np.stack([_sums(r, labels) for r in residual])
        of_parts, dof = tiles.var(axis=0, ddof=1) / n, float((count > 0).sum() * (n - 1))
    else:
        mean = _sums(residual[0], labels) / np.maximum(count, 1.0)[:, None]
        rest = np.where(stated[..., None], residual[0] - mean[labels], 0.0)
        squares = _sums(rest**4, labels)
        of_pixels = _sums(rest**2, labels) * (count / np.maximum(count - 1.0, 1.0))[:, None]
        quarters = _labels(len(stated), stated.shape[1], 2 * TILES)
        of_parts = _sums(rest, quarters) ** 2 * 4.0 / 3.0
        many = int((_sums(stated.astype(float), quarters) > 0).sum())
        dof = max(float(many - (count > 0).sum()), 1.0)
    total, parts = float(of_pixels.sum()), float(of_parts.sum())
    factor = max(1.0, parts / total) if total > 0.0 else 1.0
    return of_pixels * factor, squares * factor**2, dof
