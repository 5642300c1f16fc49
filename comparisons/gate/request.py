"""A gate's request: what the candidates are compared with."""

import logging
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from pathlib import Path
from typing import Any

from comparisons.compare.darkness import why_dark
from comparisons.compare.diagnosis import is_sure
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.looks import Looks
from comparisons.compare.misreadings import misreadings
from comparisons.compare.notebook import NotebookCase
from comparisons.compare.path_length import Lengths, path_lengths
from comparisons.compare.single_lights import single_lights
from comparisons.gate import baselines, reference
from comparisons.gate.as_renderers import as_renderers
from comparisons.gate.digest import scene_digest
from comparisons.gate.gate import gate_pictures
from comparisons.gate.pictures_in import Picture, pictures_of
from comparisons.gate.question import Question
from comparisons.gate.reference import Reference, check_sizes, size_of
from comparisons.gate.rim import check_rim
from comparisons.gate.shown_curve import estimated
from comparisons.gate.terms import missing_terms
from comparisons.gate.tone_curves import ESTIMATE, ToneCurve, curve_of
from comparisons.gate.undone import Reading, Undo
from comparisons.renderers import Witnesses, several
from comparisons.results import LIMIT
from comparisons.results.case import Case, Cause, FloatArray, RungResult
from comparisons.results.headline import UP_TO
from comparisons.rungs.edges import DARK, TOLERANCE, Edges
from comparisons.rungs.footprints import look_at
from comparisons.rungs.own_samples import other_trees, samples_of, uncut
from comparisons.rungs.witness import Witness, witnesses_of
from comparisons.statistics import Margins
from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Request:
    """Candidates are compared with `references`, else a baseline, else our rendering of the scene.
    The scene also gives size, noise and lights.

    variance: a file with the variance of a single reference;  baselines: their folder;  limit: the
    smallest relative bias of the image mean that must be detectable;  noise_free: the renderer uses
    no random numbers;  tolerance: relative error of a value of such a picture;  tone_curve: what
    such a picture went through, as `curve_of` takes it, or ESTIMATE;  rim: how many of the
    outermost pixels are left out;  name: the case's;  witness: a third renderer, of the scene, with
    a box filter.
    """

    scene: Scene | None = None
    references: tuple[Picture, ...] = ()
    variance: Path | None = None
    baseline: str = ""
    baselines: Path = Path("baselines")
    limit: float = LIMIT
    noise_free: bool = False
    tolerance: float = TOLERANCE
    tone_curve: str = ""
    threads: int | None = None
    rim: int = 0
    name: str = "candidate"
    witness: Witnesses = None

    def __post_init__(self) -> None:
        if self.references and self.baseline:
            raise UsageError("got a reference and a baseline; expected one of them")
        if not (self.references or self.baseline or self.scene is not None):
            raise UsageError("nothing to compare with; expected a scene, reference or baseline")
        if self.variance is not None and not self.references:
            raise UsageError("got a variance without a reference; expected both")
        if several(self.witness) and self.scene is None:
            raise UsageError("got a witness without a scene; expected both")
        if self.witness and self.rim:
            raise UsageError("got a witness and a rim; expected one of them")
        permitted = Margins().image
        if not permitted < self.limit < 1.0:
            raise UsageError(
                f"the limit is {self.limit:g}; expected a fraction above {permitted:g}, the "
                "bias of the image mean that is permitted, such as 0.005"
            )
        if not 0.0 <= self.tolerance < 1.0:
            raise UsageError(
                f"the tolerance is {self.tolerance:g}; expected a fraction from 0 to below 1, such "
                f"as {TOLERANCE:g}"
            )
        if self.baseline:
            baselines.check_name(self.baseline)
        if self.tone_curve not in ("", ESTIMATE):
            curve_of(self.tone_curve)


def gated(
    request: Request,
    candidates: Sequence[Picture],
    say: Progress = lambda what, fraction: None,
) -> Case:
    """The verdict.  Raises ImageError, SceneError, UsageError, BaselineMissingError,
    BaselineEditedError."""
    case = prepared(request, candidates, say).case(candidates)
    _LOG.info("%s: %s: %s", case.scene, case.verdict, case.reason)
    return case


def gate(
    pictures: Any,
    *,
    scene: Scene | str | os.PathLike[str] | None = None,
    reference: Any = None,
    limit: float = LIMIT,
    noise_free: bool = False,
    tone_curve: str = "",
    rim: int = 0,
    threads: int | None = None,
    conventions: str = "",
) -> NotebookCase:
    """Judge the pictures of another renderer; Mitsuba takes no part.

    pictures: linear radiance, an array (height, width, 3), with opacity (height, width, 4), or
    (replicates, height, width, 3 or 4), or a file (EXR, PNG, PFM, HDR, NPY), or a list of these,
    which are replicates with different seeds;  scene: a scene or a scene file, which reference_rt
    renders;  reference: in its place, pictures that are right;  limit: the smallest relative bias
    of the image mean that must be detectable;  noise_free: they were rendered without random
    numbers;  tone_curve: what such a picture went through, as of `gate --tone-curve`;  rim: how
    many of the outermost pixels are left out;  threads: ours, None for all;  conventions: the
    renderer as whose they are read, as of `gate --from`.

    The case has `verdict`, `reason`, `cause` and `write_page`.  Raises ImageError, SceneError,
    UsageError.
    """
    known = scene if scene is None or isinstance(scene, Scene) else Scene.load(os.fspath(scene))
    others = () if reference is None else pictures_of(reference)
    settings: dict[str, Any] = {"limit": limit, "noise_free": noise_free, "tone_curve": tone_curve}
    reading = Reading.of(conventions, known, of_files=bool(others))
    known, others = reading.scene(known), reading.judge(others)
    request = Request(known, others, threads=threads, rim=rim, **settings)
    case = gated(request, reading.read(pictures_of(pictures)))
    return NotebookCase.of(reading.told(case))


@dataclass(frozen=True)
class Judge:
    """What candidates are compared with, and what is known for the diagnosis of a difference.

    linear: the reference before the tone curve.
    """

    request: Request
    linear: Reference
    scene: Scene | None
    curve: ToneCurve | None = None

    @cached_property
    def reference(self) -> Reference:
        """What candidates show if they are right."""
        if self.curve is None:
            return self.linear
        how = "was estimated from the candidate: another strength of all lights is not seen"
        if self.request.tone_curve != ESTIMATE:
            how = "was declared"
        note = f"the tone curve {self.curve} {how}; the reference is displayed through it"
        shown = self.curve(self.linear.pictures)
        return replace(self.linear, pictures=shown, notes=(*self.linear.notes, note))

    @cached_property
    def misread(self) -> RungResult | None:
        """What our own rendering, if that is the reference, has otherwise than the scene's text."""
        if self.scene is None or self.request.references or self.request.baseline:
            return None
        from comparisons.rungs.files import misread  # its second readers take a while to load

        return misread(self.scene)

    def case(
        self, candidates: Sequence[Picture], notes: Sequence[str] = (), looks: Looks | None = None
    ) -> Case:
        """The verdict by `gate_pictures`; a difference may be a convention of a renderer that was
        measured, or, from our own pictures, of terms that the renderer lacks."""
        case = self._explained(candidates, notes, looks)
        request = self.request
        if case.verdict != "differ" or self.misread is not None or self.curve or request.baseline:
            return case
        scene = None if request.references else self.scene
        plain = replace(request, witness=None)

        def judged(undo: Undo) -> Case:
            pictures, described, linear = undo.read(candidates), undo.described(), self.linear
            if described is None:
                linear = replace(linear, pictures=undo.cropped(linear.pictures))
            elif described != scene:
                linear = reference.of_scene(described, request.limit, threads=request.threads)
            return Judge(plain, linear, described)._case(pictures, diagnosed=False)

        def scaled(factor: float) -> Case:
            linear = replace(self.linear, pictures=factor * self.linear.pictures)
            return Judge(plain, linear, None)._case(candidates, diagnosed=False)

        if request.rim or request.variance:
            return case
        cause = as_renderers(case, scene, request.threads, judged, scaled)
        return case if cause is None else replace(case, cause=cause)

    def _explained(
        self, candidates: Sequence[Picture], notes: Sequence[str], looks: Looks | None
    ) -> Case:
        """The same without conventions of other renderers."""
        request = self.request
        case = self._case(candidates, notes, looks)
        if request.tone_curve == ESTIMATE and self.curve is not None:
            where = str(self.curve).replace(":", " at exposure ")
            reason = f"{UP_TO}the tone curve {where}, estimated: {case.reason}"
            case = replace(case, reason=reason)
        if case.verdict != "differ" or self.misread is not None:
            return case
        toned = None if request.tone_curve == ESTIMATE else self._toned(candidates, case)
        if toned is not None or request.references or request.baseline:
            return case if toned is None else replace(case, cause=toned)
        assert self.scene is not None

        def judged(scene: Scene) -> Case:
            ours = reference.of_scene(scene, request.limit, threads=request.threads)
            plain = Judge(replace(request, witness=None), ours, scene, self.curve)
            return plain._case(candidates, diagnosed=False)

        cause = missing_terms(self.scene, case, request.rim, request.threads, judged, self.curve)
        return case if cause is None else replace(case, cause=cause)

    def _toned(self, candidates: Sequence[Picture], found: Case) -> Cause | None:
        """That the candidate of a case that differs went through another tone curve, or the same at
        another exposure."""
        own, shown = self.curve, candidates[0].radiance
        curve = estimated(shown, self.linear.pictures[0]) if self.linear.noise_free else None
        if curve is None or str(curve) == str(own or "linear"):
            return None
        other = replace(self, curve=curve, request=replace(self.request, tone_curve=str(curve)))
        case = other.case(candidates)
        is_gain = curve.name == ("linear" if own is None else own.name)
        if is_sure(found.cause) and (case.verdict != "agree" or (is_gain and own is None)):
            return None
        name = f"the tone curve {curve}"
        if is_gain:
            where = "" if own is None else " before the tone curve"
            gain = curve.exposure / (1.0 if own is None else own.exposure)
            name = f"constant gain of {gain:.3g}{where}"
        evidence = f"with --tone-curve {curve} the pictures agree: declare it, or switch it off"
        if case.verdict != "agree":
            of = case.reason if case.cause is None else f"{case.cause.name}, {case.cause.evidence}"
            evidence = f"with --tone-curve {curve} most pixels are right; besides: {of}"
        before, after = (
            float(((shown - judge.reference.pictures[0]) ** 2).sum()) for judge in (self, other)
        )
        return Cause(name, evidence, 1.0 - after / before)

    def _case(
        self,
        candidates: Sequence[Picture],
        notes: Sequence[str] = (),
        looks: Looks | None = None,
        diagnosed: bool = True,
    ) -> Case:
        """The verdict.  diagnosed: whether the cause of a difference is sought by rendering."""
        request, scene, curve = self.request, self.scene, self.curve
        known = scene if diagnosed else None
        edges = None
        look = look_at(scene, request.threads) if scene and self.linear.noise_free else None
        if look is not None and scene is not None and curve is None:
            others = partial(other_trees, scene, request.threads) if not request.rim else None
            edges = Edges(
                look,
                request.tolerance,
                samples=samples_of(scene),
                beside=uncut(scene, request.threads),
                others=others,
            )
        elif look is not None and curve is not None:
            steep, floor = curve.errors(self.linear.pictures[0], DARK)
            edges = Edges(look, request.tolerance * steep, curve, floor)
        lengths = None if known is None else _hypotheses(known, request.threads)
        if curve is not None and lengths is not None:
            lengths = self._through(curve, lengths)
        # Pictures of single lights do not add up behind a curve.
        lights = (
            None
            if known is None or curve
            else partial(single_lights, known, threads=request.threads)
        )
        question = Question(
            request.limit,
            request.name,
            lights,
            lengths,
            edges,
            self._witness(),
            request.rim,
            None if scene is None else partial(why_dark, scene),
            self.misread,
        )
        return gate_pictures(candidates, self.reference, question, notes, looks)

    def _through(self, curve: ToneCurve, lengths: Lengths) -> Lengths:
        """Hypotheses about linear pictures, as the curve shows them."""

        def hypotheses(shown: FloatArray) -> Iterator[Hypothesis]:
            for found in lengths(self.linear.pictures[0]):
                yield replace(found, picture=curve(found.picture))

        return hypotheses

    def _witness(self) -> Witness | None:
        if not self.request.witness or self.request.scene is None:
            return None
        limit, threads = self.request.limit, self.request.threads
        names = several(self.request.witness)
        return witnesses_of(names, self.request.scene, limit, threads, lambda line: None)


def prepared(
    request: Request,
    candidates: Sequence[Picture],
    say: Progress = lambda what, fraction: None,
) -> Judge:
    """The reference of a request, once the candidates have the scene's size; raises what `gated`
    does."""
    scene = request.scene
    if scene is not None:
        expected = f"{scene.film.width} x {scene.film.height}"
        check_sizes(candidates, expected, f"the size of the scene '{scene.name}'")
    judge, scene = _judge(request, scene, [picture.name for picture in candidates], say)
    check_rim(judge.pictures.shape, request.rim)
    if not request.tone_curve:
        return Judge(request, judge, scene)
    if not judge.noise_free:
        raise UsageError("--tone-curve: the pictures have noise; expected those of a scene without")
    if request.tone_curve != ESTIMATE:
        return Judge(request, judge, scene, curve_of(request.tone_curve))
    check_sizes(candidates, size_of(judge.pictures[0]), "as the reference")
    curve = estimated(candidates[0].radiance, judge.pictures[0])
    if curve is None or str(curve) == "linear":
        curve = None
        judge = replace(judge, notes=(*judge.notes, "no tone curve was recognised"))
    return Judge(request, judge, scene, curve)


def _judge(
    request: Request, scene: Scene | None, files: Sequence[str], say: Progress
) -> tuple[Reference, Scene | None]:
    """The reference, and the scene if it is known."""
    noise_free = request.noise_free or (scene is not None and reference.is_noise_free(scene))
    if request.references:
        judge = reference.of_files(request.references, request.variance, noise_free)
        return judge, scene
    if request.baseline:
        return _baseline(request, scene, files)
    assert scene is not None
    return reference.of_scene(scene, request.limit, threads=request.threads, say=say), scene


def _baseline(
    request: Request, scene: Scene | None, files: Sequence[str]
) -> tuple[Reference, Scene | None]:
    baseline = baselines.load(request.baselines, request.baseline, files)
    scene = scene or baselines.scene_of(baseline.record, request.baselines)
    if scene is not None:
        baselines.check_fresh(baseline, scene_digest(scene), f"the scene '{scene.name}'")
    judge = baseline.reference()
    if request.noise_free and len(judge.pictures) == 1:
        judge = replace(judge, noise_free=True)
    return judge, scene


def _hypotheses(scene: Scene, threads: int | None) -> Lengths | None:
    kinds = path_lengths(scene, threads), misreadings(scene, threads)
    known = [kind for kind in kinds if kind is not None]
    return (lambda reference: chain(*(of(reference) for of in known))) if known else None
