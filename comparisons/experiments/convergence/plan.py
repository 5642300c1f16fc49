"""Plans the rungs of each method within the time limit, from the times of a few pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

from comparisons.experiments.convergence.data import FIRST, Settings
from comparisons.experiments.convergence.methods import Renderer

TRIALS = (FIRST, 4 * FIRST)
"""Samples a pixel of the pictures that costs are estimated from."""

TRIAL_SEED = 1 << 20
"""Replicate number of these pictures, above all that count."""

MOST_SAMPLES = (1 << 32) - 1
"""Of one picture: Mitsuba numbers them with 32 bits."""


@dataclass(frozen=True)
class Cost:
    """Seconds of a picture: start + per_sample * samples per pixel."""

    start: float
    per_sample: float

    def picture(self, spp: int) -> float:
        return self.start + self.per_sample * spp

    def rung(self, spp: int, replicates: int) -> float:
        return replicates * self.picture(spp)


def estimate(renderer: Renderer) -> Cost:
    """From three pictures each with two numbers of samples: the first of the three may compile, and
    the fastest other is what was disturbed least."""
    found = []
    for spp in TRIALS:
        shots = [renderer(spp, TRIAL_SEED + k) for k in range(3)]
        found.append((shots[0].spp, min(shot.seconds for shot in shots[1:])))
    (few, short), (many, long) = found
    # Where noise hides the difference, all of the longer one counts as samples.
    per_sample = (long - short) / (many - few) if long > short else long / many
    return Cost(max(0.0, short - per_sample * few), per_sample)


def rungs(max_spp: int, factor: int = 2) -> tuple[int, ...]:
    """FIRST, `factor` times that, ... up to `max_spp`."""
    found = []
    spp = FIRST
    while spp <= max_spp:
        found.append(spp)
        spp *= factor
    return tuple(found)


def affordable(
    cost: Cost, seconds: float, settings: Settings, pixels: int, factor: int = 2
) -> tuple[int, ...]:
    """The rungs that fit into `seconds`, the cheapest first."""
    found: list[int] = []
    for spp in rungs(settings.max_spp, factor):
        seconds -= cost.rung(spp, settings.replicates)
        if seconds < 0.0 or spp * pixels > MOST_SAMPLES:
            break
        found.append(spp)
    return tuple(found)


def why_left_out(
    cost: Cost,
    planned: Sequence[int],
    share: float,
    settings: Settings,
    pixels: int,
    factor: int = 2,
) -> str:
    """Why the rung after the last planned one is not rendered; "" if it is above max_spp."""
    following = [spp for spp in rungs(settings.max_spp, factor) if spp not in planned]
    if not following:
        return ""
    spp = following[0]
    if spp * pixels > MOST_SAMPLES:
        return f"rungs from {spp} samples per pixel: over {MOST_SAMPLES:,} samples in a picture"
    spent = sum(cost.rung(done, settings.replicates) for done in planned)
    return (
        f"rungs from {spp} samples per pixel: {settings.replicates} pictures would take "
        f"{cost.rung(spp, settings.replicates):.2g} s, and {max(0.0, share - spent):.2g} s of its "
        f"{share:.2g} s are left"
    )
