"""Findings from the rungs of a method (curves, slopes, bias, efficiency, times to targets), and all
results of a scene, with pictures at equal time and error."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from comparisons.experiments.convergence.estimates import (
    Bias,
    Estimate,
    How,
    Line,
    Points,
    band,
    bias_of,
    common_error,
    errors,
    linear_time,
    log_line,
    mean_of,
    standard_error,
    time_to,
)
from comparisons.experiments.convergence.methods import Method, Renderer
from comparisons.experiments.convergence.store import Reference, Rung, Store, weights
from reference_rt.core.arrays import FloatArray

MEDIAN_ERROR = math.sqrt(math.pi / 2.0)
"""Standard error of a median over that of a mean, for normal scatter and many values."""


class Step(NamedTuple):
    """A rung in numbers.

    seconds: the median of the warm pictures' and their extremes, NaN where they are `disturbed`;
    mse, relmse: expectations, with
    bands;  variance: the mean over pixels of the weighted variance of one picture, which relmse is
    where there is no bias;  efficiency: 1 / (variance times seconds), 1/s.
    """

    asked: int
    spp: int
    replicates: int
    seconds: Estimate
    mse: Estimate
    relmse: Estimate
    variance: float
    efficiency: float
    disturbed: bool = False


class Target(NamedTuple):
    """The time to the relative error `error`.

    how: see `How`; for "below", seconds are those of the first rung;  drawn: seconds of resampled
    curves, the measured one first.
    """

    error: float
    how: How
    seconds: Estimate
    spp: float
    drawn: FloatArray


class Ratio(NamedTuple):
    """The ratio of two times to the same target, and how reliable it is.

    times: the ratio with its band, None if unknown;  extrapolated: whether a time lies beyond the
    last measured rung;  bound: "at most" if only the numerator's first rung is below the target, so
    that its time is an upper bound, "at least" if only the denominator's is, "neither" if both are;
    why: it is unknown, else "".
    """

    times: Estimate | None
    extrapolated: bool = False
    bound: Literal["", "at most", "at least", "neither"] = ""
    why: str = ""

    @property
    def shown(self) -> Literal["", "less", "more"]:
        """ "less" or "more" if the measured band lies below or above 1; "" if it contains 1 or is
        extrapolated."""
        if self.times is None or self.extrapolated or self.bound == "neither":
            return ""
        if self.times.high < 1.0 and self.bound != "at least":
            return "less"
        return "more" if self.times.low > 1.0 and self.bound != "at most" else ""


@dataclass(frozen=True)
class Findings:
    """The findings about a method.

    slopes: of "mse" and "relmse" over "spp" and "seconds", None with too few rungs;  bias,
    relative_bias: from the last rung, the latter weighted as relMSE.
    """

    steps: tuple[Step, ...]
    slopes: Mapping[str, Mapping[str, Line | None]]
    bias: Bias
    relative_bias: Bias
    targets: tuple[Target, ...]


def findings_of(
    rungs: Sequence[Rung], reference: Reference, targets: Sequence[float], independent: bool
) -> Findings:
    """The findings from at least one rung;  independent: whether the method's samples are."""
    weight = weights(reference.mean)
    wrong = disturbed([r.warm.min() for r in rungs], [float(np.median(r.warm)) for r in rungs])
    steps = tuple(
        _step(rung, reference, weight, is_wrong)
        for rung, is_wrong in zip(rungs, wrong, strict=True)
    )
    common = {"mse": common_error(reference, 1.0), "relmse": common_error(reference, weight)}
    steady = [rung for rung, is_wrong in zip(rungs, wrong, strict=True) if not is_wrong]
    points = {name: points_of(steady, name, error) for name, error in common.items()}
    slopes = {}
    for name, error in common.items():
        of_all, timed = points_of(rungs, name, error), points[name]
        slopes[name] = {
            "spp": _slope(of_all, of_all.spp),
            "seconds": _slope(timed, timed.seconds),
        }
    relative_bias = bias_of(rungs[-1], reference, weight)
    return Findings(
        steps,
        slopes,
        bias_of(rungs[-1], reference),
        relative_bias,
        tuple(_target(points["relmse"], error, relative_bias, independent) for error in targets),
    )


def disturbed(least: Sequence[float], medians: Sequence[float]) -> list[bool]:
    """Which rungs, in the order of their samples, were timed while something else ran: even the
    fastest picture took longer than half of those of a later rung, which have more samples."""
    return [any(later < low for later in medians[k + 1 :]) for k, low in enumerate(least)]


def _step(rung: Rung, reference: Reference, weight: FloatArray, is_disturbed: bool) -> Step:
    warm = rung.warm if not is_disturbed else np.array([math.nan])
    seconds = Estimate(float(np.median(warm)), float(warm.min()), float(warm.max()))
    variance = float((weight * rung.variance).mean())
    return Step(
        rung.asked,
        rung.spp,
        rung.replicates,
        seconds,
        mean_of(rung.mse, common_error(reference, 1.0)),
        mean_of(rung.relmse, common_error(reference, weight)),
        variance,
        1.0 / (variance * seconds.value) if variance > 0.0 else math.inf,
        is_disturbed,
    )


def points_of(rungs: Sequence[Rung], name: str, common: float = 0.0) -> Points:
    """The curve of "mse" or "relmse" over the rungs where it is positive;  common: the standard
    error that all rungs share."""
    used = [r for r in rungs if r.replicates > 1 and getattr(r, name).mean() > 0.0]
    rows = [(r.spp, np.median(r.warm), getattr(r, name).mean()) for r in used]
    spp, seconds, errors = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    scatter = [
        (
            MEDIAN_ERROR * standard_error(np.log(r.warm)) if len(r.warm) > 1 else 0.0,
            math.hypot(standard_error(getattr(r, name)), common) / getattr(r, name).mean(),
        )
        for r in used
    ]
    of_seconds, of_errors = np.array(scatter, dtype=np.float64).reshape(-1, 2).T
    freedom = min((r.replicates - 1 for r in used), default=1)
    return Points(spp, seconds, errors, of_seconds, of_errors, freedom)


def _slope(points: Points, over: FloatArray) -> Line | None:
    return log_line(over, points.errors, points.log_errors_error, points.freedom)


def _target(points: Points, error: float, bias: Bias, independent: bool) -> Target:
    never = Estimate(math.inf, math.inf, math.inf)
    reached = time_to(points, error**2, independent)
    if bias.low > error**2 and (reached is None or reached.how == "extrapolated"):
        return Target(error, "bias", never, math.inf, np.array([math.inf]))
    if reached is None:
        unknown = Estimate(math.nan, math.nan, math.nan)
        return Target(error, "unknown", unknown, math.nan, np.array([math.nan]))
    drawn = np.exp(reached.log_seconds)
    return Target(error, reached.how, reached.seconds, reached.spp, drawn)


def ratio(mine: Target, theirs: Target) -> Estimate | None:
    """The ratio mine / theirs of the times to a target, with its band; None if one is unknown or
    both are infinite."""
    if len(mine.drawn) != len(theirs.drawn):
        if "unknown" in (mine.how, theirs.how):
            return None
        never = math.inf if mine.how == "bias" else 0.0
        return Estimate(never, never, never)
    if not (math.isfinite(mine.seconds.value) and math.isfinite(theirs.seconds.value)):
        return None
    with np.errstate(invalid="ignore"):
        # Shuffle the draws of one: both were made with the same random numbers.
        order = np.random.default_rng(len(mine.drawn)).permutation(len(mine.drawn) - 1) + 1
        drawn = mine.drawn / theirs.drawn[np.concatenate([[0], order])]
    return band(drawn[np.isfinite(drawn)])


def compared(mine: Target, theirs: Target) -> Ratio:
    """The ratio mine / theirs of the times to a target, with its reliability."""
    first = mine.how == "below", theirs.how == "below"
    unknown = [who for who, t in (("ours", mine), ("theirs", theirs)) if t.how == "unknown"]
    times = ratio(mine, theirs)
    why = f"{' and '.join(unknown)}: too few rungs, or the error does not fall" if unknown else ""
    if not why and times is None:
        why = "neither reaches it"
    return Ratio(
        times,
        "extrapolated" in (mine.how, theirs.how),
        "neither" if all(first) else "at most" if first[0] else "at least" if first[1] else "",
        why,
    )


# ---- pictures at equal time and at equal error --------------------------------------------------


SIDE = 4
"""A crop is this fraction of the picture's width and height."""

REPLICATE = 1 << 19
"""Replicate number of the pictures shown, unused by the ladder and by trials."""

Kind = Literal["time", "error"]


@dataclass(frozen=True)
class Shown:
    """A picture (height, width, 3), its samples per pixel, seconds and relative error."""

    picture: FloatArray
    spp: int
    seconds: float
    error: float


@dataclass(frozen=True)
class Crops:
    """Pictures by all methods, by name, at about the same time or error.

    level: the intended seconds or relative error;  corner, size: left and upper edge, width and
    height of the crop, where the errors are largest.
    """

    kind: Kind
    level: float
    shown: Mapping[str, Shown]
    corner: tuple[int, int]
    size: tuple[int, int]


def crops_of(
    rungs: Mapping[str, list[Rung]],
    renderers: Mapping[str, Callable[[], Renderer]],
    reference: Reference,
    store: Store,
) -> tuple[Crops, ...]:
    """Crops at the longest time that all methods have rungs for, and at the least error that all
    reach."""
    if not rungs:
        return ()
    corner, size = worst_part(rungs, reference)
    levels: dict[Kind, tuple[float, dict[str, int]]] = {
        "time": _at_equal_time(rungs),
        "error": _at_equal_error(rungs),
    }
    found = []
    for kind, (level, samples) in levels.items():
        shown = {
            name: _shown(f"{kind}-{name}", spp, renderers[name], reference, store)
            for name, spp in samples.items()
        }
        if shown:
            found.append(Crops(kind, level, shown, corner, size))
    return tuple(found)


def _at_equal_time(rungs: Mapping[str, list[Rung]]) -> tuple[float, dict[str, int]]:
    level = min(float(np.median(climbed[-1].warm)) for climbed in rungs.values())
    samples = {}
    for name, climbed in rungs.items():
        spp = np.array([rung.spp for rung in climbed], dtype=np.float64)
        seconds = np.array([np.median(rung.warm) for rung in climbed])
        start, per_sample = linear_time(spp, seconds)
        most = (level - start) / per_sample if per_sample > 0.0 else spp[-1]
        samples[name] = max(1, round(min(most, spp[-1])))
    return level, samples


def _at_equal_error(rungs: Mapping[str, list[Rung]]) -> tuple[float, dict[str, int]]:
    squared = max(float(climbed[-1].relmse.mean()) for climbed in rungs.values())
    if not squared > 0.0:
        return 0.0, {}
    samples = {}
    for name, climbed in rungs.items():
        reached = time_to(points_of(climbed, "relmse"), squared)
        if reached is not None:
            samples[name] = max(1, round(min(reached.spp, climbed[-1].spp)))
    return math.sqrt(squared), samples


def _shown(
    name: str, spp: int, renderer: Callable[[], Renderer], reference: Reference, store: Store
) -> Shown:
    """The stored picture, or a new one, rendered twice because the first render may compile."""
    fact, picture = store.fact(name, spp), store.picture(name)
    if fact is None or picture is None:
        render = renderer()
        render(spp, REPLICATE + 1)
        shot = render(spp, REPLICATE)
        picture, fact = shot.picture, [shot.spp, shot.seconds]
        store.keep_picture(name, picture)
        store.keep_fact(name, fact, spp)
    picture = np.asarray(picture, np.float64)
    relmse = errors(picture, reference)[1]
    return Shown(picture, int(fact[0]), float(fact[1]), math.sqrt(max(relmse, 0.0)))


def worst_part(
    rungs: Mapping[str, list[Rung]], reference: Reference
) -> tuple[tuple[int, int], tuple[int, int]]:
    """Left and upper edge, width and height of the crop in which the relative variance of the last
    rungs is largest, summed over methods, each normalised by its mean."""
    weight = weights(reference.mean)
    height, width = reference.mean.shape[:2]
    total = np.zeros((height, width))
    for climbed in rungs.values():
        noise = (weight * climbed[-1].variance).mean(axis=-1)
        total += noise / (noise.mean() or 1.0)
    size = max(1, width // SIDE), max(1, height // SIDE)
    sums = np.pad(total, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    w, h = size
    boxes = sums[h:, w:] - sums[:-h, w:] - sums[h:, :-w] + sums[:-h, :-w]
    y, x = divmod(int(boxes.argmax()), boxes.shape[1])
    return (x, y), size


# ---- a scene's curves ---------------------------------------------------------------------------


class GridStep(NamedTuple):
    """Our picture of a deterministic scene on a grid of spp samples per pixel: its seconds, NaN
    where they are `disturbed`, and its errors against the finest grid."""

    spp: int
    seconds: float
    mse: float
    relmse: float


class GridPoint(NamedTuple):
    """Mitsuba's picture of a deterministic scene: its seconds, and its errors against ours on the
    same grid."""

    variant: str
    spp: int
    seconds: float
    mse: float
    relmse: float


@dataclass(frozen=True)
class Grids:
    """A deterministic scene: our pictures on finer and finer grids, and Mitsuba's picture.

    finest: samples per pixel of the grid that is the reference;  picture: on that grid.
    """

    steps: tuple[GridStep, ...]
    points: tuple[GridPoint, ...]
    finest: int
    picture: FloatArray


@dataclass(frozen=True)
class Curves:
    """Error against time of one scene.

    scene: its name;  size: width and height in pixels;  methods, findings: by name;  absent: why
    other methods have no findings, by name;  grids: for a deterministic scene, which has no
    reference and no findings;  crops: pictures at equal time and
    at equal error;  left_out: what else was not measured, and why;  notes: for the reader;  again:
    the command that repeats the scene;  problem: why there are no results: the scene is invalid, or
    the run was interrupted before it.
    """

    scene: str
    size: tuple[int, int] = (0, 0)
    methods: Mapping[str, Method] = field(default_factory=dict)
    findings: Mapping[str, Findings] = field(default_factory=dict)
    reference: Reference | None = None
    grids: Grids | None = None
    crops: tuple[Crops, ...] = ()
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    again: str = ""
    problem: str = ""
    absent: Mapping[str, str] = field(default_factory=dict)

    @property
    def missing(self) -> list[str]:
        """A line for each method without findings: its title, and why."""
        return [f"{self.methods[name].title}: {why}" for name, why in self.absent.items()]

    def ratios(self, name: str = "ours") -> dict[str, list[Ratio]]:
        """Times to the targets of method `name` over those of each other method, with bands."""
        if name not in self.findings:
            return {}
        mine = self.findings[name].targets
        return {
            other: [compared(a, b) for a, b in zip(mine, found.targets, strict=True)]
            for other, found in self.findings.items()
            if other != name
        }
