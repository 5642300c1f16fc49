"""Pools of rendered replicates, from which runs draw some at random."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.compare import budgeted
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.translator import load
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

POOL = 10
"""Replicates in a pool over those that a run draws. The noise of a pool's mean, which all runs have
in common, is a third of a run's; the mean of a run scatters by 5 % too little."""


@dataclass(frozen=True)
class Pools:
    """Replicates of either side, (count, height, width, 3)."""

    candidate: FloatArray
    reference: FloatArray

    def draw(
        self, rng: np.random.Generator, counts: tuple[int, int]
    ) -> tuple[FloatArray, FloatArray]:
        """So many of each side, without repetition."""
        sides = zip((self.candidate, self.reference), counts, strict=True)
        one, two = (side[rng.choice(len(side), count, replace=False)] for side, count in sides)
        return one, two

    def centred(self) -> "Pools":
        """The candidate times a factor a channel that makes both pools' image means equal: then a
        bias that is planted is the only one."""
        means = [side.mean(axis=(0, 1, 2)) for side in (self.reference, self.candidate)]
        return Pools(self.candidate * (means[0] / means[1]), self.reference)


def of_ours(scene: Scene, count: int, first: int = 0) -> FloatArray:
    """Our replicates (count, height, width, 3), with seeds from `first` on."""
    tables, sampler = build_tables(scene), scene.resolved_sampler
    seeded = (sampler.model_copy(update={"seed": first + k}) for k in range(count))
    return np.stack([render(scene.changed(sampler=s), tables=tables).colour for s in seeded])


def of_mitsuba(scene: Scene, count: int, spp: int | None = None) -> FloatArray:
    """Mitsuba's replicates (count, height, width, 3); spp: None for the scene's."""
    counterpart, samples = load(scene), spp or scene.resolved_sampler.spp
    return np.stack(
        [mitsuba_scene.picture(counterpart.mi_scene, samples, seed) for seed in range(count)]
    )


def of_scene(path: Path, budget: Budget, counts: tuple[int, int] | None = None) -> Pools:
    """Pools of our replicates and Mitsuba's for runs of so many; None: the budget's replicates."""
    scene = budgeted(Scene.load(path), budget)
    ours, theirs = counts or (budget.replicates, budget.replicates)
    return Pools(
        of_ours(scene, POOL * ours), of_mitsuba(scene, POOL * theirs, budget.reference_spp)
    )
