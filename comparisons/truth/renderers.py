"""The pictures of a case by ours, by Mitsuba and by Cycles."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from comparisons.cycles.backend import Cycles
from comparisons.cycles.surfaces import IneligibleError
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.translate import UntranslatableError, to_mitsuba
from comparisons.truth.case import Case, FloatArray
from comparisons.truth.judge import judge
from comparisons.truth.outputs import Row
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.shapes.shape import Solid

Renderer = Literal["ours", "mitsuba", "cycles"]

RENDERERS: tuple[Renderer, ...] = ("ours", "mitsuba", "cycles")

REPLICATES = 4
"""Pictures of each renderer: the fewest whose spread tells the noise of tiles (48 degrees of
freedom)."""


class NoCounterpartError(Exception):
    """Another renderer cannot show the scene, or is not judged by it."""


def load(path: Path, spp: int | None = None) -> Scene:
    """The scene of a case.  spp: samples per pixel, None: its own.  Raises SceneError."""
    scene = Scene.load(path)
    return scene if spp is None else _sampled(scene, {"spp": spp})


def _sampled(scene: Scene, update: dict[str, int]) -> Scene:
    return scene.changed(sampler=scene.resolved_sampler.model_copy(update=update))


def _seed(scene: Scene) -> int:
    return getattr(scene.resolved_sampler, "seed", 0)


def ours(scene: Scene, replicates: int = REPLICATES, threads: int | None = None) -> FloatArray:
    """(replicates, height, width, 3), with the scene's seed and the following ones."""
    tables, first = build_tables(scene), _seed(scene)
    pictures = [
        render(_sampled(scene, {"seed": first + k}), tables=tables, threads=threads).colour
        for k in range(replicates)
    ]
    return np.stack(pictures)


def by_mitsuba(scene: Scene, replicates: int = REPLICATES) -> FloatArray:
    """The same by Mitsuba's own plugins: none of those by which we make it more exact.

    In its scalar variant: for pictures as small as these the others compile longer than it renders.
    Raises NoCounterpartError.
    """
    if any(isinstance(s, Solid) for s in scene.shapes):
        raise NoCounterpartError("Mitsuba has no solids")
    spp, first = scene.resolved_sampler.spp, _seed(scene)
    with scalar():
        try:
            mi_scene = mitsuba().load_dict(to_mitsuba(scene, native=True))
        except UntranslatableError as error:
            raise NoCounterpartError(str(error)) from None
        pictures = [mitsuba_scene.picture(mi_scene, spp, first + k) for k in range(replicates)]
    return np.stack(pictures)


def by_cycles(scene: Scene, replicates: int = REPLICATES) -> FloatArray:
    """The same by Cycles, where it computes what we do.  Raises NoCounterpartError,
    ReferenceUnavailableError."""
    try:
        with Cycles(scene) as cycles:
            return cycles.render(replicates, scene.resolved_sampler.spp, _seed(scene))
    except IneligibleError as error:
        raise NoCounterpartError(f"Cycles has no equal of {error}") from None


def row_of(
    case: Case,
    scene: Scene,
    who: Sequence[Renderer],
    replicates: int = REPLICATES,
    threads: int | None = None,
) -> list[Row]:
    """The verdicts on a case by these renderers."""
    expected = case.compute()
    rows = []
    for renderer in who:
        start = time.perf_counter()
        try:
            match renderer:
                case "ours":
                    pictures = ours(scene, replicates, threads)
                case "mitsuba":
                    pictures = by_mitsuba(scene, replicates)
                case "cycles":
                    pictures = by_cycles(scene, replicates)
        except NoCounterpartError as error:
            rows.append(Row(case, renderer, "not comparable", str(error)))
            continue
        seconds = time.perf_counter() - start
        verdict = judge(expected, pictures)
        rows.append(Row.of(case, renderer, verdict, expected, pictures, seconds))
    return rows
