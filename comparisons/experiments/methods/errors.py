"""How wrong a method is, against exact arithmetic."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

from comparisons.experiments.methods.setting import Family, FloatArray, Series, Trial, Truth
from comparisons.geometry.exact.dyadic import FRACTION, NEVER, BoolArray, Fixed

U = 2.0**-53
"""Unit roundoff: half a unit in the last place of 1."""

PIXEL = 1e-3
"""A hit is misplaced if it is off by more than this share of the shape's size: a pixel, where the
shape fills a picture 1000 pixels wide."""

NEIGHBOURS = 4
"""Units in the last place by which each component of a ray is perturbed, at most, to see whether
that changes the exact answer: the methods round each component about four times."""

MOVES = 32
"""Perturbed rays per ray: where one in seven of them changes the answer, all of them fail to show
it once in 100 times."""

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Errors:
    """Counts over `checked` rays, without those that go exactly through an edge (`touching`).

    hits: exact hits;  lost: hits reported as misses;  false: misses reported as hits;  misplaced:
    hits off by more than PIXEL of the size;  ties: of these three, rays whose exact answer changes
    if they are perturbed by a few units in the last place (`NEIGHBOURS`);  median, p99, worst:
    |t - exact| where both are hits, in u (|t| + size / |d|), or u |t| in a relative series; None
    without such rays.
    """

    checked: int
    touching: int
    hits: int
    lost: int
    false: int
    misplaced: int
    ties: int
    median: float | None
    p99: float | None
    worst: float | None

    @property
    def decided(self) -> int:
        return self.checked - self.touching

    @property
    def wrong(self) -> int:
        return self.lost + self.false + self.misplaced

    @property
    def share(self) -> float:
        """The fraction of wrong answers."""
        return self.wrong / self.decided if self.decided else 0.0

    @property
    def share_interval(self) -> tuple[float, float]:
        return share_interval(self.wrong, self.decided)


def share_interval(k: int, n: int) -> tuple[float, float]:
    """The 95 % confidence interval of a proportion, k of n seen (Clopper and Pearson)."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = float(stats.beta.ppf(tail, k, n - k + 1)) if k else 0.0
    high = float(stats.beta.ppf(1.0 - tail, k + 1, n - k)) if k < n else 1.0
    return low, high


def truth(family: Family, trial: Trial, o: FloatArray, d: FloatArray) -> Truth:
    """The exact first hit over all parts."""
    found = [family.exact(part, o, d) for part in trial.ideal or trial.parts]
    t = np.min([np.asarray(f.t) for f in found], axis=0)
    touching = np.any([f.touching for f in found], axis=0)
    if len(found) > 1:
        # A ray exactly through an edge that two parts share hits both at the same t: it is a hit.
        touching = touching & (t == NEVER)
    return Truth(np.asarray(t, dtype=object), np.asarray(touching))


@dataclass(frozen=True)
class Checked:
    """Rays of one trial with their exact answers."""

    family: Family
    trial: Trial
    o: FloatArray
    d: FloatArray
    truth: Truth
    relative: bool

    @classmethod
    def of(cls, family: Family, series: Series, trial: Trial, rays: int) -> "Checked":
        o, d = trial.o[:rays], trial.d[:rays]
        return cls(family, trial, o, d, truth(family, trial, o, d), series.relative)

    @property
    def length(self) -> FloatArray:
        return np.asarray(self.trial.size / np.linalg.norm(self.d, axis=1))

    def judge(self, t: FloatArray) -> "Judged":
        """Compare a method's answers t (n,), inf for a miss, with the exact ones."""
        there, found = self.truth.t != NEVER, np.isfinite(t)
        sure = ~self.truth.touching
        both = there & found
        off = np.zeros(len(t))
        off[both] = _distance(t[both], self.truth.t[both])
        scale = np.array([float_of(x) for x in np.where(there, self.truth.t, 0)])
        scale += 0.0 if self.relative else self.length
        misplaced = both & (off > PIXEL * self.length)
        return Judged(
            sure & there & ~found,
            sure & ~there & found,
            sure & misplaced,
            off[both & sure] / (U * scale[both & sure]),
        )

    def ties(self, rays: BoolArray, rng: np.random.Generator) -> BoolArray:
        """Which of these rays (n,) are ties: their exact answer changes if they are perturbed."""
        which = np.flatnonzero(rays)
        fence = np.zeros(len(rays), bool)
        if len(which) == 0:
            return fence
        o, d = (np.repeat(x[which], MOVES, axis=0) for x in (self.o, self.d))
        moved = truth(self.family, self.trial, _moved(rng, o), _moved(rng, d))
        there = np.repeat(self.truth.t[which], MOVES)
        length = np.repeat(self.length[which], MOVES)
        differs = (moved.t == NEVER) != (there == NEVER)
        both = ~differs & (there != NEVER)
        apart = np.abs(np.where(both, moved.t - there, 0))
        differs |= np.array([float_of(x) for x in apart]) > PIXEL * length
        fence[which] = differs.reshape(-1, MOVES).any(axis=1)
        return fence


@dataclass(frozen=True)
class Judged:
    """lost, false, misplaced (n,): see `Errors`;  units: errors where both are hits."""

    lost: BoolArray
    false: BoolArray
    misplaced: BoolArray
    units: FloatArray

    @property
    def wrong(self) -> BoolArray:
        return self.lost | self.false | self.misplaced


def measure(
    checked: list[Checked], answer: Callable[[Trial, int], FloatArray], seed: int
) -> Errors:
    """Errors of a method; `answer(trial, n)` returns its t for the first n rays of a trial."""
    rng = np.random.default_rng(seed)
    judged = [part.judge(answer(part.trial, len(part.o))) for part in checked]
    ties = sum(
        int(part.ties(found.wrong, rng).sum()) for part, found in zip(checked, judged, strict=True)
    )
    units = np.concatenate([found.units for found in judged])
    quantiles = [float(q) for q in np.quantile(units, (0.5, 0.99, 1.0))] if len(units) else None
    median, p99, worst = quantiles or (None, None, None)
    return Errors(
        checked=sum(len(part.o) for part in checked),
        touching=sum(int(part.truth.touching.sum()) for part in checked),
        hits=sum(int((part.truth.t != NEVER).sum()) for part in checked),
        lost=sum(int(found.lost.sum()) for found in judged),
        false=sum(int(found.false.sum()) for found in judged),
        misplaced=sum(int(found.misplaced.sum()) for found in judged),
        ties=ties,
        median=median,
        p99=p99,
        worst=worst,
    )


def _moved(rng: np.random.Generator, values: FloatArray) -> FloatArray:
    """`values`, each perturbed by a few units in the last place; zeros stay."""
    steps = rng.integers(-NEIGHBOURS, NEIGHBOURS + 1, values.shape)
    return np.asarray(np.where(values == 0.0, values, values + steps * np.spacing(values)))


def float_of(fixed: int) -> float:
    """The nearest float64."""
    return fixed / (1 << FRACTION)


def _distance(t: FloatArray, exact: Fixed) -> FloatArray:
    """|t - exact|, rounded once: the difference itself is exact."""
    one = 1 << FRACTION
    found = []
    for value, fixed in zip(t.tolist(), exact.tolist(), strict=True):
        numerator, denominator = value.as_integer_ratio()
        found.append(abs(numerator * one // denominator - fixed) / one)
    return np.array(found, dtype=np.float64)
