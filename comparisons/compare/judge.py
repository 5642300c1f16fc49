"""From the evidence about a case to its verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from comparisons import statistics
from comparisons.compare import diagnosis
from comparisons.compare.diagnosis.brightness import LITTLE
from comparisons.compare.looks import Looks
from comparisons.compare.path_length import Lengths
from comparisons.results.case import (
    Case,
    Cause,
    FloatArray,
    ImageRegion,
    Images,
    RungResult,
    Status,
    decide,
)
from comparisons.results.rungs import RUNGS
from comparisons.rungs.images import images_rung
from comparisons.rungs.input import input_rung
from comparisons.rungs.limited import limited
from comparisons.rungs.witness import Witness
from comparisons.statistics.metrics import image_metrics, nonfinite_pixels

Lights = Callable[[], Mapping[str, FloatArray]]
"""Returns the reference's pictures of single lights (height, width, 3) by name; renders them."""


RayStarts = Callable[[RungResult, tuple[FloatArray, FloatArray]], RungResult]
"""Returns the result of the statistics of both sides' replicates, in which they differ, or one that
explains it; renders pictures."""


@dataclass(frozen=True)
class Rendered:
    """images: the two pictures;  seconds: wall clock by side and step;  replicates: for noisy
    pictures, the replicates (replicates, height, width, 3) of each side whose means they are;
    checked: the rung `input` of these, if a look has it already."""

    images: Images
    seconds: dict[str, dict[str, float]] = field(default_factory=dict)
    replicates: tuple[FloatArray, FloatArray] | None = None
    notes: tuple[str, ...] = ()
    checked: RungResult | None = None


def of_replicates(
    candidate: FloatArray, reference: FloatArray, seconds: dict[str, dict[str, float]]
) -> Rendered:
    """The means of replicates (replicates, height, width, 3) and the standard error of their
    difference."""
    if candidate.shape[1:] == reference.shape[1:]:
        error = statistics.standard_error(candidate, reference)
    else:
        error = None
    means = Images(candidate.mean(axis=0), reference.mean(axis=0), error)
    return Rendered(means, seconds, (candidate, reference))


@dataclass(frozen=True)
class Evidence:
    """The input of a verdict.  name: the case's;  rungs: the deterministic ones;  rendered: the
    pictures of both sides, if any;  lights, lengths: for the diagnosis;  looks: those at a growing
    number of replicates, the last of which gives the statistics;  ray_starts: see
    `comparisons.compare.ray_starts`, None where they cannot matter;  witness: a third renderer;
    the rest as in `Case`."""

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
    witness: Witness | None = None


def judge(evidence: Evidence, limit: float) -> Case:
    """The verdict over all rungs; for a difference also its likeliest cause and the worst places.

    limit: the smallest relative bias of the image mean that must be detectable.
    """
    rungs, rendered = list(evidence.rungs), evidence.rendered
    metrics, images = None, None
    if rendered is not None:
        found = picture_rungs(rendered, limit, looks=evidence.looks)
        decided = any(rung.status in ("differ", "invalid") for rung in [*rungs, *found[:-1]])
        if evidence.ray_starts and found[-1].status == "differ" and not decided:
            assert rendered.replicates is not None
            found[-1] = evidence.ray_starts(found[-1], rendered.replicates)
        rungs += found
        images = rendered.images
        if not any(rung.status == "invalid" for rung in rungs):
            metrics = image_metrics(images)
            rungs.append(images_rung(images, metrics, rendered.replicates))
            if evidence.witness is not None and rendered.replicates is not None:
                heard, picture = evidence.witness(rendered.replicates, evidence.sides)
                rungs.append(heard)
                images = replace(images, witness=picture)
    rungs = limited(rungs)
    verdict, reason = decide(rungs, metrics)
    reason = with_vote(verdict, reason, rungs)
    cause: Cause | None = None
    worst: tuple[ImageRegion, ...] = ()
    if verdict == "differ":
        cause = diagnosis.of_rungs(rungs)
        if rendered is not None and metrics is not None:
            cause = cause or likeliest_cause(rendered.images, evidence.lights, evidence.lengths)
            worst = _places(rendered)
    return Case(
        scene=evidence.name,
        verdict=verdict,
        reason=reason,
        rungs=tuple(sorted(rungs, key=lambda rung: RUNGS.index(rung.name))),
        metrics=metrics,
        seconds={side: dict(times) for side, times in evidence.seconds.items()},
        images=images,
        notes=evidence.notes,
        sides=evidence.sides,
        cause=cause,
        worst=worst,
        left_out=evidence.left_out,
    )


def with_vote(verdict: Status, reason: str, rungs: Sequence[RungResult]) -> str:
    """The reason of a verdict, with who of three renderers stands alone: a difference of two says
    that one is wrong, the third says which."""
    said = next((rung.reason for rung in rungs if "alone" in rung.numbers), "")
    return reason if verdict == "agree" or said in reason else f"{reason}; {said}"


def picture_rungs(
    rendered: Rendered, limit: float, level: float = 1.0, looks: Looks | None = None
) -> list[RungResult]:
    """The rungs `input` and, for noisy pictures that are valid, `statistics`.

    level: as in `statistics.compare`;  looks: were taken already, the last at these pictures.
    """
    if rendered.replicates is None:
        images = rendered.images
        checked = input_rung(images.candidate, images.reference)
        return [
            checked,
            RungResult("statistics", "not-applicable", "deterministic: there is no noise"),
        ]
    checked = rendered.checked or input_rung(*rendered.replicates)
    if checked.status == "invalid":
        return [checked, *despite(*rendered.replicates, limit)]
    if looks is not None:
        return [checked, looks.judged]
    return [checked, statistics.compare(*rendered.replicates, limit=limit, level=level)]


def despite(
    candidate: FloatArray, reference: "FloatArray | statistics.Known", limit: float
) -> list[RungResult]:
    """The statistics of invalid pictures, if a bias is certain nevertheless; else nothing.

    The noise of replicates that depend on each other is not known from their spread: the mean of
    the candidate's counts as a single picture.  Pixels that are not finite are left out.
    """
    try:
        a, b = statistics.read(candidate, reference, finite=False)
    except ValueError:  # other sizes or channels
        return []
    judges = b.mean[np.newaxis] if isinstance(b, statistics.Known) else b
    bad = [nonfinite_pixels(candidate)]
    if not isinstance(reference, statistics.Known):
        bad.append(nonfinite_pixels(reference))
    finite = np.expand_dims(~np.concatenate(bad).any(axis=0), -1)
    mean = np.where(finite, a.mean(axis=0), 0.0)
    if not (judges.any() and np.ptp(mean) > 0.0):
        return []  # black or constant, which was said already
    if isinstance(b, statistics.Known):
        judge: FloatArray | statistics.Known = statistics.Known(
            np.where(finite, b.mean, 0.0), np.where(finite, b.variance, 0.0)
        )
    else:
        judge = np.where(finite, b, 0.0)
    found = statistics.compare(mean[np.newaxis], judge, limit=limit)
    return [found] if found.status == "differ" else []


def likeliest_cause(
    images: Images, lights: Lights | None, lengths: Lengths | None = None
) -> Cause | None:
    """The likeliest cause of a difference; single lights, and paths of other lengths, are rendered
    only if needed."""
    plain = diagnosis.likeliest(images)
    is_dark = images.candidate.mean() <= LITTLE * images.reference.mean()
    is_sure = plain is not None and plain.explained > SURE and not is_dark
    if plain is not None and is_sure and plain.name not in diagnosis.FLEXIBLE:
        return plain
    if lights is None and lengths is None:
        return plain
    singles = {} if lights is None else lights()
    return diagnosis.likeliest(images, singles, *([] if lengths is None else [lengths]))


SURE = 0.995
"""The fraction of the squared difference that a cause must explain for others not to be rendered.
If nearly all light is lost, a gain near 0 explains 0.99 of it (measured: a ball under a sky)."""


def _places(rendered: Rendered) -> tuple[ImageRegion, ...]:
    if rendered.replicates is not None:
        return statistics.worst_regions(*rendered.replicates)
    images = rendered.images
    return statistics.worst_regions(images.candidate[np.newaxis], images.reference[np.newaxis])
