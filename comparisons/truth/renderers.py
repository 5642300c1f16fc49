"""The pictures of a case by ours, by other renderers and by anybody, and the verdicts on them."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from comparisons.gate.driver import Command, Driver, RendererError
from comparisons.gate.pictures_in import Picture
from comparisons.gate.reference import stacked
from comparisons.renderers import PLACES, NoCounterpartError, Renderer, other
from comparisons.truth.case import Case, Derivative, Expected, FloatArray
from comparisons.truth.judge import judge
from comparisons.truth.outputs import Row
from reference_rt.rendering.derivative import derivative
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.util.errors import ImageError, ReferenceUnavailableError

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


# ---- derivatives --------------------------------------------------------------------------------


class Estimate(Protocol):
    """replicates (replicates, height, width, 3): independent estimates of a derivative;  truncation
    (height, width, 3): an estimate of what a step adds to them, 0 without one."""

    @property
    def replicates(self) -> FloatArray: ...

    @property
    def truncation(self) -> FloatArray: ...


Differentiated = Callable[[Derivative, Scene, int | None], Estimate]
"""A renderer's derivative of a scene by a case's parameter, with so many threads.  Raises
NoCounterpartError, ReferenceUnavailableError."""


def our_derivative(case: Derivative, scene: Scene, threads: int | None = None) -> Estimate:
    return derivative(scene, case.parameter, spp=case.spp, step=case.step, threads=threads)


@dataclass(frozen=True)
class _Exact:
    """Replicates that no step adds anything to."""

    replicates: FloatArray

    @property
    def truncation(self) -> FloatArray:
        return np.zeros(self.replicates.shape[1:])


def mitsubas_derivative(case: Derivative, scene: Scene, threads: int | None = None) -> Estimate:
    """By forward mode of `prb_projective`, which sees edges that move, without guiding: of its two
    ways one is wrong (`grid`), and one takes seconds for a picture (`octree`)."""
    from comparisons.mitsuba.backend import mitsuba
    from comparisons.translator.derivative import Differentiator, Moving

    plugin = Differentiator("prb_projective", "none").of(scene)
    moving = Moving(scene, case.parameter)
    integrator = mitsuba().load_dict(plugin)
    spp = max(1, (case.spp or scene.resolved_sampler.spp) // REPLICATES)
    return _Exact(np.stack([moving.forward(integrator, spp, k) for k in range(REPLICATES)]))


DIFFERENTIATED: dict[str, Differentiated] = {
    "ours": our_derivative,
    "mitsuba": mitsubas_derivative,
}


def derivative_rows(
    case: Derivative,
    scene: Scene,
    by: Mapping[str, Differentiated] = DIFFERENTIATED,
    threads: int | None = None,
) -> list[Row]:
    """The verdicts on a derivative by these renderers.  scene: that of `case.of`."""
    expected = case.compute()
    rows = []
    for name, differentiated in by.items():
        start = time.perf_counter()
        try:
            found = differentiated(case, scene, threads)
        except (NoCounterpartError, ReferenceUnavailableError) as error:
            rows.append(Row(case, name, "not comparable", str(error)))
            continue
        seconds = time.perf_counter() - start
        allowed = with_truncation(expected, found.truncation)
        verdict = judge(allowed, found.replicates)
        rows.append(Row.of(case, name, verdict, expected, found.replicates, seconds))
    return rows


def with_truncation(expected: Expected, truncation: FloatArray) -> Expected:
    """The formula with the truncation of a difference, of the whole picture, in its bound."""
    stated = expected.stated
    size = np.abs(expected.pixels[stated]).mean(axis=0)
    added = np.abs(truncation[stated].mean(axis=0))
    relative = (added[size > 0.0] / size[size > 0.0]).max(initial=0.0)
    return replace(expected, bound=float(expected.bound + relative))


CANDIDATE = "candidate"


def judged(case: Case, pictures: Sequence[Picture], seconds: float | None = None) -> Row:
    """The verdict on replicates.  Raises ImageError for pictures of different sizes."""
    for picture in pictures:
        if picture.quantised:
            reason = f"{picture.name} has 8 bits per channel; expected floats of linear radiance"
            return Row(case, CANDIDATE, "invalid", reason)
    expected, given = case.compute(), stacked(pictures)
    return Row.of(case, CANDIDATE, judge(expected, given), expected, np.asarray(given), seconds)


@dataclass(frozen=True)
class Driven:
    """Another renderer's command line; see `comparisons.gate.driver.Command`.

    scenes: the folder of scene files;  keep: the folder of its pictures;  spp: None for the
    scene's own;  seconds: time limit of a picture.
    """

    template: str
    scenes: Path
    keep: Path
    replicates: int = REPLICATES
    spp: int | None = None
    seed: int = 1
    suffix: str = ".exr"
    seconds: float = 600.0

    def row(self, case: Case, say: Callable[[str], None]) -> Row:
        """Run the renderer for a case: one that it cannot do is no error of the run.  Raises
        UsageError for a command that cannot be run at all, SceneError."""
        path = self.scenes / f"{case.name}.yaml"
        scene = Scene.load(path)
        size = scene.film.width, scene.film.height
        spp = self.spp or scene.resolved_sampler.spp
        command = Command(self.template, path, spp, self.suffix, self.seconds, size)
        driver = Driver(command, self.keep / case.name, lambda line: say(f"{case.name}: {line}"))
        start = time.perf_counter()
        try:
            pictures = driver.pictures(range(self.seed, self.seed + self.replicates))
            return judged(case, pictures, time.perf_counter() - start)
        except RendererError as error:
            return Row(case, CANDIDATE, "not run", str(error))
        except ImageError as error:
            return Row(case, CANDIDATE, "invalid", str(error))
