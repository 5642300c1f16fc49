"""The ladder: plans the rungs of each method, renders and stores the replicates of each; the
methods take turns."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from comparisons.experiments.convergence.estimates import Accumulator, against
from comparisons.experiments.convergence.methods import (
    AbsentError,
    Method,
    Renderer,
    Shot,
    Stable,
    with_sampler,
)
from comparisons.experiments.convergence.store import (
    FIRST,
    Reference,
    Rung,
    Settings,
    Store,
    size_within,
    weights,
)
from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene

# ---- the plan -----------------------------------------------------------------------------------


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


# ---- Mitsuba's best sampler ---------------------------------------------------------------------


CANDIDATES = ("independent", "multijitter", "ldsampler", "orthogonal")
"""Not `stratified`: multijitter is never worse (64 samples: 1.76 against 1.57 ms in a Cornell box,
0.28 against 0.26 ms with `veach_mis`)."""

SPP = 256
"""Samples a pixel of the trial; orthogonal takes 289.  With fewer it looks worse than it is later:
it stratifies more dimensions together, for which there must be samples."""

WIDEST = 48
"""Pixels across, at most: whether a sampler is good does not depend on the picture's size."""

PICTURES = 5
"""Of each: the first compiles; the variance is known to a few percent over all pixels."""


def merits(scene: Scene, method: Method) -> dict[str, float]:
    """Relative variance times seconds by sampler, of the method's side of Mitsuba; the least is
    the best.  Raises as `Stable.ready` does."""
    width, height = size_within(scene.film, WIDEST)
    film = scene.film.model_copy(update={"width": width, "height": height})
    shots: dict[str, list[Shot]] = {name: [] for name in CANDIDATES}
    with Stable(scene.changed(film=film)) as stable:
        renderers = {name: stable.ready(with_sampler(method, name)) for name in CANDIDATES}
        for k in range(PICTURES):  # in turn: what disturbs the machine disturbs all
            for name, renderer in renderers.items():
                shots[name].append(renderer(SPP, k))
    weight = weights(np.mean([shot.picture for taken in shots.values() for shot in taken], axis=0))
    return {
        name: float(
            (weight * np.var([shot.picture for shot in taken], axis=0, ddof=1)).mean()
            * np.median([shot.seconds for shot in taken[1:]])
        )
        for name, taken in shots.items()
    }


# ---- the ladder ---------------------------------------------------------------------------------


PATIENCE = 1.5
"""A method may take this many times its share of the time, if its trial was too fast."""

STORED_EVERY = 15.0
"""Seconds of work that a kill can lose.  Ctrl-C loses no finished picture."""


@dataclass
class Climb:
    """One method on the ladder.

    renderer: prepares it when first needed;  planned: its rungs;  share: its seconds;  apart:
    whether its turn comes after the others' rungs, because switching to it takes time;  gathered:
    replicates so far, by requested samples;  stopped: why rungs were given up;  failed: why it has
    no rungs at all.
    """

    renderer: Callable[[], Renderer]
    planned: Sequence[int]
    share: float
    apart: bool = False
    gathered: dict[int, Accumulator] = field(default_factory=dict)
    stopped: str = ""
    failed: str = ""

    @property
    def rungs(self) -> list[Rung]:
        """The rungs with at least one replicate, the lowest first."""
        return [self.gathered[spp].rung() for spp in self.planned if self.gathered[spp].count]

    def add(self, spp: int, replicate: int) -> None:
        """Render one more picture.  A method that fails, or whose picture is not finite, loses all
        its rungs."""
        try:
            shot = self.renderer()(spp, replicate)
        except AbsentError as error:
            self.failed = str(error)
        else:
            bad = np.count_nonzero(~np.isfinite(shot.picture).all(axis=-1))
            if not bad:
                self.gathered[spp].add(*shot)
                return
            self.failed = f"{bad} pixels of a picture of {spp} samples per pixel are not finite"
        self.planned = ()

    def shorten(self, replicates: int) -> None:
        """Give up the highest rungs if all replicates would take more than PATIENCE times the
        share, as extrapolated from those so far; two rungs stay, the minimum for a curve."""
        rungs = {spp: self.gathered[spp].rung() for spp in self.planned}
        taking = {spp: replicates * float(rung.warm.mean()) for spp, rung in rungs.items()}
        while len(taking) > 2 and sum(taking.values()) > PATIENCE * self.share:
            highest = max(taking)
            if self.gathered[highest].count >= replicates:
                break
            self.stopped = (
                f"rungs from {highest} samples per pixel: slower than in the trial, "
                f"{sum(taking.values()):.2g} s in total, of a share of {self.share:.2g} s"
            )
            del taking[highest]
        self.planned = list(taking)


def climb(
    climbs: Mapping[str, Climb],
    reference: Reference,
    replicates: int,
    store: Store,
    say: Progress = lambda what, fraction: None,
) -> None:
    """Render what is planned and not stored, in sweeps: one picture of every rung of every method,
    then the next of each.

    Each rung's pictures are thus spread over the whole run: a disturbance of the machine affects
    all methods alike, and no rung's median.  Pictures are stored, after an interruption too.
    """
    for name, one in climbs.items():
        for spp in one.planned:
            done = store.rung(name, spp)
            one.gathered[spp] = Accumulator(spp, reference, done and against(done, reference))
    stored = time.monotonic()
    changed: set[tuple[str, int]] = set()

    def keep() -> None:
        for name, spp in sorted(changed):
            if not climbs[name].failed:
                store.keep(name, climbs[name].gathered[spp].rung())
        changed.clear()

    say("ladder", 0.0)
    try:
        for k in range(replicates):
            sweep = _sweep(climbs)
            samples, all_samples = 0, sum(spp for _, spp in sweep)
            for name, spp in sweep:
                one = climbs[name]
                if one.gathered[spp].count <= k and not one.failed:
                    # No two rungs share replicate numbers, and hence seeds.
                    one.add(spp, spp * replicates + k)
                    changed.add((name, spp))
                samples += spp
                say("ladder", (k + samples / all_samples) / replicates)
            if time.monotonic() - stored > STORED_EVERY:
                keep()
                stored = time.monotonic()
            if k == 1:
                for one in climbs.values():
                    one.shorten(replicates)
    except KeyboardInterrupt:
        with suppress(KeyboardInterrupt):
            keep()
        raise
    keep()


def _sweep(climbs: Mapping[str, Climb]) -> list[tuple[str, int]]:
    """(method, samples): rung by rung, methods in turn."""
    pairs = [(name, spp) for name, one in climbs.items() for spp in one.planned]
    return sorted(pairs, key=lambda pair: (climbs[pair[0]].apart, pair[1]))
