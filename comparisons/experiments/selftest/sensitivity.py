"""Plants faults and compares the faulty renderer with each suite's budgets."""

import os
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from comparisons import statistics
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Say, Subject, gather
from comparisons.compare.judge import Evidence, judge, of_replicates, picture_rungs
from comparisons.experiments.selftest.fault import (
    CAUGHT,
    PACKAGE,
    Fault,
    Finding,
    PictureFault,
    SceneFault,
    SourceFault,
    compared,
    finding,
    run_patched,
)
from comparisons.experiments.selftest.of_pictures import (
    SCENE,
    black_level,
    blurred,
    dark_tile,
    gain,
    shifted,
)
from comparisons.experiments.selftest.specificity import LEVEL, Pools, of_scene
from comparisons.results.case import Case
from comparisons.rungs.images import images_rung
from comparisons.runs.elsewhere import run_elsewhere
from comparisons.statistics.metrics import image_metrics
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.workers import Workers

# Statistical power: the fraction of runs that catch a fault, by its size; and calibration: how
# often the bias that a verdict states as detectable is detected.


# ---- calibration: how often the stated bias is detected, and half of it -------------------------
# The statistics state the smallest bias of the image mean that such a run detects with 99 % power.
# Each run draws replicates of both sides, reads that bias, plants it in the channel where it is
# largest, and judges the image mean again: single pixels without noise, such as those that see a
# lamp, would show any bias.  If more than 97 % are caught the power is not overstated; if half of
# the stated bias is caught no more often than MOST_HALF explains, it is not understated either.


SCENES = ("colour_bleeding", "cornell_box", "soft_shadows", "light_shapes", "caustic_glass")

BUDGET = Budget(size=(64, 48), spp=64)

LEAST = 0.97
"""Of the stated biases that must be caught."""

MOST_HALF = 0.24
"""The largest chance that half a stated bias is caught.  A bias that is proven with a chance of
0.99 is 6.11 standard errors where 3.78 are proven: half of it is caught with a chance of 0.235
(normal quantiles; those of fewer degrees of freedom and a margin make it less)."""


@dataclass(frozen=True)
class Calibration:
    """stated: the median of the biases that were stated as detectable;  caught, half_caught: the
    fraction of runs that caught the stated bias, and half of it."""

    scene: str
    runs: int
    stated: float
    caught: float
    half_caught: float

    @property
    def holds(self) -> bool:
        """Whether the stated bias is neither too small nor too large."""
        most = float(stats.binom.isf(LEVEL, self.runs, MOST_HALF))
        return self.caught >= LEAST and self.half_caught * self.runs <= most

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def calibration(runs: int, scenes: Path, say: Say) -> list[Calibration]:
    """The calibration of each scene."""
    found = []
    for name in SCENES:
        pools = of_scene(scenes / f"{name}.yaml", BUDGET).centred()
        found.append(of_pools(name, pools, runs, BUDGET.replicates))
        one = found[-1]
        say(
            f"{name}: the stated bias, {one.stated:.2%}, was caught in {one.caught:.1%}, "
            f"half of it in {one.half_caught:.1%}"
        )
    return found


def of_pools(name: str, pools: Pools, runs: int, replicates: int) -> Calibration:
    """The calibration of runs that draw so many replicates of each side."""
    stated, caught = [], np.zeros(2)
    for run in range(runs):
        rng = np.random.default_rng(run)
        ours, reference = pools.draw(rng, (replicates, replicates))
        biases = statistics.compare(ours, reference).numbers["detectable_bias"]
        bias = np.array([biases[channel] for channel in statistics.CHANNELS], dtype=np.float64)
        channel = int(bias.argmax())
        stated.append(bias[channel])
        for k, share in enumerate((1.0, 0.5)):
            factors = np.ones(3)
            factors[channel] += rng.choice((-1.0, 1.0)) * share * bias[channel]
            caught[k] += statistics.compare(ours * factors, reference).numbers["image"]["differs"]
    whole, half = (float(share) for share in caught / runs)
    return Calibration(name, runs, float(np.median(stated)), whole, half)


# ---- power by size ------------------------------------------------------------------------------


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
    assert pool.rendered.replicates is not None
    ours, reference = (
        side[rng.choice(len(side), budget.replicates, replace=False)]
        for side in pool.rendered.replicates
    )
    rendered = of_replicates(fault.change(ours), reference, {})
    if any(rung.status in CAUGHT for rung in picture_rungs(rendered, budget.limit)):
        return True
    metrics = image_metrics(rendered.images)
    return images_rung(rendered.images, metrics, rendered.replicates).status in CAUGHT


Budgets = Mapping[str, Mapping[str, Budget]]
"""Budgets by suite and scene."""

MOST_SECONDS = 900.0
"""Time limit of one patched renderer, which compiles its kernels."""


class StaleFaultError(ReferenceRtError):
    """The text that a fault replaces does not occur exactly once in the source."""


def sensitivity(
    faults: Sequence[Fault], budgets: Budgets, scenes: Path, workers: Workers
) -> Iterator[Finding]:
    """The finding of each suite for each fault, as they are made."""
    right = {}
    for fault in faults:
        for suite, by_scene in budgets.items():
            budget = by_scene[fault.scene]
            if isinstance(fault, PictureFault):
                key = (suite, fault.scene)
                if key not in right:
                    scene = Scene.load(scenes / f"{fault.scene}.yaml")
                    right[key] = gather(Subject(scene), budget, _silent)
                yield finding(fault, suite, _altered(right[key], fault, budget))
            elif isinstance(fault, SceneFault):
                scene = Scene.load(scenes / f"{fault.scene}.yaml")
                subject = Subject(fault.change(scene), scene)
                yield finding(fault, suite, compared(subject, budget))
    sources = [fault for fault in faults if isinstance(fault, SourceFault)]
    threads = max(1, (os.cpu_count() or 1) // workers.threads)
    tasks = [
        (fault, {s: b[fault.scene] for s, b in budgets.items()}, scenes.resolve(), threads)
        for fault in sources
    ]
    for found in run_elsewhere(workers, _patched, tasks):
        yield from found


def _silent(step: str) -> None:
    pass


def _altered(evidence: Evidence, fault: PictureFault, budget: Budget) -> Case:
    rendered = evidence.rendered
    assert rendered is not None
    assert rendered.replicates is not None
    ours, reference = rendered.replicates
    with np.errstate(all="ignore"):
        altered = of_replicates(fault.change(ours), reference, rendered.seconds)
    return judge(replace(evidence, rendered=altered), budget.limit)


def patched_text(fault: SourceFault) -> str:
    """The patched source.  Raises StaleFaultError."""
    text = (PACKAGE / fault.file).read_text(encoding="utf-8")
    if text.count(fault.old) != 1:
        raise StaleFaultError(
            f"selftest: '{fault.name}': the text that it replaces occurs {text.count(fault.old)} "
            f"times in {fault.file}; expected once"
        )
    return text.replace(fault.old, fault.new)


def _patched(
    fault: SourceFault, budgets: Mapping[str, Budget], scenes: Path, threads: int
) -> list[Finding]:
    """Compare a patched copy of the renderer with Mitsuba, in its own process."""
    try:
        return compare_patched(fault, patched_text(fault), budgets, scenes, threads)
    except subprocess.TimeoutExpired:
        why = f"it took more than {MOST_SECONDS:.0f} s"
    except ReferenceRtError as error:
        why = str(error)
    raise ReferenceRtError(f"selftest: '{fault.name}' could not be compared: {why}")


def compare_patched(
    fault: SourceFault,
    text: str,
    budgets: Mapping[str, Budget],
    scenes: Path,
    threads: int,
    until_caught: bool = False,
) -> list[Finding]:
    """The findings of the suites where the fault's file has `text`, in their order;  until_caught:
    leave out the suites after the first that catches it.  Raises as `run_patched`."""
    task = {
        "fault": asdict(fault),
        "scenes": str(scenes.resolve()),
        "budgets": {suite: budget.model_dump() for suite, budget in budgets.items()},
        "threads": threads,
        "until_caught": until_caught,
    }
    worker = "comparisons.experiments.selftest.source_worker"
    answer = run_patched(fault.file, text, worker, task, MOST_SECONDS)
    return [Finding(**fields) for fields in answer]
