"""The gate of truth: anybody's pictures against the formula, with no second renderer."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from comparisons.gate.driver import Command, Driver, RendererError
from comparisons.gate.pictures_in import Picture
from comparisons.gate.reference import stacked
from comparisons.truth.case import Case
from comparisons.truth.judge import judge
from comparisons.truth.outputs import Row
from comparisons.truth.renderers import REPLICATES
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ImageError

CANDIDATE = "candidate"


def judged(case: Case, pictures: Sequence[Picture], seconds: float | None = None) -> Row:
    """The verdict on replicates.  Raises ImageError for pictures of different sizes."""
    for picture in pictures:
        if picture.quantised:
            reason = f"{picture.name} has 8 bits per channel; expected floats of linear radiance"
            return Row(case, CANDIDATE, "invalid", reason)
    expected, found = case.compute(), stacked(pictures)
    return Row.of(case, CANDIDATE, judge(expected, found), expected, np.asarray(found), seconds)


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
