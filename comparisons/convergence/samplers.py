"""Which of Mitsuba's samplers is the best for a scene: the least variance times time."""

import numpy as np

from comparisons.convergence.contestants import Contestant, Shot, Stable, with_sampler
from comparisons.convergence.data import weights

CANDIDATES = ("independent", "multijitter", "ldsampler", "orthogonal")
"""Not `stratified`: multijitter is never worse (64 samples: 1.76 against 1.57 ms in a Cornell box,
0.28 against 0.26 ms with `veach_mis`)."""

SPP = 64
"""Samples a pixel of the trial; orthogonal takes 121."""

PICTURES = 4
"""Of each: the first compiles; the variance is known to a few percent over all pixels."""


def merits(stable: Stable, contestant: Contestant) -> dict[str, float]:
    """Relative variance times seconds by sampler, of the contestant's side of Mitsuba; the least is
    the best.  Raises as `Stable.ready` does."""
    renderers = {name: stable.ready(with_sampler(contestant, name)) for name in CANDIDATES}
    shots: dict[str, list[Shot]] = {name: [] for name in CANDIDATES}
    for k in range(PICTURES):  # in turn: what disturbs the machine disturbs all
        for name, renderer in renderers.items():
            shots[name].append(renderer(SPP, k))
    mean = np.mean([shot.picture for taken in shots.values() for shot in taken], axis=0)
    weight = weights(mean)
    return {
        name: float(
            (weight * np.var([shot.picture for shot in taken], axis=0, ddof=1)).mean()
            * np.median([shot.seconds for shot in taken[1:]])
        )
        for name, taken in shots.items()
    }


__all__ = ["CANDIDATES", "SPP", "merits"]
