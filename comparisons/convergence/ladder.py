"""The ladder: each rung's replicates, contestants in turn, and what is stored of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from comparisons.convergence.contestants import Renderer
from comparisons.convergence.data import Reference, Rung
from comparisons.convergence.estimates import Accumulator, against
from comparisons.convergence.store import Store

PATIENCE = 1.5
"""Times its share of the time that a contestant may take, where a trial promised too much."""

Say = Callable[[str, float], None]
"""Is told what is being done, and the fraction of it that is done."""


@dataclass
class Climb:
    """One contestant on the ladder.

    planned: its rungs;  share: its seconds;  rungs: those that are done;  stopped: why not all.
    """

    renderer: Callable[[], Renderer]
    planned: Sequence[int]
    share: float
    rungs: list[Rung] = field(default_factory=list)
    stopped: str = ""

    @property
    def spent(self) -> float:
        """Seconds of rendering, those of former runs included."""
        return sum(float(rung.seconds.sum()) for rung in self.rungs)

    def may_go_on(self, spp: int) -> bool:
        """Whether the next rung, twice the last one's time, ends within PATIENCE; says so if not.

        The first two rungs are always done: without two there is no curve.
        """
        if spp not in self.planned or self.stopped:
            return False
        if len(self.rungs) < 2:
            return True
        expected = 2.0 * float(self.rungs[-1].seconds.sum())
        if self.spent + expected <= PATIENCE * self.share:
            return True
        self.stopped = (
            f"rungs from {spp} samples a pixel: slower than its trial promised; {self.spent:.2g} s "
            f"of its {self.share:.2g} s are spent"
        )
        return False


def climb(
    climbs: Mapping[str, Climb],
    reference: Reference,
    replicates: int,
    store: Store,
    say: Say = lambda what, fraction: None,
) -> None:
    """Do the rungs that are planned and not stored, the lowest first.

    The contestants take turns, picture by picture, so that what disturbs the machine disturbs all.
    A rung that is finished is stored at once.
    """
    steps = sorted({spp for one in climbs.values() for spp in one.planned})
    for spp in steps:
        waiting: dict[str, tuple[Renderer, Accumulator]] = {}
        for name, one in climbs.items():
            if not one.may_go_on(spp):
                continue
            done = store.rung(name, spp)
            if done is not None:
                one.rungs.append(against(done, reference))
            else:
                waiting[name] = (one.renderer(), Accumulator(spp, reference))
        task = f"{spp} samples a pixel"
        if waiting:
            say(task, 0.0)
        for k in range(replicates):
            for renderer, gathered in waiting.values():
                # The numbers of other rungs' replicates are none of this one's.
                shot = renderer(spp, spp * replicates + k)
                gathered.add(shot.picture, shot.spp, shot.seconds)
            if waiting:
                say(task, (k + 1) / replicates)
        for name, (_, gathered) in waiting.items():
            rung = gathered.rung()
            store.keep(name, rung)
            climbs[name].rungs.append(rung)


__all__ = ["Climb", "climb"]
