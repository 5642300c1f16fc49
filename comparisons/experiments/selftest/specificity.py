"""The rate of false alarms: verdicts against the correct renderer, over many seeds."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Say, budgeted
from comparisons.compare.judge import Evidence, judge, of_replicates
from comparisons.experiments.selftest.finding import CAUGHT
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.mitsuba.translate import load
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

SCENES: tuple[tuple[str, Budget], ...] = (
    ("cornell_box", Budget(size=(32, 32), spp=16)),
    ("caustic_glass", Budget(size=(32, 24), spp=64)),
)
"""Small pictures, which can be rendered thousands of times; the second has heavy-tailed noise."""

ALLOWED = 1e-3
"""Allowed false alarms per case."""


@dataclass(frozen=True)
class Alarms:
    """runs: comparisons with new replicates;  false_alarms: verdicts `differ` and `invalid`;
    rungs: their numbers by rung;  upper: the upper 95 % confidence bound of their rate (Clopper and
    Pearson 1934)."""

    scene: str
    runs: int
    replicates: int
    false_alarms: int
    rungs: dict[str, int]
    upper: float

    @property
    def holds(self) -> bool:
        """Whether the rate is at most ALLOWED."""
        return self.false_alarms <= ALLOWED * self.runs

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def specificity(runs: int, scenes: Path, say: Say) -> Sequence[Alarms]:
    """Compare `runs` sets of replicates per scene; no seed is used twice."""
    return [_of_scene(scenes / f"{name}.yaml", budget, runs, say) for name, budget in SCENES]


def _of_scene(path: Path, budget: Budget, runs: int, say: Say) -> Alarms:
    scene = budgeted(Scene.load(path), budget)
    tables, counterpart = build_tables(scene), load(scene)
    sampler, count = scene.resolved_sampler, budget.replicates
    found: Counter[str] = Counter()
    for run in range(runs):
        seeds = range(run * count, (run + 1) * count)
        ours = np.stack(
            [
                render(
                    scene.changed(sampler=sampler.model_copy(update={"seed": seed})), tables=tables
                ).colour
                for seed in seeds
            ]
        )
        reference = np.stack(
            [mitsuba_scene.picture(counterpart.mi_scene, sampler.spp, seed) for seed in seeds]
        )
        case = judge(Evidence(scene.name, (), of_replicates(ours, reference, {}), {}), budget.limit)
        if case.verdict in CAUGHT:
            found[case.reason.partition(":")[0]] += 1
        if (run + 1) % 100 == 0:
            say(f"{scene.name}: {sum(found.values())} false alarms in {run + 1} runs")
    alarms = sum(found.values())
    upper = float(stats.beta.ppf(0.95, alarms + 1, runs - alarms)) if alarms < runs else 1.0
    return Alarms(scene.name, runs, count, alarms, dict(found), upper)
