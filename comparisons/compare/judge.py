"""From the evidence about a case to its verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from comparisons import statistics
from comparisons.compare import diagnosis
from comparisons.compare.darkness import Darkness, lit, plain
from comparisons.compare.diagnosis.brightness import LITTLE
from comparisons.compare.looks import Looks
from comparisons.compare.path_length import Lengths
from comparisons.results.case import (
    Case,
    Cause,
    FloatArray,
    ImageRegion,
    Images,
    Metrics,
    RungResult,
    Status,
    decide,
)
from comparisons.rungs.images import images_rung
from comparisons.rungs.input import input_rung
from comparisons.rungs.limited import Rest, limited
from comparisons.rungs.witness import Witness
from comparisons.statistics.metrics import image_metrics, nonfinite_pixels

Lights = Callable[[], Mapping[str, FloatArray]]
"""Returns the reference's pictures of single lights (height, width, 3) by name; renders them."""


Pair = tuple[FloatArray, FloatArray]
"""Replicates of both sides, two or more of each."""

RayStarts = Callable[[RungResult, Pair], tuple[RungResult, Pair | None]]
"""Returns the result of the statistics of replicates, in which they differ, or one that explains
it, and the replicates without what explains it; renders pictures."""


Replicates = tuple[FloatArray, FloatArray | statistics.Known]
"""Of each side (replicates, height, width, 3), one or more; or the reference's known mean."""


def _deterministic() -> RungResult:
    return RungResult("statistics", "not-applicable", "deterministic: there is no noise")


@dataclass(frozen=True)
class Rendered:
    """What is compared.

    images: the two pictures;  seconds: wall clock by side and step;  replicates: of noisy pictures,
    whose means the images are;  checked, tested: the rungs `input` and `statistics` of these, if
    they are known already;  still: the rung `statistics` of pictures without noise;
    fixed_reference, paired: as in `statistics.compare`.
    """

    images: Images
    seconds: dict[str, dict[str, float]] = field(default_factory=dict)
    replicates: Replicates | None = None
    notes: tuple[str, ...] = ()
    checked: RungResult | None = None
    tested: RungResult | None = None
    still: Callable[[], RungResult] = _deterministic
    fixed_reference: bool = False
    paired: bool = False

    @property
    def resampled(self) -> Pair | None:
        """The replicates that show the noise of each side's mean; None if they do not.  A reference
        whose variance is known is two replicates that have exactly its mean and its variance."""
        if self.replicates is None or len(self.replicates[0]) < 2:
            return None
        candidate, reference = self.replicates
        if self.paired and not isinstance(reference, statistics.Known):
            candidate, reference = statistics.differences(candidate, reference)
        if isinstance(reference, statistics.Known):
            deviation = np.sqrt(reference.variance)
            return candidate, np.stack([reference.mean + deviation, reference.mean - deviation])
        return (candidate, reference) if len(reference) > 1 else None


def of_replicates(
    candidate: FloatArray,
    reference: FloatArray | statistics.Known,
    seconds: dict[str, dict[str, float]],
) -> Rendered:
    """The means of replicates (replicates, height, width, 3) and the standard error of their
    difference."""
    mean = reference.mean if isinstance(reference, statistics.Known) else reference.mean(axis=0)
    error = None
    if candidate.shape[1:] == mean.shape:
        error = statistics.standard_error(candidate, reference)
    own = None
    if isinstance(reference, statistics.Known):
        own = np.sqrt(reference.variance)
    elif len(reference) > 1:
        own = reference.std(axis=0, ddof=1) / np.sqrt(len(reference))
    images = Images(candidate.mean(axis=0), mean, error, reference_error=own)
    return Rendered(images, seconds, (candidate, reference))


@dataclass(frozen=True)
class Evidence:
    """The input of a verdict.  name: the case's;  rungs: the deterministic ones;  rendered: the
    pictures of both sides, if any;  lights, lengths: for the diagnosis;  looks: those at a growing
    number of replicates, the last of which gives the statistics;  ray_starts: see
    `comparisons.compare.ray_starts`, None where they cannot matter;  rest_of: see
    `comparisons.compare.precision`;  witness: a third renderer;  darkness: why pictures may be
    black, None where nothing is known of the scene;  the rest as in `Case`."""

    name: str
    rungs: tuple[RungResult, ...]
    rendered: Rendered | None
    seconds: Mapping[str, Mapping[str, float]]
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    sides: tuple[str, str] = ("ours", "Mitsuba's")
    lights: Lights | None = None
    lengths: Lengths | None = None
    looks: Looks | None = None
    ray_starts: RayStarts | None = None
    rest_of: Callable[[Rendered, float], Rest] | None = None
    witness: Witness | None = None
    darkness: Darkness | None = None


def judge(evidence: Evidence, limit: float) -> Case:
    """The verdict over all rungs; for a difference also its likeliest cause and the worst places.

    limit: the smallest relative bias of the image mean that must be detectable.
    """
    rungs, rendered = list(evidence.rungs), evidence.rendered
    metrics, images, without, notes = None, None, None, evidence.notes
    if rendered is not None:
        checked, *tested = picture_rungs(rendered, limit, evidence.looks)
        checked = lit(checked, rendered.images, evidence.darkness)
        notes += plain(rendered.images)
        decided = any(rung.status in ("differ", "invalid") for rung in [*rungs, checked])
        if evidence.ray_starts and not decided and tested[0].status == "differ":
            assert rendered.resampled is not None
            found, without = evidence.ray_starts(tested[0], rendered.resampled)
            tested = [found]
        rungs += [checked, *tested]
        images = rendered.images
        if checked.status != "invalid":
            metrics = image_metrics(images)
            rungs.append(_whole(rendered, metrics, tested[0], without))
            pair = rendered.resampled
            if rendered.replicates is None:
                pair = images.candidate[np.newaxis], images.reference[np.newaxis]
            if evidence.witness is not None and pair is not None:
                heard, others = evidence.witness(pair, evidence.sides)
                rungs.append(heard)
                images = replace(images, others=others)
    rest_of = None
    if rendered is not None and evidence.rest_of is not None:
        rest_of = partial(evidence.rest_of, rendered)
    rungs = limited(rungs, rest_of)
    verdict, reason = decide(rungs, metrics)
    cause: Cause | None = None
    worst: tuple[ImageRegion, ...] = ()
    if verdict == "differ":
        cause = diagnosis.of_rungs(rungs)
        if rendered is not None and metrics is not None:
            cause = cause or likeliest_cause(rendered.images, evidence.lights, evidence.lengths)
            worst = statistics.worst_regions(*_means_tested(rendered))
    return Case(
        scene=evidence.name,
        verdict=verdict,
        reason=_with_vote(verdict, reason, rungs),
        rungs=tuple(rungs),
        metrics=metrics,
        seconds={side: dict(times) for side, times in evidence.seconds.items()},
        images=images,
        notes=notes,
        sides=evidence.sides,
        cause=cause,
        worst=worst,
        left_out=evidence.left_out,
    )


def _with_vote(verdict: Status, reason: str, rungs: Sequence[RungResult]) -> str:
    """The reason of a verdict, with who of three renderers stands alone: a difference of two says
    that one is wrong, the third says which; and, whatever the verdict, that witnesses disagree."""
    told = ("disagree",) if verdict == "agree" else ("alone", "disagree")
    said = next((r.reason for r in rungs if any(name in r.numbers for name in told)), "")
    return reason if said in reason else f"{reason}; {said}"


def picture_rungs(rendered: Rendered, limit: float, looks: Looks | None = None) -> list[RungResult]:
    """The rungs `input` and `statistics`; of an invalid input the latter only if a difference is
    certain even so.  looks: were taken already, the last at these pictures."""
    checked = rendered.checked or check(rendered)
    if checked.status == "invalid":
        return [checked, *_despite(rendered, limit)]
    return [checked, _tested(rendered, limit) if looks is None else looks.judged]


def check(rendered: Rendered) -> RungResult:
    """The rung `input`."""
    if rendered.replicates is None:
        return input_rung(rendered.images.candidate, rendered.images.reference)
    candidate, reference = rendered.replicates
    return input_rung(
        candidate, reference.mean if isinstance(reference, statistics.Known) else reference
    )


def at_look(rendered: Rendered, limit: float, level: float) -> RungResult:
    """The rung `statistics` of one of several looks, or the fault of the input if that was checked.

    level: the share of the levels that this look may use.
    """
    if rendered.checked is not None and rendered.checked.status == "invalid":
        return rendered.checked
    return _tested(rendered, limit, level)


def _tested(rendered: Rendered, limit: float, level: float = 1.0) -> RungResult:
    if rendered.tested is not None:
        return rendered.tested
    if rendered.replicates is None:
        return rendered.still()
    how: dict[str, Any] = {"fixed_reference": rendered.fixed_reference}
    if rendered.paired:
        how = {"paired": True, "margins": statistics.PAIRED}
    return statistics.compare(*rendered.replicates, limit=limit, level=level, **how)


def _whole(
    rendered: Rendered, metrics: Metrics, tested: RungResult, without: Pair | None
) -> RungResult:
    """The rung `images`;  tested: the rung `statistics`;  without: the replicates without what
    explains their difference there."""
    if tested.status == "agree" and "edge" in tested.numbers:
        return RungResult("images", "not-applicable", _EACH_PIXEL)
    if rendered.replicates is not None and rendered.resampled is None:
        return RungResult("images", "not-applicable", _UNKNOWN_NOISE)
    found = images_rung(rendered.images, metrics, rendered.resampled)
    if without is None or found.status != "differ":
        return found
    images = Images(*(side.mean(axis=0) for side in without))
    rest = images_rung(images, image_metrics(images), without)
    if rest.status == "differ":
        return replace(rest, reason=f"{found.reason}; {_WITHOUT}: {rest.reason}")
    reason = f"{tested.reason}; {_WITHOUT} the pictures agree; {found.reason}"
    return replace(found, status="reference-limited", reason=reason)


_WITHOUT = "without what explains the difference of the statistics"
_EACH_PIXEL = "each pixel is judged: metrics of the whole do not forgive edges"
_UNKNOWN_NOISE = "the noise of a single picture is unknown"


def _means_tested(rendered: Rendered) -> Replicates:
    """The replicates; of pictures without noise one each."""
    images = rendered.images
    if rendered.paired and rendered.resampled is not None:
        return rendered.resampled
    return rendered.replicates or (images.candidate[np.newaxis], images.reference[np.newaxis])


def _despite(rendered: Rendered, limit: float) -> list[RungResult]:
    """The statistics of invalid pictures, if a bias is certain nevertheless; else nothing.

    The noise of replicates that depend on each other is not known from their spread: the mean of
    the candidate's counts as a single picture.  Pixels that are not finite are left out.
    """
    if rendered.replicates is None:
        return []
    candidate, reference = rendered.replicates
    try:
        a, b = statistics.read(candidate, reference, finite=False)
    except ValueError:  # other sizes or channels
        return []
    bad = [nonfinite_pixels(candidate)]
    if not isinstance(reference, statistics.Known):
        bad.append(nonfinite_pixels(reference))
    finite = np.expand_dims(~np.concatenate(bad).any(axis=0), -1)
    mean = np.where(finite, a.mean(axis=0), 0.0)
    is_lit = (b.mean if isinstance(b, statistics.Known) else b).any()
    if not (is_lit and np.ptp(mean) > 0.0):
        return []  # black or constant, which was said already
    if isinstance(b, statistics.Known):
        b = statistics.Known(np.where(finite, b.mean, 0.0), np.where(finite, b.variance, 0.0))
    else:
        b = np.where(finite, b, 0.0)
    tested = statistics.compare(mean[np.newaxis], b, limit=limit)
    return [tested] if tested.status == "differ" else []


def likeliest_cause(
    images: Images, lights: Lights | None, lengths: Lengths | None = None
) -> Cause | None:
    """The likeliest cause of a difference; single lights, and paths of other lengths, are rendered
    only if needed."""
    # The fits' matrices are small: on two cores, threads of BLAS that wait for each other busily
    # took four times the CPU time and three times as long (2026-11-28).
    with threadpool_limits(1, user_api="blas"):
        fits = diagnosis.Fits(images)
        plain = diagnosis.likeliest(images, fits=fits)
        is_dark = images.candidate.mean() <= LITTLE * images.reference.mean()
        if diagnosis.is_sure(plain) and not is_dark:
            return plain
        if lights is None and lengths is None:
            return plain
        singles = {} if lights is None else lights()
        if lengths is None:
            return diagnosis.likeliest(images, singles, fits=fits)
        return diagnosis.likeliest(images, singles, lengths, fits)
