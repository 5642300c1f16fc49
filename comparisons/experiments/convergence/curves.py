"""A scene's curves: all results of a run for it, as data."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from comparisons.experiments.convergence.crops import Crops
from comparisons.experiments.convergence.data import Reference
from comparisons.experiments.convergence.findings import Findings, Ratio, compared
from comparisons.experiments.convergence.methods import Method
from reference_rt.core.arrays import FloatArray

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
