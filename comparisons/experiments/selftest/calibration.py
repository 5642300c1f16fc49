"""How often the bias that a verdict states as detectable is detected, and half of it.

The statistics state the smallest bias of the image mean that such a run detects with 99 % power.
Each run draws replicates of both sides, reads that bias, plants it in the channel where it is
largest, and judges the image mean again: single pixels without noise, such as those that see a
lamp, would show any bias.  If more than 97 % are caught the power is not overstated; if half of
the stated bias is caught no more often than MOST_HALF explains, it is not understated either.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from comparisons import statistics
from comparisons.compare.budget import Budget
from comparisons.compare.compare import Say
from comparisons.experiments.selftest.pools import Pools, of_scene
from comparisons.experiments.selftest.specificity import LEVEL

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
