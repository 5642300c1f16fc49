"""The gate: another renderer's pictures against a reference, rung by rung."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from comparisons import statistics
from comparisons.compare import diagnosis
from comparisons.compare.diagnosis.misfit import Hypothesis
from comparisons.compare.judge import Lights, despite, likeliest_cause, with_vote
from comparisons.compare.looks import Looks, level_of
from comparisons.compare.path_length import Lengths
from comparisons.gate.digest import Copies
from comparisons.gate.edges import Edges, edges_rung
from comparisons.gate.pictures_in import Picture
from comparisons.gate.reference import Reference, check_sizes, size_of, stacked
from comparisons.gate.rim import without_rim, without_rim_later
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
from comparisons.rungs.witness import Witness
from comparisons.statistics.metrics import image_metrics
from comparisons.statistics.scales import TILE, cell_pixels, cell_sums
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import ImageError, UsageError

LIMIT = 0.005
"""The smallest relative bias of the image mean that must be detectable."""

_NO_NOISE = "the scene is rendered without random numbers: there is no noise"
_EACH_PIXEL = "each pixel is judged: metrics of the whole do not forgive edges"
_UNKNOWN_NOISE = "the noise of a single picture is unknown"


def gate_pictures(
    candidates: Sequence[Picture],
    reference: Reference,
    *,
    limit: float = LIMIT,
    name: str = "candidate",
    lights: Lights | None = None,
    lengths: Lengths | None = None,
    edges: Edges | None = None,
    witness: Witness | None = None,
    notes: Sequence[str] = (),
    rim: int = 0,
) -> Case:
    """The verdict on candidates; several are replicates.

    limit: the smallest relative bias of the image mean that must be detectable;  lights, lengths:
    for the diagnosis of a difference;  edges: for pictures without noise;  witness: a third
    renderer, where there is no rim;  rim: how many of the outermost pixels are left out on each
    side.  Candidates that are copies of the reference's pictures are `unchanged`.  Raises
    ImageError for candidates whose size is not the reference's, UsageError for several candidates
    without noise and for a rim that leaves nothing.
    """
    check_sizes(candidates, size_of(reference.pictures[0]), "as the reference")
    copies = Copies.of(reference.fingerprints)
    others = copies.others(candidates)
    if not others:
        return unchanged(name, copies, reference, notes)
    if copies.count:
        notes = [*notes, copies.note(len(others))]
    return judged(
        others,
        reference,
        limit=limit,
        name=name,
        lights=lights,
        lengths=lengths,
        edges=edges,
        witness=witness,
        notes=notes,
        rim=rim,
    )


def unchanged(name: str, copies: Copies, reference: Reference, notes: Sequence[str] = ()) -> Case:
    """The case of candidates that are all copies of the reference's pictures."""
    images = Images(*2 * [reference.pictures.mean(axis=0)])
    nothing = RungResult("statistics", "not-applicable", "there is no difference to test")
    rungs = [nothing, RungResult("images", "unchanged", copies.words, {"copies": copies.count})]
    metrics = image_metrics(images)
    verdict, reason = decide(rungs, metrics)
    return Case(
        scene=name,
        verdict=verdict,
        reason=reason,
        rungs=tuple(rungs),
        metrics=metrics,
        seconds={},
        images=images,
        notes=(*notes, *reference.notes),
        sides=("candidate's", reference.name),
    )


def judged(
    candidates: Sequence[Picture],
    reference: Reference,
    *,
    limit: float = LIMIT,
    name: str = "candidate",
    lights: Lights | None = None,
    lengths: Lengths | None = None,
    edges: Edges | None = None,
    witness: Witness | None = None,
    notes: Sequence[str] = (),
    rim: int = 0,
    looks: Looks | None = None,
) -> Case:
    """`gate_pictures` for candidates that are no copies.

    looks: those that were taken, the last one at these candidates.
    """
    if rim:
        candidates, reference = without_rim(candidates, reference, rim)
        lights, lengths = without_rim_later(lights, lengths, rim)
        edges = None if edges is None else edges.without_rim(rim)
    notes = [*notes, *_notes(candidates)]
    exact = reference.pictures[0]
    if reference.noise_free and candidates[0].displayed:
        if _is_dithered(candidates[0].radiance, reference.pictures[0]):
            shown, edges = candidates[0].radiance[np.newaxis], None
            notes.append(
                "the candidate is stored as 8-bit sRGB: it is within a code of the reference "
                "everywhere, and its errors have no mean, as those of dithering; they count as none"
            )
        else:
            shown = _displayed(reference.pictures)
            lengths = None if lengths is None else _displayed_later(lengths)
            notes.append(
                "the candidate is stored as 8-bit sRGB: the reference is rounded and clamped to 1 "
                "in the same way, and brighter values are not compared"
            )
        reference = replace(reference, pictures=shown)
    if reference.noise_free and len(candidates) > 1:
        raise UsageError(f"{len(candidates)} candidates of a picture without noise; expected one")
    pictures = stacked(candidates)
    images = _images(pictures, reference)
    rungs = [_input(candidates, pictures, reference)]
    metrics = None
    if rungs[0].status == "invalid":
        rungs += despite(pictures, _judged_by(reference), limit) if not reference.noise_free else []
    else:
        metrics = image_metrics(images)
        rungs.append(_statistics(pictures, reference, limit) if looks is None else looks.judged)
        if reference.noise_free and edges is not None:
            rungs[-1] = edges_rung(pictures[0], exact, edges, candidates[0].displayed)
        if rungs[-1].status == "agree" and "edge" in rungs[-1].numbers:
            rungs.append(RungResult("images", "not-applicable", _EACH_PIXEL))
        else:
            rungs.append(_images_rung(images, metrics, pictures, reference))
        known = _replicates(reference)
        if witness is not None and known is not None and len(pictures) > 1:
            heard, third = witness((pictures, known), ("candidate's", reference.name))
            rungs.append(heard)
            images = replace(images, witness=third)
    verdict, reason = decide(rungs, metrics)
    reason = with_vote(verdict, reason, rungs)
    cause: Cause | None = None
    worst: tuple[ImageRegion, ...] = ()
    if verdict == "differ":
        cause = diagnosis.of_rungs(rungs) or likeliest_cause(images, lights, lengths)
        worst = statistics.worst_regions(pictures, _judged_by(reference))
    return Case(
        scene=name,
        verdict=verdict,
        reason=reason,
        rungs=tuple(rungs),
        metrics=metrics,
        seconds={},
        images=images,
        notes=(*notes, *reference.notes),
        sides=("candidate's", reference.name),
        cause=cause,
        worst=worst,
    )


def not_run(name: str, error: Exception) -> Case:
    """A case for the outputs that says why the gate could not run."""
    status: Status = "invalid" if isinstance(error, ImageError) else "not-comparable"
    rung = RungResult("run", status, str(error))
    return Case(
        name, status, f"run: {error}", (rung,), None, {}, sides=("candidate's", "reference")
    )


def _images(pictures: FloatArray, reference: Reference) -> Images:
    means = Images(pictures.mean(axis=0), reference.pictures.mean(axis=0))
    if reference.noise_free or not np.isfinite(pictures).all():
        return means
    known = statistics.standard_error(pictures, _judged_by(reference))
    return replace(means, error=known)


def _judged_by(reference: Reference) -> "FloatArray | statistics.Known":
    """The reference in the form that the statistics take."""
    if reference.variance is None:
        return reference.pictures
    return statistics.Known(reference.pictures.mean(axis=0), reference.variance)


def _input(candidates: Sequence[Picture], pictures: FloatArray, reference: Reference) -> RungResult:
    for picture in candidates:
        if picture.opacity is not None and not picture.opacity.any():
            reason = f"{picture.name} is transparent throughout; expected an opaque picture"
            return RungResult("input", "invalid", reason)
    opacity = None
    if any(picture.opacity is not None for picture in candidates):
        opaque = np.ones(pictures.shape[1:3])
        opacity = np.stack([opaque if p.opacity is None else p.opacity for p in candidates])
    if reference.noise_free:
        return input_rung(pictures[0], reference.pictures[0], opacity)
    judges = reference.pictures if reference.variance is None else reference.pictures[0]
    return input_rung(pictures, judges, opacity)


def first_fault(candidate: Picture, reference: Reference) -> RungResult | None:
    """What is wrong with the input, as far as one picture shows it, so that no others need to be
    rendered; None if nothing is.  Raises ImageError for another size."""
    check_sizes([candidate], size_of(reference.pictures[0]), "as the reference")
    rung = _input([candidate], stacked([candidate]), reference)
    return rung if rung.status == "invalid" else None


def look(
    candidates: Sequence[Picture], reference: Reference, limit: float, level: float, rim: int = 0
) -> RungResult:
    """The statistics of replicates;  level: the share of the levels that this look may use;  rim:
    as in `gate_pictures`.  At the first look a fault of the input, if there is one."""
    if rim:
        candidates, reference = without_rim(candidates, reference, rim)
    pictures = stacked(candidates)
    if level == level_of(1):
        checked = _input(candidates, pictures, reference)
        if checked.status == "invalid":
            return checked
    return _statistics(pictures, reference, limit, level)


def _statistics(
    pictures: FloatArray, reference: Reference, limit: float, level: float = 1.0
) -> RungResult:
    if reference.noise_free:
        return RungResult("statistics", "not-applicable", _NO_NOISE)
    return statistics.compare(
        pictures,
        _judged_by(reference),
        limit=limit,
        level=level,
        fixed_reference=True,
    )


def _images_rung(
    images: Images, metrics: Metrics, pictures: FloatArray, reference: Reference
) -> RungResult:
    if reference.noise_free:
        return images_rung(images, metrics, None)
    replicates = _replicates(reference)
    if replicates is None or len(pictures) < 2:
        return RungResult("images", "not-applicable", _UNKNOWN_NOISE)
    return images_rung(images, metrics, (pictures, replicates))


def _replicates(reference: Reference) -> FloatArray | None:
    """The reference as replicates; if only the mean and its variance are known, two replicates that
    have exactly these."""
    if reference.variance is None:
        return reference.pictures if len(reference.pictures) > 1 else None
    mean, deviation = reference.pictures.mean(axis=0), np.sqrt(reference.variance)
    return np.stack([mean + deviation, mean - deviation])


DITHER = 1.0 / 6.0
"""Variance of a code dithered by half a code to either side, and then rounded: twice that of a
number between -1/2 and 1/2."""

UNBIASED = 5.0
"""Standard errors of the mean of such errors that no tile exceeds by chance: one in a million."""


def _is_dithered(candidate: FloatArray, reference: FloatArray) -> bool:
    """Whether the candidate's 8-bit codes are the reference's plus noise of at most a code, without
    a mean in any channel of the picture or of a tile."""
    codes, exact = (255.0 * srgb(np.clip(x, 0.0, 1.0)) for x in (candidate, reference))
    error = codes - exact
    if np.array_equal(np.round(codes), np.round(exact)) or np.abs(error).max() > 1.0 + 1e-6:
        return False
    for side in (TILE, max(error.shape[:2])):
        sums, pixels = cell_sums(error, side), cell_pixels(error, side)
        if np.any(np.abs(sums) > UNBIASED * np.sqrt(DITHER * pixels)):
            return False
    return True


def _displayed(pictures: FloatArray) -> FloatArray:
    """Linear pictures rounded to 8-bit sRGB."""
    return linear(np.round(255.0 * srgb(np.clip(pictures, 0.0, 1.0))) / 255.0)


def _displayed_later(lengths: Lengths) -> Lengths:
    """The same of pictures that are rendered only if they are needed: rounding is no misfit."""

    def hypotheses(reference: FloatArray) -> Iterator[Hypothesis]:
        for one in lengths(reference):
            yield replace(one, picture=_displayed(one.picture))

    return hypotheses


def _notes(candidates: Sequence[Picture]) -> tuple[str, ...]:
    """Notes about the files, for the reader."""
    converted = next(((p.note,) for p in candidates if p.note), ())
    if any(picture.quantised and not picture.displayed for picture in candidates):
        return ("the candidate has 8 bits per channel: its rounding counts as an error", *converted)
    return converted
