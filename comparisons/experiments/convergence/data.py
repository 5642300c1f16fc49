"""What is asked of a run, and what its renderings leave behind."""

from dataclasses import dataclass

import numpy as np

from comparisons.statistics.metrics import RELMSE_EPSILON
from reference_rt.cameras.film import Film
from reference_rt.core.arrays import FloatArray

FIRST = 4
"""Samples a pixel of the first rung; each rung has twice those of the one before."""

WIDEST = 128
"""Pixels across of pictures whose size nobody names: error and its fall are means over pixels, and
twice the width costs four times the time."""


@dataclass(frozen=True)
class Settings:
    """What is asked of a run.

    time_limit: seconds for the ladder and the reference of one scene, shared equally by the
    methods and the reference; starts of processes, compiling and trials (of costs, of Mitsuba's
    samplers) come in addition;  size: width and height, none for the scene's, at most WIDEST pixels
    across;  max_spp: no rung has more samples a pixel;  replicates: independent pictures at each
    rung;  targets: relative errors, the time to which is asked for;  only: names of methods,
    all if none;  starts: whether to time the start of processes, with caches empty and full;
    crops: whether to render pictures to show.
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
    """Width and height of a film, smaller in proportion where it is more than `widest` across."""
    if film.width <= widest:
        return film.width, film.height
    return widest, max(1, round(film.height * widest / film.width))


def weights(reference: FloatArray) -> FloatArray:
    """(height, width, 3): what squared errors are multiplied by to be relative ones: 1 / (r² +
    epsilon m²), with m the reference's mean, as `comparisons.statistics.metrics` has it."""
    scale = reference**2 + RELMSE_EPSILON * reference.mean() ** 2
    return np.asarray(1.0 / np.where(scale > 0.0, scale, 1.0))


@dataclass(frozen=True)
class Reference:
    """What errors are measured against: our own picture, with other seeds than any method's.

    mean (height, width, 3): of independent pictures;  variance (height, width, 3): of that mean,
    estimated from their scatter;  count: of the pictures;  spp: samples a pixel of each;  seconds:
    that it took, 0 where the cache had it.
    """

    mean: FloatArray
    variance: FloatArray
    count: int
    spp: int
    seconds: float = 0.0

    @property
    def relmse(self) -> float:
        """What its own noise is, as relative error squared."""
        return float((weights(self.mean) * self.variance).mean())


@dataclass(frozen=True)
class Rung:
    """The replicates of a method at one number of samples.

    asked, spp: samples a pixel that were asked for and that were taken;  seconds (replicates,): of
    each, by the clock on the wall;  mse, relmse (replicates,): see `estimates.errors`;  mean,
    variance (height, width, 3): of the replicates, the variance being that of one.
    """

    asked: int
    spp: int
    seconds: FloatArray
    mse: FloatArray
    relmse: FloatArray
    mean: FloatArray
    variance: FloatArray

    @property
    def replicates(self) -> int:
        return len(self.seconds)

    @property
    def warm(self) -> FloatArray:
        """The seconds without those of the first picture, which may compile: Mitsuba's stratified
        samplers have the number of samples as a constant in their kernels."""
        return self.seconds[1:] if len(self.seconds) > 1 else self.seconds


__all__ = ["FIRST", "WIDEST", "Reference", "Rung", "Settings", "size_within", "weights"]
