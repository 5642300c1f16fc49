"""Whether Mitsuba's derivative of a picture is that of the picture: the case of a scene, one of its
parameters, and one of Mitsuba's integrators that differentiate.

Ours are differences of whole pictures (`reference_rt.rendering.derivative`): they see every edge
that moves, know nothing of sampling, weights or adjoints, and nothing of Mitsuba.  So ours are the
reference here, and Mitsuba's the candidate.  The statistics are those of pictures, of values of
both signs.  Rung `adjoint`: forward and reverse mode must give the same number for the same random
numbers, <J v, w> = <v, J^T w>, whatever is right.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.derivative_causes import (
    A_FACTOR,
    EDGES,
    Ours,
    explained,
    factor_of,
    is_same,
    likeliest,
)
from comparisons.compare.looks import FIRST, Pool, mean_picture, most_kept, until_decided
from comparisons.lights import type_of
from comparisons.mitsuba.backend import mitsuba
from comparisons.renderers import NoCounterpartError
from comparisons.results.case import Case, Cause, Images, RungResult, decide
from comparisons.statistics import Known, replicates_asked, standard_error
from comparisons.statistics.cells import Margins
from comparisons.statistics.decide import compare
from comparisons.statistics.sides import side_of
from comparisons.translator.derivative import PROJECTIVE, Differentiator, Moving
from comparisons.translator.reference import inexact
from reference_rt.cameras.perspective import Perspective
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError, UsageError

PILOTS = 4
"""Pictures of each side that show which is noisier, and are not used again."""

MOST_TIMES = 64
"""Times as many samples that the noisier side has at most."""

NEAR = 4.0
"""Standard deviations of a sum that counts as right."""

MOST_TERMS = 1 << 14
"""Samples of all pixels and channels together that the rung `adjoint` sums: so rounding is at most
a thousandth."""

DEAR = 16
"""Times as many samples of an integrator whose pictures cost as much with few as with many."""

WIDE = 20.0
"""Degrees of a view that is wide enough for the octree of edges: there all of the derivative was
left, of one of 2 degrees three quarters (`findings/mitsuba-projective-narrow-view.sh`)."""

PILOT_SEED = 1 << 24
"""Of these pictures: far from those of the others."""


def derivative_case(
    scene: Scene, budget: Budget, say: Callable[[str], None], threads: int | None = None
) -> Case:
    """The verdict on Mitsuba's derivative by `budget.derivative`, of a scene that has the budget's
    size and samples.  Raises UsageError, SceneError, ReferenceUnavailableError."""
    asked = budget.derivative
    assert asked is not None
    differentiator = Differentiator(asked.integrator, asked.guiding)
    sides = (f"Mitsuba's ({differentiator.words})", "ours")
    whole, scene = scene, differentiator.seen_of(scene)
    try:
        theirs = _Theirs(scene, asked.parameter, differentiator)
        adjoint = theirs.adjoint()  # Mitsuba refuses before any work of ours
    except NoCounterpartError as error:
        rung = RungResult("derivative", "not-comparable", str(error))
        verdict, reason = decide([rung], None)
        return Case(scene.name, verdict, reason, (rung,), None, {}, sides=sides)
    say(f"adjoint: {adjoint.status}")
    ours = Ours(scene, asked.parameter, asked.step, threads)
    both = _Both(theirs, ours, budget.limit, budget.seconds)
    if budget.seconds is None:
        both.grow(budget.replicates)
        found = both.look(1.0)
    else:
        looked = until_decided(
            both.grow,
            both.look,
            seconds=budget.seconds,
            first=max(FIRST, budget.replicates),
            most=both.most,
            asked=both.asked,
            say=say,
        )
        found = looked.judged
    wrong, right = both.pictures()
    numbers = found.numbers | {"candidate_error": _error(wrong, right)}
    rungs = [RungResult("derivative", found.status, found.reason, numbers)]
    cause = None
    if found.status == "differ":
        say("looks for a cause")
        half = partial(_at_half_size, scene, budget, ours.times)
        cause = likeliest(ours, right, wrong, both.margins(), half)
        if differentiator.name in PROJECTIVE and (cause is None or cause.name in (A_FACTOR, EDGES)):
            limits = _Limits(ours, differentiator, both.margins())
            cause = limits.likeliest(right, wrong) or cause
    rungs.append(adjoint)
    if adjoint.status == "differ":
        cause = _wrong_mode(adjoint, right, ours.times * scene.resolved_sampler.spp) or cause
    verdict, reason = decide(rungs, None)
    notes = (
        f"derivatives by {theirs.moving.path}, in W/sr/m2 per unit of it; in Mitsuba "
        f"{', '.join(theirs.moving.moved)} move with it",
        *ours.notes(),
        *(
            [f"both sides have direct light alone (max_depth 2), as {differentiator.name} has"]
            if scene is not whole
            else []
        ),
        *(
            f"Mitsuba's own {plugin} is differentiated, while a comparison of pictures says: {note}"
            for plugin, note in dict.fromkeys(inexact(scene))
        ),
    )
    return Case(
        scene=scene.name,
        verdict=verdict,
        reason=reason,
        rungs=tuple(rungs),
        metrics=None,
        seconds=both.seconds,
        images=Images(wrong.mean(axis=0), right.mean(axis=0), standard_error(wrong, right)),
        notes=notes,
        sides=sides,
        cause=cause,
    )


def _error(wrong: FloatArray, right: FloatArray) -> float | None:
    """The standard error of the candidate's image mean, over the derivative's size, in the noisiest
    channel; None where nothing changes."""
    size = side_of(right, signed=True).size.mean(axis=(0, 1))
    means = wrong.mean(axis=(1, 2))
    errors = means.std(axis=0, ddof=1) / math.sqrt(len(means))
    seen = size > 0.0
    return float((errors[seen] / size[seen]).max()) if seen.any() else None


def _at_half_size(scene: Scene, budget: Budget, times: int) -> tuple[FloatArray, FloatArray]:
    """Replicates of ours and of Mitsuba's with half as many pixels along each side;  times: as of
    `Ours`."""
    asked, film = budget.derivative, scene.film
    assert asked is not None
    update = {"width": max(1, film.width // 2), "height": max(1, film.height // 2)}
    small = scene.changed(film=film.model_copy(update=update))
    theirs = _Theirs(small, asked.parameter, Differentiator(asked.integrator, asked.guiding))
    ours = Ours(small, asked.parameter, asked.step)
    ours.times = times
    return ours.replicates(FIRST), theirs.replicates(FIRST)


class _Limits:
    """What Mitsuba's integrators that sample edges cannot do: each is a cause where there is no
    difference without it, and as large a one would be seen."""

    def __init__(self, ours: Ours, by: Differentiator, margins: Margins) -> None:
        self._ours, self._by, self._margins = ours, by, margins

    def likeliest(self, right: FloatArray, wrong: FloatArray) -> Cause | None:
        """right, wrong: replicates of both sides."""
        try:
            return self._of_points(right, wrong) or self._of_view(right, wrong)
        except (NoCounterpartError, UsageError, SceneError):  # a scene that lacks the parameter
            return None

    def _of_points(self, right: FloatArray, wrong: FloatArray) -> Cause | None:
        """Edges are found by rays that scatter, and no ray finds a lamp without extent."""
        scene = self._ours.scene
        points = [f"lights[{k}]" for k, x in enumerate(scene.lights) if type_of(x).has_no_extent]
        others = tuple(x for x in scene.lights if not type_of(x).has_no_extent)
        if not points:
            return None
        rest = scene.changed(lights=others)
        part = self._without(rest, lambda x: x + (wrong.mean(axis=0) - right.mean(axis=0)))
        if part is None:
            return None
        told = f"without {', '.join(points)} there is no difference"
        return Cause("edges of shadows of lamps without extent are left out", told, part)

    def _of_view(self, right: FloatArray, wrong: FloatArray) -> Cause | None:
        """Few of the samples that an octree of edges is built of fall into what a narrow view sees.
        A wide one has as many pixels."""
        camera = self._ours.scene.camera
        if not isinstance(camera, Perspective) or camera.fov is None or camera.fov >= WIDE:
            return None
        factor, error = factor_of(right, wrong)
        if not self._by.is_dear or not math.isfinite(error):
            return None
        wide = self._ours.scene.changed(camera=camera.model_copy(update={"fov": WIDE}))
        part = self._without(wide, lambda x: factor * x)
        if part is None:
            return None
        told = (
            f"of {camera.fov:g} degrees: {factor:.2g} of the derivative is left; with {WIDE:g} "
            "degrees there is no difference"
        )
        return Cause("a view too narrow for the guiding", told, part)

    def _without(self, scene: Scene, fault: Callable[[FloatArray], FloatArray]) -> float | None:
        """Of a scene in which there is no difference: the part of what `fault` would make of ours
        that is gone; None if there is a difference, or if that of the fault would not be seen."""
        theirs = _Theirs(scene, self._ours.path, self._by)
        seen, right = theirs.replicates(FIRST), self._ours.of(scene, FIRST)
        if not is_same(right, seen, self._margins) or is_same(fault(right), seen, self._margins):
            return None
        return explained(right, fault(right), seen)


class _Theirs:
    """Mitsuba's side.  times: as many samples as the scene has, times this.  Raises
    NoCounterpartError, ReferenceUnavailableError."""

    def __init__(self, scene: Scene, parameter: str, differentiator: Differentiator) -> None:
        plugin = differentiator.of(scene)
        self.moving = Moving(scene, parameter)
        self.times = DEAR if differentiator.is_dear else 1
        self._spp = scene.resolved_sampler.spp
        self._integrator = mitsuba().load_dict(plugin)
        self._shape = scene.film.height, scene.film.width, 3

    def picture(self, seed: int) -> FloatArray:
        """One replicate."""
        return self.moving.forward(self._integrator, self.times * self._spp, seed)

    def replicates(self, count: int) -> FloatArray:
        """So many."""
        return np.stack([self.picture(k) for k in range(count)])

    def adjoint(self) -> RungResult:
        """The rung: the sum of the derivative's pixels with random weights, by both modes with the
        same seed.  They differ by the rounding of float32 alone: half a unit for each term, since
        terms that are alike round alike.  So there are few samples, of some pixels."""
        weights = _weights(self._shape)
        terms = np.count_nonzero(weights) * (spp := _adjoint_spp(self._shape))
        picture = self.moving.forward(self._integrator, spp, 0)
        forward = float((weights * picture).sum())
        reverse = self.moving.reverse(self._integrator, spp, 0, weights)
        bound = terms * 2.0**-24 * float((weights * np.abs(picture)).sum())
        numbers = {"forward": forward, "reverse": reverse, "bound": bound}
        told = f"forward mode {forward:.7g}, reverse mode {reverse:.7g}, with the same weights"
        if not abs(forward - reverse) <= bound:
            return RungResult("adjoint", "differ", f"the two modes differ: {told}", numbers)
        return RungResult("adjoint", "agree", f"{told} and random numbers", numbers)


def _weights(shape: tuple[int, ...]) -> FloatArray:
    """Random ones from 0 to 1, always the same; 0 but for MOST_TERMS of them, at random."""
    rng = np.random.default_rng(0)
    weights = rng.random(shape)
    share = MOST_TERMS / weights.size
    return weights if share >= 1.0 else np.where(rng.random(shape) < share, weights, 0.0)


def _adjoint_spp(shape: tuple[int, ...]) -> int:
    """Samples per pixel of the rung `adjoint`."""
    return max(1, MOST_TERMS // math.prod(shape))


def _wrong_mode(adjoint: RungResult, right: FloatArray, spp: int) -> Cause | None:
    """Which of the two modes ours say is wrong: the one whose sum is not theirs, if the other one's
    is.  Each of Mitsuba's is of one picture of few samples;  spp: of each of ours, to which its
    noise is scaled."""
    shape = right.shape[1:]
    sums = (_weights(shape) * right).sum(axis=(1, 2, 3))
    scale = spp / _adjoint_spp(shape) + 1.0 / len(sums)
    mean, noise = float(sums.mean()), float(sums.std(ddof=1)) * math.sqrt(scale)
    apart = {mode: abs(adjoint.numbers[mode] - mean) for mode in ("forward", "reverse")}
    near = [mode for mode, distance in apart.items() if distance <= NEAR * noise]
    if len(near) != 1:
        return None
    (wrong,) = apart.keys() - near
    told = f"with the same weights ours is {mean:.7g} ± {noise:.2g}, as {near[0]} mode says"
    return Cause(f"{wrong} mode is wrong", told, 1.0)


class _Both:
    """The replicates of both sides."""

    def __init__(self, theirs: _Theirs, ours: Ours, limit: float, seconds: float | None) -> None:
        """seconds: that a decision should take; None: any number."""
        film = ours.scene.film
        self._allowed = seconds or math.inf
        self.most = most_kept(FIRST, 3 * film.width * film.height)
        self._pools = Pool(self.most, mean_picture), Pool(self.most, mean_picture)
        self._theirs, self._ours, self._limit = theirs, ours, limit
        self.seconds = {"candidate": {"render": 0.0}, "reference": {"render": 0.0}}

    def grow(self, count: int) -> None:
        """Make replicates until there are so many of each side."""
        theirs, ours = self._pools
        if not len(ours):
            self._balance()
        start = time.perf_counter()
        for k in range(len(theirs), count):
            theirs.add(self._theirs.picture(k))
        between = time.perf_counter()
        for picture in self._ours.replicates(count - len(ours), len(ours)):
            ours.add(picture)
        self.seconds["candidate"]["render"] += between - start
        self.seconds["reference"]["render"] += time.perf_counter() - between

    def _balance(self) -> None:
        """Give the noisier side more samples, since edges that move make noise in our differences,
        and hardly any where they are sampled: as far as the first look's pictures take no longer
        than is allowed."""
        start = time.perf_counter()
        theirs = np.stack([self._theirs.picture(PILOT_SEED + k) for k in range(PILOTS)])
        between = time.perf_counter()
        ours = self._ours.of(self._ours.scene, PILOTS, seed=PILOT_SEED)
        taken = between - start, time.perf_counter() - between
        most = [self._allowed / (max(seconds, 1e-3) * FIRST / PILOTS) for seconds in taken]
        of_theirs, of_ours = (float(side.var(axis=0, ddof=1).sum()) for side in (theirs, ours))
        if of_theirs and of_ours:
            more = 2.0 ** round(math.log2(of_ours / of_theirs))
            self._ours.times = int(min(max(more, 1.0), MOST_TIMES, max(most[1], 1.0)))
            self._theirs.times *= int(min(max(1.0 / more, 1.0), MOST_TIMES, max(most[0], 1.0)))

    def pictures(self) -> tuple[FloatArray, FloatArray]:
        """Mitsuba's, and ours."""
        theirs, ours = (np.stack(pool.pictures()) for pool in self._pools)
        return theirs, ours

    def margins(self) -> Margins:
        """Those of float32, and what the step of our differences adds."""
        return margins(self._ours.truncation, side_of(self.pictures()[1], signed=True).size)

    def asked(self, level: float) -> int:
        """Replicates that a decision takes, by the noise."""
        kept = self.pictures()
        per = len(self._pools[0]) // len(kept[0])
        return per * replicates_asked(*kept, self._limit, level, signed=True)

    def look(self, level: float) -> RungResult:
        """The statistics of what there is."""
        theirs, ours = self.pictures()
        return judged(theirs, ours, self._limit, self.margins(), level)


def judged(
    wrong: FloatArray, right: FloatArray | Known, limit: float, allowed: Margins, level: float = 1.0
) -> RungResult:
    """The rung: the statistics of derivatives (replicates, height, width, 3);  limit, level: as of
    `statistics.compare`."""
    exact = right.mean if isinstance(right, Known) else right
    if not wrong.any() and not exact.any():
        return RungResult("derivative", "not-comparable", "no pixel changes on either side")
    seen = max(limit, 2.0 * allowed.image)
    found = compare(wrong, right, limit=seen, margins=allowed, level=level, signed=True)
    found = replace(found, name="derivative")
    if found.status == "agree" and seen > limit:
        reason = f"what the step adds is not known better than to {seen:.2%}; {found.reason}"
        numbers = found.numbers | {"step_adds": seen}
        return replace(found, status="inconclusive", reason=reason, numbers=numbers)
    return found


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
