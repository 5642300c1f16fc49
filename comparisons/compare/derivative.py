"""Whether Mitsuba's derivative of a picture is that of the picture: the case of a scene, one of its
parameters, and one of Mitsuba's integrators that differentiate.

Ours are differences of whole pictures (`reference_rt.rendering.derivative`): they see every edge
that moves, know nothing of sampling, weights or adjoints, and nothing of Mitsuba.  The statistics
are those of pictures, of values of both signs.  Rung `adjoint`: forward and reverse mode must give
the same number for the same random numbers, <J v, w> = <v, J^T w>, whatever is right.
"""

import math
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.derivative_causes import Ours, likeliest
from comparisons.compare.looks import FIRST, Pool, mean_picture, most_kept, until_decided
from comparisons.mitsuba.backend import mitsuba
from comparisons.renderers import NoCounterpartError
from comparisons.results.case import Case, Images, RungResult, decide
from comparisons.statistics import replicates_asked, standard_error
from comparisons.statistics.cells import Margins
from comparisons.statistics.decide import compare
from comparisons.statistics.sides import side_of
from comparisons.translator.derivative import Differentiator, Moving
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene

SECONDS = 120.0
"""For replicates where the budget has no limit of time."""

WEIGHTINGS = 3
"""Random weights for which forward and reverse mode are compared."""


def derivative_case(
    scene: Scene, budget: Budget, say: Callable[[str], None], threads: int | None = None
) -> Case:
    """The verdict on Mitsuba's derivative by `budget.derivative`, of a scene that has the budget's
    size and samples.  Raises UsageError, SceneError, ReferenceUnavailableError."""
    asked = budget.derivative
    assert asked is not None
    differentiator = Differentiator(asked.integrator, asked.guiding)
    sides = ("ours", f"Mitsuba's ({differentiator.words})")
    try:
        theirs = _Theirs(scene, asked.parameter, differentiator)
    except NoCounterpartError as error:
        rung = RungResult("derivative", "not-comparable", str(error))
        verdict, reason = decide([rung], None)
        return Case(scene.name, verdict, reason, (rung,), None, {}, sides=sides)
    ours = Ours(scene, asked.parameter, asked.step, threads)
    both = _Both(ours, theirs, scene, budget.limit)
    looked = until_decided(
        both.grow,
        both.look,
        seconds=budget.seconds or SECONDS,
        first=max(FIRST, budget.replicates),
        most=both.most,
        asked=both.asked,
        say=say,
    )
    found = looked.judged
    rungs = [RungResult("derivative", found.status, found.reason, found.numbers)]
    a, b = both.pictures()
    cause = None
    if found.status == "differ":
        say("looks for a cause")
        cause = likeliest(ours, a, b, both.margins(), partial(_at_half_size, scene, budget))
    rungs.append(theirs.adjoint(scene.resolved_sampler.spp))
    say(f"adjoint: {rungs[-1].status}")
    verdict, reason = decide(rungs, None)
    images = Images(a.mean(axis=0), b.mean(axis=0), standard_error(a, b))
    notes = (
        f"derivatives by {theirs.moving.path}, in W/sr/m2 per unit of it; in Mitsuba "
        f"{', '.join(theirs.moving.moved)} move with it",
        *ours.notes(),
    )
    return Case(
        scene=scene.name,
        verdict=verdict,
        reason=reason,
        rungs=tuple(rungs),
        metrics=None,
        seconds=both.seconds,
        images=images,
        notes=notes,
        sides=sides,
        cause=cause,
    )


def _at_half_size(scene: Scene, budget: Budget, replicates: int) -> tuple[FloatArray, FloatArray]:
    """Replicates of both sides with half as many pixels along each side."""
    asked, film = budget.derivative, scene.film
    assert asked is not None
    update = {"width": max(1, film.width // 2), "height": max(1, film.height // 2)}
    small = scene.changed(film=film.model_copy(update=update))
    theirs = _Theirs(small, asked.parameter, Differentiator(asked.integrator, asked.guiding))
    ours = Ours(small, asked.parameter, asked.step).replicates(replicates)
    return ours, np.stack(
        [theirs.picture(k, small.resolved_sampler.spp) for k in range(replicates)]
    )


class _Theirs:
    """Mitsuba's side.  Raises NoCounterpartError, ReferenceUnavailableError."""

    def __init__(self, scene: Scene, parameter: str, differentiator: Differentiator) -> None:
        plugin = differentiator.of(scene)
        self.moving = Moving(scene, parameter)
        self._integrator = mitsuba().load_dict(plugin)
        self._shape = scene.film.height, scene.film.width, 3

    def picture(self, seed: int, spp: int) -> FloatArray:
        return self.moving.forward(self._integrator, spp, seed)

    def adjoint(self, spp: int) -> RungResult:
        """The rung: sums of the derivative's pixels with random weights, by both modes with the
        same seeds.  They differ by the rounding of float32 alone, of as many terms as a picture has
        samples, whose errors are unrelated: the root of their number times half a unit."""
        rng = np.random.default_rng(0)
        worst, pairs = 0.0, []
        for k in range(WEIGHTINGS):
            weights = rng.random(self._shape)
            picture = self.picture(k, spp)
            forward = float((weights * picture).sum())
            reverse = self.moving.reverse(self._integrator, spp, k, weights)
            terms = spp * weights.size
            bound = math.sqrt(terms) * 2.0**-24 * float((weights * np.abs(picture)).sum())
            pairs.append((forward, reverse))
            apart = abs(forward - reverse)
            if apart > 0.0:
                worst = max(worst, apart / bound if bound else math.inf)
        numbers = {"forward": [p[0] for p in pairs], "reverse": [p[1] for p in pairs]}
        forward, reverse = pairs[0]
        told = f"forward mode {forward:.7g}, reverse mode {reverse:.7g}, with the same weights"
        if not math.isfinite(worst) or worst > 1.0:
            return RungResult("adjoint", "differ", f"the two modes differ: {told}", numbers)
        return RungResult("adjoint", "agree", f"{told} and random numbers", numbers)


class _Both:
    """The replicates of both sides."""

    def __init__(self, ours: Ours, theirs: _Theirs, scene: Scene, limit: float) -> None:
        self.most = most_kept(FIRST, 3 * scene.film.width * scene.film.height)
        self._pools = Pool(self.most, mean_picture), Pool(self.most, mean_picture)
        self._ours, self._theirs = ours, theirs
        self._spp, self._limit = scene.resolved_sampler.spp, limit
        self.seconds = {"candidate": {"render": 0.0}, "reference": {"render": 0.0}}

    def grow(self, count: int) -> None:
        """Make replicates until there are so many of each side."""
        start, (one, two) = time.perf_counter(), self._pools
        for picture in self._ours.replicates(count - len(one), len(one)):
            one.add(picture)
        between = time.perf_counter()
        for k in range(len(two), count):
            two.add(self._theirs.picture(k, self._spp))
        self.seconds["candidate"]["render"] += between - start
        self.seconds["reference"]["render"] += time.perf_counter() - between

    def pictures(self) -> tuple[FloatArray, FloatArray]:
        one, two = (np.stack(pool.pictures()) for pool in self._pools)
        return one, two

    def margins(self) -> Margins:
        """Those of float32, and what the step of our differences adds."""
        return margins(self._ours.truncation, side_of(self.pictures()[0], signed=True).size)

    def asked(self, level: float) -> int:
        """Replicates that a decision takes, by the noise."""
        kept = self.pictures()
        per = len(self._pools[0]) // len(kept[0])
        return per * replicates_asked(*kept, self._limit, level, signed=True)

    def look(self, level: float) -> RungResult:
        """The statistics of what there is."""
        found = margins(self._ours.truncation, side_of(self.pictures()[0], signed=True).size)
        if found.image >= self._limit:
            reason = f"the step of our differences is too large: it adds {found.image:.2%}"
            return RungResult("derivative", "inconclusive", f"{reason}; expected a smaller --step")
        one, two = self.pictures()
        if not one.any() and not two.any():
            reason = "no pixel changes on either side"
            return RungResult("derivative", "not-comparable", reason)
        return compare(one, two, limit=self._limit, margins=found, level=level, signed=True)


def margins(truncation: FloatArray, size: FloatArray) -> Margins:
    """Those of float32, and what the step of our differences adds, relative to the derivative's
    size;  truncation, size (height, width, 3)."""
    usual = Margins()
    mean = float(np.abs(size.mean(axis=(0, 1))).max())
    if not mean:
        return usual
    of_image = float(np.abs(truncation.mean(axis=(0, 1))).max()) / mean
    return Margins(
        image=usual.image + of_image,
        tile=usual.tile + of_image,
        pixel=usual.pixel + of_image,
        constant=usual.constant + of_image,
    )
