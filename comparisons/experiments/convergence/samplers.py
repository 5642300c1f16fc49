"""Finds Mitsuba's best sampler for a scene: the one with the least variance times time."""

import numpy as np

from comparisons.experiments.convergence.data import size_within, weights
from comparisons.experiments.convergence.methods import Method, Shot, Stable, with_sampler
from reference_rt.rendering.scene import Scene

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
