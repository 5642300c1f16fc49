"""The ladder: renders and stores the replicates of each rung; the methods take turns."""

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
