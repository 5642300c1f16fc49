"""The pictures of a case by ours and by the other renderers."""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from comparisons.renderers import PLACES, NoCounterpartError, Renderer, other
from comparisons.truth.case import Case, FloatArray
from comparisons.truth.judge import judge
from comparisons.truth.outputs import Row
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.util.errors import ReferenceUnavailableError

RENDERERS = ("ours", *PLACES)

REPLICATES = 4
"""Pictures of each renderer: the fewest whose spread tells the noise of tiles (48 degrees of
freedom)."""


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


def by(
    renderer: Renderer, scene: Scene, replicates: int = REPLICATES, threads: int | None = None
) -> FloatArray:
    """The same by another renderer.  Raises NoCounterpartError, ReferenceUnavailableError."""
    with renderer.load(scene, threads) as loaded:
        return loaded.render(replicates, scene.resolved_sampler.spp, _seed(scene)).pictures


def row_of(
    case: Case,
    scene: Scene,
    who: Sequence[str],
    replicates: int = REPLICATES,
    threads: int | None = None,
) -> list[Row]:
    """The verdicts on a case by these renderers."""
    expected = case.compute()
    rows = []
    for name in who:
        start = time.perf_counter()
        try:
            if name == "ours":
                pictures = ours(scene, replicates, threads)
            else:
                pictures = by(other(name), scene, replicates, threads)
        except (NoCounterpartError, ReferenceUnavailableError) as error:
            rows.append(Row(case, name, "not comparable", str(error)))
            continue
        seconds = time.perf_counter() - start
        verdict = judge(expected, pictures)
        rows.append(Row.of(case, name, verdict, expected, pictures, seconds))
    return rows
