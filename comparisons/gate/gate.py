"""The gate: another renderer's pictures against a reference, rung by rung."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from comparisons import statistics
from comparisons.compare.judge import Evidence, Rendered, at_look, judge, of_replicates
from comparisons.compare.looks import Looks, level_of
from comparisons.gate.copies import Copies
from comparisons.gate.displayed import as_displayed
from comparisons.gate.pictures_in import Picture
from comparisons.gate.question import USUAL, Question
from comparisons.gate.reference import Reference, check_sizes, size_of, stacked
from comparisons.gate.rim import question_without_rim, without_rim
from comparisons.results.case import Case, FloatArray, Images, RungResult, Status, decide
from comparisons.rungs.edges import edges_rung
from comparisons.rungs.input import input_rung
from comparisons.statistics import in_range
from comparisons.statistics.metrics import image_metrics
from reference_rt.util.errors import ImageError, UsageError


def gate_pictures(
    candidates: Sequence[Picture],
    reference: Reference,
    question: Question = USUAL,
    notes: Sequence[str] = (),
    looks: Looks | None = None,
) -> Case:
    """The verdict on candidates; several are replicates.

    looks: those that were taken, the last one at these candidates, none of which is a copy.
    Candidates that are copies of the reference's pictures are `unchanged`.  Raises ImageError for
    candidates whose size is not the reference's, UsageError for several candidates without noise
    and for a rim that leaves nothing.
    """
    check_sizes(candidates, size_of(reference.pictures[0]), "as the reference")
    notes = list(notes)
    if looks is None:
        copies = Copies.of(reference.fingerprints)
        candidates = copies.others(candidates)
        if not candidates:
            return unchanged(question.name, copies, reference, notes)
        if copies.count:
            notes.append(copies.note(len(candidates)))
    candidates, reference, exponent = _in_range(candidates, reference)
    if exponent:
        notes.append(in_range.note(exponent))
        # What is rendered for a diagnosis has other values.
        question = replace(question, lights=None, lengths=None, edges=None, witness=None)
    if question.rim:
        candidates, reference = without_rim(candidates, reference, question.rim)
        question = question_without_rim(question)
    if reference.noise_free and len(candidates) > 1:
        raise UsageError(f"{len(candidates)} candidates of a picture without noise; expected one")
    notes += _notes(candidates)
    exact, shown = reference.pictures[0], candidates[0]
    if reference.noise_free and shown.displayed:
        reference, question, note = as_displayed(shown, reference, question)
        notes.append(note)
    rendered = replace(_rendered(candidates, reference), checked=_input(candidates, reference))
    if reference.noise_free and question.edges is not None:
        edges = partial(edges_rung, shown.radiance, exact, question.edges, shown.displayed)
        rendered = replace(rendered, still=edges)
    evidence = Evidence(
        question.name,
        () if question.misread is None else (question.misread,),
        rendered,
        seconds={},
        notes=(*notes, *reference.notes),
        sides=("candidate's", reference.name),
        lights=question.lights,
        lengths=question.lengths,
        looks=looks,
        witness=question.witness,
        darkness=question.darkness,
    )
    return judge(evidence, question.limit)


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


def _in_range(
    candidates: Sequence[Picture], reference: Reference
) -> tuple[Sequence[Picture], Reference, int]:
    """Both sides times a power of two, if their squares are no numbers; and its exponent, or 0."""
    exponent = in_range.exponent_of(reference.pictures, *(p.radiance for p in candidates))
    if not exponent:
        return candidates, reference, 0
    variance = reference.variance
    if variance is not None:
        variance = in_range.times(variance, 2 * exponent)
    pictures = in_range.times(reference.pictures, exponent)
    scaled = [replace(p, radiance=in_range.times(p.radiance, exponent)) for p in candidates]
    return scaled, replace(reference, pictures=pictures, variance=variance), exponent


def _rendered(candidates: Sequence[Picture], reference: Reference) -> Rendered:
    pictures = stacked(candidates)
    if reference.noise_free:
        return Rendered(Images(pictures[0], reference.pictures[0]), still=_no_noise)
    known: FloatArray | statistics.Known = reference.pictures
    if reference.variance is not None:
        known = statistics.Known(reference.pictures.mean(axis=0), reference.variance)
    return replace(of_replicates(pictures, known, {}), fixed_reference=True)


def _no_noise() -> RungResult:
    reason = "the scene is rendered without random numbers: there is no noise"
    return RungResult("statistics", "not-applicable", reason)


def not_run(name: str, error: Exception) -> Case:
    """A case for the outputs that says why the gate could not run."""
    status: Status = "invalid" if isinstance(error, ImageError) else "not-comparable"
    rung = RungResult("run", status, str(error))
    return Case(
        name, status, f"run: {error}", (rung,), None, {}, sides=("candidate's", "reference")
    )


def _input(candidates: Sequence[Picture], reference: Reference) -> RungResult:
    for picture in candidates:
        if picture.opacity is not None and not picture.opacity.any():
            reason = f"{picture.name} is transparent throughout; expected an opaque picture"
            return RungResult("input", "invalid", reason)
    pictures, opacity = stacked(candidates), None
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
    candidates, reference, _ = _in_range([candidate], reference)
    rung = _input(candidates, reference)
    return rung if rung.status == "invalid" else None


def look(
    candidates: Sequence[Picture], reference: Reference, limit: float, level: float, rim: int = 0
) -> RungResult:
    """The statistics of replicates;  level: the share of the levels that this look may use;  rim:
    as in `gate_pictures`.  At the first look a fault of the input, if there is one."""
    candidates, reference, _ = _in_range(candidates, reference)
    if rim:
        candidates, reference = without_rim(candidates, reference, rim)
    rendered = _rendered(candidates, reference)
    if level == level_of(1):
        rendered = replace(rendered, checked=_input(candidates, reference))
    return at_look(rendered, limit, level)


def _notes(candidates: Sequence[Picture]) -> tuple[str, ...]:
    """Notes about the files, for the reader."""
    converted = next(((p.note,) for p in candidates if p.note), ())
    if any(picture.quantised and not picture.displayed for picture in candidates):
        return ("the candidate has 8 bits per channel: its rounding counts as an error", *converted)
    return converted
