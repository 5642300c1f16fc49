"""A gate's request: what the candidates are compared with."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from comparisons.compare.compare import single_lights
from comparisons.compare.judge import Lights
from comparisons.compare.misreadings import misreadings
from comparisons.compare.one_scene import NotebookCase
from comparisons.compare.path_length import Lengths, path_lengths
from comparisons.gate import baselines, reference
from comparisons.gate.digest import scene_digest
from comparisons.gate.edges import TOLERANCE, Edges, look_at
from comparisons.gate.gate import LIMIT, gate_pictures
from comparisons.gate.pictures_in import Picture, pictures_of
from comparisons.gate.reference import Reference, check_sizes
from comparisons.gate.rim import check_rim
from comparisons.gate.terms import missing_terms
from comparisons.renderers import WitnessName
from comparisons.results.case import Case
from comparisons.rungs.witness import Witness, witness_of
from comparisons.statistics import Margins
from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import UsageError

LIGHT_SPP = 64
"""Samples per pixel of the pictures of single lights: enough to recognise a missing one."""


@dataclass(frozen=True)
class Request:
    """Candidates are compared with `references`, else a baseline, else our rendering of the scene.
    The scene also gives size, noise and lights.

    variance: a file with the variance of a single reference;  baselines: their folder;  limit: the
    smallest relative bias of the image mean that must be detectable;  noise_free: the renderer uses
    no random numbers;  tolerance: relative error of a value of such a picture;  rim: how many of
    the outermost pixels are left out;  name: the case's;  witness: a third renderer, of the scene,
    with a box filter.
    """

    scene: Scene | None = None
    references: tuple[Picture, ...] = ()
    variance: Path | None = None
    baseline: str = ""
    baselines: Path = Path("baselines")
    limit: float = LIMIT
    noise_free: bool = False
    tolerance: float = TOLERANCE
    threads: int | None = None
    rim: int = 0
    name: str = "candidate"
    witness: WitnessName | None = None

    def __post_init__(self) -> None:
        if self.references and self.baseline:
            raise UsageError("got a reference and a baseline; expected one of them")
        if not (self.references or self.baseline or self.scene is not None):
            raise UsageError("nothing to compare with; expected a scene, reference or baseline")
        if self.variance is not None and not self.references:
            raise UsageError("got a variance without a reference; expected both")
        if self.witness is not None and self.scene is None:
            raise UsageError("got a witness without a scene; expected both")
        if self.witness is not None and self.rim:
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


def gated(
    request: Request,
    candidates: Sequence[Picture],
    say: Progress = lambda what, fraction: None,
) -> Case:
    """The verdict.  Raises ImageError, SceneError, UsageError, BaselineMissingError,
    BaselineEditedError."""
    judge = prepared(request, candidates, say)
    return judge.case(partial(gate_pictures, candidates, judge.reference))


def gate(
    pictures: Any,
    *,
    scene: Scene | str | os.PathLike[str] | None = None,
    reference: Any = None,
    limit: float = LIMIT,
    noise_free: bool = False,
    rim: int = 0,
    threads: int | None = None,
) -> NotebookCase:
    """Judge the pictures of another renderer; Mitsuba takes no part.

    pictures: linear radiance, an array (height, width, 3), with opacity (height, width, 4), or
    (replicates, height, width, 3 or 4), or a file (EXR, PNG, PFM, HDR, NPY), or a list of these,
    which are replicates with different seeds;  scene: a scene or a scene file, which reference_rt
    renders;  reference: in its place, pictures that are right;  limit: the smallest relative bias
    of the image mean that must be detectable;  noise_free: they were rendered without random
    numbers;  rim: how many of the outermost pixels are left out;  threads: ours, None for all.

    The case has `verdict`, `reason`, `cause` and `write_page`.  Raises ImageError, SceneError,
    UsageError.
    """
    known = scene if scene is None or isinstance(scene, Scene) else Scene.load(os.fspath(scene))
    others = () if reference is None else pictures_of(reference)
    request = Request(known, others, limit=limit, noise_free=noise_free, threads=threads, rim=rim)
    case = gated(request, pictures_of(pictures))
    return NotebookCase(**{field.name: getattr(case, field.name) for field in fields(case)})


@dataclass(frozen=True)
class Judge:
    """What candidates are compared with, and what is known for the diagnosis of a difference."""

    request: Request
    reference: Reference
    scene: Scene | None

    def case(self, gate: "partial[Case]") -> Case:
        """The verdict by `gate_pictures` or `judged`, whose candidates and reference are given
        already; a difference from our own pictures may be of terms that the renderer lacks."""
        request = self.request
        found = self._case(gate)
        if found.verdict != "differ" or request.references or request.baseline:
            return found
        assert self.scene is not None
        candidates = gate.args[0]

        def judged(scene: Scene) -> Case:
            ours = reference.of_scene(scene, request.limit, threads=request.threads)
            plain = Judge(replace(request, witness=None), ours, scene)
            return plain._case(partial(gate_pictures, candidates, ours), diagnosed=False)

        cause = missing_terms(self.scene, found, request.rim, request.threads, judged)
        return found if cause is None else replace(found, cause=cause)

    def _case(self, gate: Callable[..., Case], diagnosed: bool = True) -> Case:
        """The verdict.  diagnosed: whether the cause of a difference is sought by rendering."""
        request, scene = self.request, self.scene
        known = scene if diagnosed else None
        look = look_at(scene, request.threads) if scene and self.reference.noise_free else None
        return gate(
            limit=request.limit,
            name=request.name,
            lights=None if known is None else _lights(known, request.threads),
            lengths=None if known is None else _hypotheses(known, request.threads),
            edges=None if look is None else Edges(look, request.tolerance),
            witness=self._witness(),
            rim=request.rim,
        )

    def _witness(self) -> Witness | None:
        if self.request.witness is None or self.request.scene is None:
            return None
        limit, threads = self.request.limit, self.request.threads
        return witness_of(
            self.request.witness, self.request.scene, limit, threads, lambda line: None
        )


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
    found, scene = _judge(request, scene, [picture.name for picture in candidates], say)
    check_rim(found.pictures.shape, request.rim)
    return Judge(request, found, scene)


def _judge(
    request: Request, scene: Scene | None, files: Sequence[str], say: Progress
) -> tuple[Reference, Scene | None]:
    """The reference, and the scene if it is known."""
    noise_free = request.noise_free or (scene is not None and reference.is_noise_free(scene))
    if request.references:
        found = reference.of_files(request.references, request.variance, noise_free)
        return found, scene
    if request.baseline:
        return _baseline(request, scene, files)
    assert scene is not None
    return reference.of_scene(scene, request.limit, threads=request.threads, say=say), scene


def _baseline(
    request: Request, scene: Scene | None, files: Sequence[str]
) -> tuple[Reference, Scene | None]:
    found = baselines.load(request.baselines, request.baseline, files)
    scene = scene or baselines.scene_of(found.record, request.baselines)
    if scene is not None:
        baselines.check_fresh(found, scene_digest(scene), f"the scene '{scene.name}'")
    judge = found.reference()
    if request.noise_free and len(judge.pictures) == 1:
        judge = replace(judge, noise_free=True)
    return judge, scene


def _lights(scene: Scene, threads: int | None) -> Lights:
    return lambda: single_lights(scene, LIGHT_SPP, threads)


def _hypotheses(scene: Scene, threads: int | None) -> Lengths | None:
    return path_lengths(scene, threads) or misreadings(scene, threads)
