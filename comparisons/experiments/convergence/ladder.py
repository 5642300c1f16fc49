"""The ladder: replicates at each rung, methods in turn, and what is stored of them."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from comparisons.experiments.convergence.data import Reference, Rung
from comparisons.experiments.convergence.estimates import Accumulator, against
from comparisons.experiments.convergence.methods import AbsentError, Renderer
from comparisons.experiments.convergence.store import Store
from reference_rt.rendering.render import Progress

PATIENCE = 1.5
"""Times its share of the time that a method may take, where a trial promised too much."""

STORED_EVERY = 15.0
"""Seconds: what a kill can lose.  Ctrl-C loses no picture that is finished."""


@dataclass
class Climb:
    """One method on the ladder.

    renderer: makes it ready, when first needed;  planned: its rungs;  share: its seconds;  apart:
    whether its turn comes when the others are through with their rungs, since changing to it takes
    time;  gathered: by samples asked for, what is done of them;  stopped: why not all are;  failed:
    why it has no rungs at all.
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
        """Those that are done, the lowest first."""
        return [self.gathered[spp].rung() for spp in self.planned if self.gathered[spp].count]

    def add(self, spp: int, replicate: int) -> None:
        """Render one more picture.  A method that cannot, or whose picture is not finite, gives
        up all of its rungs."""
        try:
            shot = self.renderer()(spp, replicate)
        except AbsentError as error:
            self.failed = str(error)
        else:
            bad = np.count_nonzero(~np.isfinite(shot.picture).all(axis=-1))
            if not bad:
                self.gathered[spp].add(*shot)
                return
            self.failed = f"{bad} pixels of a picture of {spp} samples a pixel are not finite"
        self.planned = ()

    def shorten(self, replicates: int) -> None:
        """Give up the highest rungs where the pictures so far say that all replicates would take
        PATIENCE times the share; two rungs stay, without which there is no curve."""
        rungs = {spp: self.gathered[spp].rung() for spp in self.planned}
        taking = {spp: replicates * float(rung.warm.mean()) for spp, rung in rungs.items()}
        while len(taking) > 2 and sum(taking.values()) > PATIENCE * self.share:
            highest = max(taking)
            if self.gathered[highest].count >= replicates:
                break
            self.stopped = (
                f"rungs from {highest} samples a pixel: slower than the trial promised, "
                f"{sum(taking.values()):.2g} s in all, and its share is {self.share:.2g} s"
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
    """Do what is planned and not stored, in sweeps: one picture of every rung of every method,
    then the next of each.

    So each rung's pictures are spread over the whole run, and what disturbs the machine for a while
    disturbs all methods, and no rung's median.  What is done is stored, also when interrupted.
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
                    # The numbers of other rungs' replicates are none of this one's.
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


__all__ = ["Climb", "climb"]
