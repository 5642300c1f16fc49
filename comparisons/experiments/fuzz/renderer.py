"""Another renderer in Mitsuba's place: its pictures of random scenes against ours."""

import tempfile
import time
from pathlib import Path

from comparisons.experiments.fuzz.check import FAILED, of_rung
from comparisons.experiments.fuzz.data import Data, text_of
from comparisons.experiments.fuzz.effort import Effort
from comparisons.experiments.fuzz.finding import Checked, Finding, without_numbers
from comparisons.experiments.fuzz.request import Request
from comparisons.experiments.fuzz.types import types_in
from comparisons.gate.driver import Command, Driver
from comparisons.gate.errors import RendererError
from comparisons.gate.reference import is_noise_free
from comparisons.gate.request import Request as GateRequest
from comparisons.gate.rounds import Rounds, gated_renderer
from comparisons.results.case import Case, RungResult
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ImageError, SceneError

SECONDS = 60.0
"""Time limit of one picture by the renderer."""

LIMIT = 0.05
"""The smallest relative bias that must be detectable: many scenes, each looked at briefly."""


def check_renderer(data: Data, request: Request, effort: Effort) -> Checked:
    """What another renderer makes of a scene: `request.command` with {scene}, {output}, and if it
    uses random numbers {seed} and {spp}.

    A difference counts if pictures with other random numbers show it too.  The scene's file lies
    beside the files that it names.
    """
    start = time.perf_counter()
    types = sorted(f"{kind}:{name}" for kind, name in types_in(data))
    found = Checked(number=request.number, types=types)
    path = request.files / f"scene-{request.number}.yaml"
    path.write_text(text_of(data), encoding="utf-8")
    try:
        scene = Scene.load(path)
        results = _failures(scene, path, request, effort, 1)
        if results and not is_noise_free(scene):
            results = _failures(scene, path, request, effort, 1001)
        found.rungs["renderer"] = "differ" if results else "agree"
        found.lit = True
        found.findings += [of_rung(result) for result in results[:1]]
    except SceneError as error:
        found.findings.append(Finding(rung="scene", cause="invalid", detail=str(error)))
    except (RendererError, ImageError) as error:
        cause = without_numbers(str(error).partition(";")[0])
        found.findings.append(Finding(rung="run", cause=cause, detail=str(error)))
    finally:
        path.unlink(missing_ok=True)
    found.seconds = time.perf_counter() - start
    return found


def _failures(
    scene: Scene, path: Path, request: Request, effort: Effort, seed: int
) -> list[RungResult]:
    noise_free = is_noise_free(scene)
    sampler = scene.resolved_sampler
    if not noise_free:
        scene = scene.changed(sampler=sampler.model_copy(update={"spp": effort.spp}))
    size = scene.film.width, scene.film.height
    command = Command(request.command, path, getattr(scene.resolved_sampler, "spp", 1), ".exr",
                      SECONDS, size)  # fmt: skip
    rounds = Rounds(seed, 1 if noise_free else effort.replicates, None)
    with tempfile.TemporaryDirectory(prefix="fuzz-renderer-") as kept:
        driver = Driver(command, Path(kept))
        gate = GateRequest(scene=scene, limit=LIMIT, threads=1, name=str(request.number))
        case: Case = gated_renderer(gate, driver, rounds)
    return [rung for rung in case.rungs if rung.status in FAILED]
