"""Derivative pictures of any differentiable renderer, against differences of ours, a closed form,
or differences of the renderer's own pictures."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from comparisons.compare.derivative import judged, margins
from comparisons.compare.derivative_causes import Ours, likeliest
from comparisons.compare.notebook import NotebookCase
from comparisons.gate.pictures_in import Picture, pictures_of
from comparisons.gate.reference import check_sizes, size_of
from comparisons.results import LIMIT
from comparisons.results.case import Case, Images, RungResult, decide
from comparisons.statistics import Known, standard_error
from comparisons.statistics.cells import Margins
from comparisons.statistics.sides import side_of
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.derivative import REPLICATES, STEP
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ImageError, UsageError

Primal = Callable[[float, int], Any]
"""A renderer's own picture (height, width, 3), by the parameter's value and a seed.  The same seed
at two values must mean the same random numbers: else the difference is of noise."""


@dataclass(frozen=True)
class Asked:
    """What a derivative is compared with: differences of our pictures of `scene` by `parameter`; or
    `closed`, a picture (height, width, 3) that is exact; or differences of the caller's `primal`
    about `at`.

    step: of the differences, in the parameter's unit;  limit: the smallest bias of the image mean,
    over the derivative's size, that must be detectable;  threads: ours.  Raises UsageError for none
    of them, or several.
    """

    scene: Scene | None = None
    parameter: str = ""
    closed: FloatArray | None = None
    primal: Primal | None = None
    at: float | None = None
    step: float | None = None
    limit: float = LIMIT
    threads: int | None = None
    name: str = "derivative"

    def __post_init__(self) -> None:
        of = [self.scene is not None, self.closed is not None, self.primal is not None]
        if sum(of) != 1:
            raise UsageError("expected a scene, a closed form or a primal function, one of them")
        if (self.scene is None) != (not self.parameter):
            raise UsageError("expected a scene and the path of its parameter, both")
        if (self.primal is None) != (self.at is None):
            raise UsageError("expected a primal function and the value that it is asked at, both")


@dataclass(frozen=True)
class _Right:
    """What is right: replicates, or a known picture, and what a step adds to them."""

    pictures: FloatArray | Known
    truncation: FloatArray | None
    sides: tuple[str, str]
    notes: tuple[str, ...] = ()
    ours: Ours | None = field(default=None, compare=False)


def case_of(candidates: Any, asked: Asked) -> Case:
    """The verdict on derivative pictures.

    candidates: (replicates, height, width, 3), or files, or a list of these, in W/sr/m2 per unit of
    the parameter; two or more with other seeds, or one without noise, which is told by its copies:
    give it twice.  Raises ImageError, SceneError, UsageError.
    """
    pictures = pictures_of(candidates)
    if len(pictures) < 2:
        raise UsageError(
            "a single derivative does not show its noise; expected two or more replicates"
        )
    wrong = np.stack([picture.radiance for picture in pictures])
    right = _right(asked, pictures)
    known = right.pictures
    mean = known.mean if isinstance(known, Known) else known.mean(axis=0)
    check_sizes(pictures, size_of(mean), "as the reference")
    if not np.isfinite(wrong).all():
        rung = RungResult("derivative", "invalid", "values of the candidate are not finite")
        verdict, reason = decide([rung], None)
        return Case(asked.name, verdict, reason, (rung,), None, {}, sides=right.sides)
    allowed = Margins()
    if right.truncation is not None:
        allowed = margins(right.truncation, side_of(known, signed=True).size)
    rung = judged(wrong, known, asked.limit, allowed)
    cause = None
    if rung.status == "differ" and not isinstance(known, Known):
        cause = likeliest(right.ours, known, wrong, allowed, None)
    error = standard_error(wrong, known)
    verdict, reason = decide([rung], None)
    return Case(
        asked.name,
        verdict,
        reason,
        (rung,),
        None,
        {},
        images=Images(wrong.mean(axis=0), mean, error),
        notes=right.notes,
        sides=right.sides,
        cause=cause,
    )


def gate_derivative(
    pictures: Any,
    *,
    scene: Scene | str | os.PathLike[str] | None = None,
    parameter: str = "",
    closed: FloatArray | None = None,
    primal: Primal | None = None,
    at: float | None = None,
    step: float | None = None,
    limit: float = LIMIT,
    threads: int | None = None,
) -> NotebookCase:
    """Judge derivatives of pictures by another renderer; Mitsuba takes no part.

    pictures: derivatives (replicates, height, width, 3), two or more, or files of these, in
    W/sr/m2 per unit of the parameter.  They are compared with differences of our pictures of
    `scene`, or a scene's file, by `parameter`, a path such as materials.red.reflectance; or with
    `closed`, the exact derivative (height, width, 3); or with differences of the renderer's own
    pictures about `at`: primal(value, seed) gives one (height, width, 3), with the same random
    numbers for the same seed.  step: of the differences, in the parameter's unit;  limit: the
    smallest bias of the image mean, over the derivative's size, that must be detectable.

    The case has `verdict`, `reason`, `cause` and `write_page`.  Raises ImageError, SceneError,
    UsageError.
    """
    known = scene if scene is None or isinstance(scene, Scene) else Scene.load(os.fspath(scene))
    asked = Asked(known, parameter, closed, primal, at, step, limit, threads)
    return NotebookCase.of(case_of(pictures, asked))


def _right(asked: Asked, candidates: Sequence[Picture]) -> _Right:
    """Raises SceneError, UsageError, ImageError."""
    if asked.closed is not None:
        exact = np.asarray(asked.closed, dtype=np.float64)
        return _Right(Known(exact, np.zeros_like(exact)), None, ("candidate's", "the formula's"))
    if asked.primal is not None:
        return _of_primal(asked)
    assert asked.scene is not None
    film = asked.scene.film
    check_sizes(candidates, f"{film.width} x {film.height}", "as the scene")
    ours = Ours(asked.scene, asked.parameter, asked.step, asked.threads)
    pictures = ours.replicates(REPLICATES)
    return _Right(pictures, ours.truncation, ("candidate's", "ours"), ours.notes(), ours)


def _of_primal(asked: Asked) -> _Right:
    """Central differences of the caller's pictures, and of one pair at twice the step."""
    primal, at = asked.primal, asked.at
    assert primal is not None
    assert at is not None
    step = asked.step or STEP * (abs(at) or 1.0)

    def difference(seed: int, h: float) -> FloatArray:
        pair = [np.asarray(primal(at + x, seed), np.float64) for x in (h, -h)]
        for picture in pair:
            if picture.ndim != 3 or picture.shape[-1] != 3 or picture.shape != pair[0].shape:
                raise ImageError(f"primal: got the shape {picture.shape}; expected (h, w, 3)")
        return np.asarray((pair[0] - pair[1]) / (2.0 * h))

    pictures = np.stack([difference(seed, step) for seed in range(REPLICATES)])
    truncation = (difference(0, 2.0 * step) - pictures[0]) / 3.0
    sides = ("candidate's", "its own pictures' differences")
    notes = (f"central differences of the renderer's own pictures with a step of {step:.3g}",)
    return _Right(pictures, truncation, sides, notes)
