"""The gate: another renderer's pictures against a reference, rung by rung."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from comparisons import statistics
from comparisons.compare.diagnosis.misfit import Hypothesis
from comparisons.compare.judge import Evidence, Lights, Rendered, at_look, judge, of_replicates
from comparisons.compare.looks import Looks, level_of
from comparisons.compare.path_length import Lengths
from comparisons.gate.digest import Copies
from comparisons.gate.edges import Edges, edges_rung
from comparisons.gate.pictures_in import Picture
from comparisons.gate.reference import Reference, check_sizes, size_of, stacked
from comparisons.gate.rim import without_rim, without_rim_later
from comparisons.results.case import Case, FloatArray, Images, RungResult, Status, decide
from comparisons.rungs.input import input_rung
from comparisons.rungs.witness import Witness
from comparisons.statistics.metrics import image_metrics
from comparisons.statistics.scales import TILE, cell_pixels, cell_sums
from reference_rt.rendering.image import srgb
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import ImageError, UsageError

LIMIT = 0.005
"""The smallest relative bias of the image mean that must be detectable."""


@dataclass(frozen=True)
class Question:
    """What is asked of candidates, and what helps to answer.

    limit: the smallest relative bias of the image mean that must be detectable;  name: the case's;
    lights, lengths: for the diagnosis of a difference;  edges: for pictures without noise;
    witness: a third renderer, where there is no rim;  rim: how many of the outermost pixels are
    left out on each side.
    """

    limit: float = LIMIT
    name: str = "candidate"
    lights: Lights | None = None
    lengths: Lengths | None = None
    edges: Edges | None = None
    witness: Witness | None = None
    rim: int = 0


def gate_pictures(
    candidates: Sequence[Picture],
    reference: Reference,
    question: Question = Question(),
    notes: Sequence[str] = (),
) -> Case:
    """The verdict on candidates; several are replicates.

    Candidates that are copies of the reference's pictures are `unchanged`.  Raises ImageError for
    candidates whose size is not the reference's, UsageError for several candidates without noise
    and for a rim that leaves nothing.
    """
    check_sizes(candidates, size_of(reference.pictures[0]), "as the reference")
    copies = Copies.of(reference.fingerprints)
    others = copies.others(candidates)
    if not others:
        return unchanged(question.name, copies, reference, notes)
    if copies.count:
        notes = [*notes, copies.note(len(others))]
    return judged(others, reference, question, notes)


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
    question: Question = Question(),
    notes: Sequence[str] = (),
    looks: Looks | None = None,
) -> Case:
    """`gate_pictures` for candidates that are no copies.

    looks: those that were taken, the last one at these candidates.
    """
    if question.rim:
        candidates, reference = without_rim(candidates, reference, question.rim)
        question = _without_rim(question)
    if reference.noise_free and len(candidates) > 1:
        raise UsageError(f"{len(candidates)} candidates of a picture without noise; expected one")
    notes = [*notes, *_notes(candidates)]
    exact, shown = reference.pictures[0], candidates[0]
    if reference.noise_free and shown.displayed:
        reference, question, note = _as_displayed(shown, reference, question)
        notes.append(note)
    rendered = replace(_rendered(candidates, reference), checked=_input(candidates, reference))
    if reference.noise_free and question.edges is not None:
        edges = partial(edges_rung, shown.radiance, exact, question.edges, shown.displayed)
        rendered = replace(rendered, still=edges)
    evidence = Evidence(
        question.name,
        (),
        rendered,
        seconds={},
        notes=(*notes, *reference.notes),
        sides=("candidate's", reference.name),
        lights=question.lights,
        lengths=question.lengths,
        looks=looks,
        witness=question.witness,
    )
    return judge(evidence, question.limit)


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
    rung = _input([candidate], reference)
    return rung if rung.status == "invalid" else None


def look(
    candidates: Sequence[Picture], reference: Reference, limit: float, level: float, rim: int = 0
) -> RungResult:
    """The statistics of replicates;  level: the share of the levels that this look may use;  rim:
    as in `gate_pictures`.  At the first look a fault of the input, if there is one."""
    if rim:
        candidates, reference = without_rim(candidates, reference, rim)
    rendered = _rendered(candidates, reference)
    if level == level_of(1):
        rendered = replace(rendered, checked=_input(candidates, reference))
    return at_look(rendered, limit, level)


# ---- what a question becomes with the pictures ---------------------------------------------------


def _without_rim(question: Question) -> Question:
    """The same of pictures without their rim."""
    rim, edges = question.rim, question.edges
    lights, lengths = without_rim_later(question.lights, question.lengths, rim)
    edges = None if edges is None else edges.without_rim(rim)
    return replace(question, lights=lights, lengths=lengths, edges=edges)


def _as_displayed(
    candidate: Picture, reference: Reference, question: Question
) -> tuple[Reference, Question, str]:
    """The reference as a candidate of 8-bit sRGB should be, the question about it, and a note."""
    if _is_dithered(candidate.radiance, reference.pictures[0]):
        return (
            replace(reference, pictures=candidate.radiance[np.newaxis]),
            replace(question, edges=None),
            "the candidate is stored as 8-bit sRGB: it is within a code of the reference "
            "everywhere, and its errors have no mean, as those of dithering; they count as none",
        )
    lengths = None if question.lengths is None else _displayed_later(question.lengths)
    return (
        replace(reference, pictures=_displayed(reference.pictures)),
        replace(question, lengths=lengths),
        "the candidate is stored as 8-bit sRGB: the reference is rounded and clamped to 1 in the "
        "same way, and brighter values are not compared",
    )


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
