"""Statistical power: the fraction of runs that catch a fault, by its size."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Say, Subject, gather
from comparisons.compare.judge import Evidence, of_replicates, picture_rungs
from comparisons.experiments.selftest.fault import CAUGHT, PictureFault
from comparisons.experiments.selftest.of_pictures import (
    SCENE,
    black_level,
    blurred,
    dark_tile,
    gain,
    shifted,
)
from comparisons.rungs.images import images_rung
from comparisons.statistics.metrics import image_metrics
from reference_rt.rendering.scene import Scene

RUNS = 10
POOL = 3
"""Rendered replicates over those that one run uses: each run draws some at random."""

CURVES: Mapping[str, tuple[Callable[[float], PictureFault], tuple[float, ...]]] = {
    "gain, %": (lambda x: gain(1.0 + x / 100.0), (0.05, 0.1, 0.2, 0.3, 0.5, 1.0)),
    "gain of red, %": (lambda x: gain(1.0 + x / 100.0, 0), (0.05, 0.1, 0.2, 0.3, 0.5, 1.0)),
    "shift, px": (lambda x: shifted(x, 0.0), (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)),
    "blur, px": (blurred, (0.1, 0.2, 0.3, 0.4, 0.5)),
    "one dark tile, %": (lambda x: dark_tile(x / 100.0), (0.5, 1.0, 2.0, 3.0, 5.0, 10.0)),
    "black level, 1e-3 W/sr/m²": (lambda x: black_level(1e-3 * x), (0.05, 0.1, 0.2, 0.5, 1.0)),
}


@dataclass(frozen=True)
class Curve:
    """fault: its name and unit;  sizes: of the fault;  caught: the fraction of runs that caught
    each size;  runs: per size."""

    fault: str
    sizes: tuple[float, ...]
    caught: tuple[float, ...]
    runs: int

    @property
    def by_size(self) -> str:
        """Such as "0.1: 20%, 0.2: 90%"."""
        pairs = zip(self.sizes, self.caught, strict=True)
        return ", ".join(f"{size:g}: {caught:.0%}" for size, caught in pairs)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def power_curves(budget: Budget, scenes: Path, say: Say) -> list[Curve]:
    """Power curves of the faults in CURVES, for one scene with a suite's budget."""
    scene = Scene.load(scenes / f"{SCENE}.yaml")
    many = budget.model_copy(update={"replicates": POOL * budget.replicates})
    pool = gather(Subject(scene), many, say, only=("statistics", "images"))
    rng = np.random.default_rng(0)
    curves = []
    for name, (fault_of, sizes) in CURVES.items():
        caught = [
            sum(_caught(pool, fault_of(size), budget, rng) for _ in range(RUNS)) / RUNS
            for size in sizes
        ]
        curves.append(Curve(name, sizes, tuple(caught), RUNS))
        say(f"{name}: {curves[-1].by_size}")
    return curves


def _caught(pool: Evidence, fault: PictureFault, budget: Budget, rng: np.random.Generator) -> bool:
    assert pool.rendered is not None
    assert pool.rendered.resampled is not None
    candidate, reference = pool.rendered.resampled
    ours, theirs = (
        side[rng.choice(len(side), budget.replicates, replace=False)]
        for side in (candidate, reference)
    )
    changed = fault.change(ours)
    rendered = of_replicates(changed, theirs, {})
    if any(rung.status in CAUGHT for rung in picture_rungs(rendered, budget.limit)):
        return True
    metrics = image_metrics(rendered.images)
    return images_rung(rendered.images, metrics, (changed, theirs)).status in CAUGHT
