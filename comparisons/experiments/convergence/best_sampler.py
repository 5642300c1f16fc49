"""Mitsuba's best sampler for a scene: by a trial of all whose pictures have the right mean."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from comparisons.experiments.convergence.methods import Method, Shot, Stable, with_sampler
from comparisons.experiments.convergence.store import size_within, weights
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene

CANDIDATES = ("independent", "multijitter", "orthogonal")
"""Not `stratified`: multijitter is never worse (64 samples: 1.76 against 1.57 ms in a Cornell box,
0.28 against 0.26 ms with `veach_mis`).  Not `ldsampler`: the mean of its pictures is another one,
by 0.5 % in Mitsuba's Cornell box (`findings/mitsuba-ldsampler.sh`)."""


def candidates(scene: Scene) -> tuple[str, ...]:
    """Mitsuba's samplers whose pictures of a scene have the right mean: of media, that of
    independent samples alone has it (`findings/mitsuba-media-stratified.sh`)."""
    return CANDIDATES[:1] if scene.has_media else CANDIDATES


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
    by_name = {name: with_sampler(method, name) for name in candidates(scene)}
    found = in_turn(scene.changed(film=film), by_name, SPP, PICTURES)
    return {name: one.work for name, one in found.items()}


class Taken(NamedTuple):
    """The pictures of a method.

    seconds (pictures,): of each;  relmse (pictures,): the squared deviation of each from their
    mean, relative as in `weights`, and times n / (n - 1), so that the mean over the pictures is the
    relMSE of one picture, without a reference and without the bias of one;  mean (height, width,
    3).
    """

    seconds: FloatArray
    relmse: FloatArray
    mean: FloatArray

    @property
    def warm(self) -> FloatArray:
        """The seconds of all but the first picture, which may compile."""
        return self.seconds[1:]

    @property
    def work(self) -> float:
        """relMSE times seconds: what does not depend on the number of independent samples."""
        return float(self.relmse.mean() * np.median(self.warm))


def in_turn(
    scene: Scene,
    methods: Mapping[str, Method],
    spp: int,
    pictures: int,
    say: Progress = lambda what, fraction: None,
) -> dict[str, Taken]:
    """Independent pictures of `scene` by each method, at least two, by the names of the methods.

    The methods take turns, in every other round in the reverse order: what disturbs the machine
    disturbs all.  Weights of errors come from the mean of all pictures.  Raises as `Stable.ready`
    does.
    """
    shots: dict[str, list[Shot]] = {name: [] for name in methods}
    with Stable(scene) as stable:
        renderers = {name: stable.ready(method) for name, method in methods.items()}
        for k in range(pictures):
            for name in list(methods)[:: 1 if k % 2 == 0 else -1]:
                say(name, k / pictures)
                shots[name].append(renderers[name](spp, k))
    weight = weights(np.mean([shot.picture for taken in shots.values() for shot in taken], axis=0))
    found = {}
    for name, taken in shots.items():
        mean = np.mean([shot.picture for shot in taken], axis=0)
        squares = [float((weight * (shot.picture - mean) ** 2).mean()) for shot in taken]
        relmse = np.array(squares) * pictures / (pictures - 1)
        found[name] = Taken(np.array([shot.seconds for shot in taken]), relmse, mean)
    return found
