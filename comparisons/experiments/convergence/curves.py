"""A scene's curves: all results of a run for it, as data, with pictures at equal time and error."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from comparisons.experiments.convergence.estimates import errors, linear_time, time_to
from comparisons.experiments.convergence.findings import Findings, Ratio, compared, points_of
from comparisons.experiments.convergence.methods import Method, Renderer
from comparisons.experiments.convergence.store import Reference, Rung, Store, weights
from reference_rt.core.arrays import FloatArray

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


Starts = Mapping[str, Mapping[str, Mapping[str, float]]]
"""Seconds by side, "cold" or "warm", and stage: see `starts`."""


class GridStep(NamedTuple):
    """Our picture of a deterministic scene on a grid of spp samples per pixel: its seconds, and its
    errors against the finest grid."""

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
    reference and no findings;  starts: process start-up times;  crops: pictures at equal time and
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
    starts: Starts = field(default_factory=dict)
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
