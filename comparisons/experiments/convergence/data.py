"""Settings of a run, its reference, and its rungs."""

import zlib
from dataclasses import dataclass

import numpy as np

from comparisons.statistics.metrics import RELMSE_EPSILON
from reference_rt.cameras.film import Film
from reference_rt.core.arrays import FloatArray

FIRST = 4
"""Samples per pixel of the first rung; each rung has twice those of the one before."""

WIDEST = 128
"""Default limit of the width in pixels: errors are means over pixels, so that small pictures show
the same slopes, and twice the width takes four times as long."""


@dataclass(frozen=True)
class Settings:
    """The settings of a run.

    time_limit: seconds for the ladder and the reference of one scene, shared equally by the methods
    and the reference; process starts, compilation and trials (of costs, of Mitsuba's samplers) come
    in addition;  size: width and height, None: the scene's, at most WIDEST wide;  max_spp: largest
    number of samples per pixel;  replicates: independent pictures at each rung;  targets: relative
    errors to which the time is determined;  only: names of methods, empty: all;  starts: whether to
    time process start-up with empty and with full kernel caches;  crops: whether to render pictures
    to show.
    """

    time_limit: float = 60.0
    size: tuple[int, int] | None = None
    max_spp: int = 4096
    replicates: int = 8
    targets: tuple[float, ...] = (0.1, 0.03, 0.01, 0.003)
    only: tuple[str, ...] = ()
    starts: bool = True
    crops: bool = True


def size_within(film: Film, widest: int) -> tuple[int, int]:
    """Width and height of a film, scaled down to the width `widest` if it is wider."""
    if film.width <= widest:
        return film.width, film.height
    return widest, max(1, round(film.height * widest / film.width))


def weights(reference: FloatArray) -> FloatArray:
    """Weights (height, width, 3) that make squared errors relative: 1 / (r² + epsilon m²), with m
    the reference's mean, as in `comparisons.statistics.metrics`."""
    scale = reference**2 + RELMSE_EPSILON * reference.mean() ** 2
    return np.asarray(1.0 / np.where(scale > 0.0, scale, 1.0))


@dataclass(frozen=True)
class Reference:
    """The reference of errors: our own pictures, with seeds that no method uses.

    mean (height, width, 3): of independent pictures;  variance (height, width, 3): of that mean,
    estimated from their scatter;  count: number of pictures;  spp: samples per pixel of each;
    seconds: to render it, 0 if it came from the cache.
    """

    mean: FloatArray
    variance: FloatArray
    count: int
    spp: int
    seconds: float = 0.0

    @property
    def checksum(self) -> int:
        """Of its pictures: another reference of the same scene has another one."""
        return zlib.crc32(self.mean.tobytes())

    @property
    def relmse(self) -> float:
        """The relMSE of its own noise."""
        return float((weights(self.mean) * self.variance).mean())


@dataclass(frozen=True)
class Rung:
    """The replicates of a method at one number of samples.

    asked, spp: requested and actual samples per pixel;  seconds (replicates,): wall clock;  mse,
    relmse (replicates,): see `estimates.errors`;  mean, squares (height, width, 3): over the
    replicates, the mean and the sum of squared deviations from it;  reference: checksum of the
    reference of the errors.
    """

    asked: int
    spp: int
    seconds: FloatArray
    mse: FloatArray
    relmse: FloatArray
    mean: FloatArray
    squares: FloatArray
    reference: int = 0

    @property
    def replicates(self) -> int:
        return len(self.seconds)

    @property
    def variance(self) -> FloatArray:
        """That of one replicate (height, width, 3)."""
        return self.squares / max(self.replicates - 1, 1)

    @property
    def warm(self) -> FloatArray:
        """The seconds of all but the first picture, which may compile: the kernels of Mitsuba's
        stratified samplers have the number of samples as a constant."""
        return self.seconds[1:] if len(self.seconds) > 1 else self.seconds
