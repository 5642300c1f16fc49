"""`python -m comparisons.experiments.fuzz.worker`: a process that checks and reduces scenes.

It follows `comparisons.runs.processes`: it reads `Request`s and stores results in their
folders.  Mitsuba runs in its scalar variant, unless another one is asked for: for a few hundred
rays of a scene that is seen once, a variant that compiles takes several times as long (measured:
2 s against 9 s a scene)."""

import os
import time
import warnings
from pathlib import Path

import numpy as np

from comparisons.compare.pictures import mitsuba_cast
from comparisons.experiments.fuzz import assets, random_files, results
from comparisons.experiments.fuzz.check import FAILED, check, of_rung
from comparisons.experiments.fuzz.data import Data, text_of
from comparisons.experiments.fuzz.finding import (
    Checked,
    Effort,
    Finding,
    Reduced,
    Request,
    without_numbers,
)
from comparisons.experiments.fuzz.generate import generate, parse
from comparisons.experiments.fuzz.reduce import reduce
from comparisons.experiments.fuzz.schema import types_in
from comparisons.gate.driver import Command, Driver, RendererError
from comparisons.gate.reference import is_noise_free
from comparisons.gate.request import Request as GateRequest
from comparisons.gate.rounds import Rounds, gated_renderer
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.mitsuba.backend import FORCE
from comparisons.report.thumbnails import png_url
from comparisons.results.case import Case, RungResult
from comparisons.runs.processes import serve
from comparisons.statistics.metrics import encode, white_level
from comparisons.translator import load
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import RayCast, Whitted
from reference_rt.rendering.image import display
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.util.errors import ImageError, SceneError
from reference_rt.util.files import temporary_folder

# ---- pictures for the page ----------------------------------------------------------------------


SIZE = 64
"""Pixels of the longer side."""

SPP = 16


def pictures_of(data: Data, folder: Path) -> dict[str, str]:
    """PNGs as data: URLs by whose they are; fewer where a side cannot make one."""
    found: dict[str, str] = {}
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            scene = _sized(parse(data, "picture", folder))
            found["ours"] = _png(ours(scene))
            found["Mitsuba's"] = _png(theirs(scene))
        except Exception:  # a finding may be that there is no picture
            return found
    return found


def _sized(scene: Scene) -> Scene:
    film = scene.film
    factor = SIZE / max(film.width, film.height)
    size = {
        "width": max(1, round(factor * film.width)),
        "height": max(1, round(factor * film.height)),
    }
    scene = scene.changed(film=film.model_copy(update={**size, "layers": ()}))
    if scene.integrator.deterministic:
        return scene
    return scene.changed(sampler=scene.resolved_sampler.model_copy(update={"spp": SPP}))


def ours(scene: Scene) -> FloatArray:
    """Our picture, as radiance or as displayed values."""
    picture = render(scene, threads=1)
    return display(picture) if isinstance(scene.integrator, RayCast) else picture.colour


def theirs(scene: Scene) -> FloatArray:
    """Mitsuba's; for Whitted ray tracing, what is hit: our plugin is slow in scalar variants."""
    counterpart = load(scene)
    if isinstance(scene.integrator, RayCast | Whitted) or counterpart.no_pictures_reason:
        cast = scene.changed(integrator=RayCast(show="normal"), sampler=Grid())
        return mitsuba_cast(cast, counterpart, render(cast, threads=1))[0]
    return mitsuba_scene.picture(counterpart.mi_scene, SPP, 1)


def _png(picture: FloatArray) -> str:
    good = np.isfinite(picture).all(axis=-1, keepdims=True)
    shown = np.where(good, picture, 0.0)
    return png_url(255.0 * encode(shown, white_level(shown)))


# ---- another renderer in Mitsuba's place --------------------------------------------------------


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
    with temporary_folder() as kept:
        driver = Driver(command, kept)
        gate = GateRequest(scene=scene, limit=LIMIT, threads=1, name=str(request.number))
        case: Case = gated_renderer(gate, driver, rounds)
    return [rung for rung in case.rungs if rung.status in FAILED]


# ---- the process --------------------------------------------------------------------------------


MORE = 3
"""Times as many rays as the scene's check are traced while a finding is reduced: it must not
hang on which rays are drawn."""


def main() -> None:
    """Handle requests until standard input ends."""
    serve(Request, carry_out)


def carry_out(asked: Request) -> None:
    """Check or reduce a scene; the first one chooses Mitsuba's variant, and all of a run have the
    same."""
    os.environ.setdefault(FORCE, asked.effort.variant)
    (do_scene if asked.task == "scene" else do_reduce)(asked)


def checked(request: Request, scene: Data, effort: Effort) -> Checked:
    """What is found in a scene, with Mitsuba or with another renderer."""
    if request.command:
        return check_renderer(scene, request, effort)
    return check(scene, request.number, effort, request.files)


def scene_of(request: Request) -> Data:
    """The scene of a request."""
    if request.scene is not None:
        return request.scene
    if request.effort.rungs == random_files.ALONE:
        return random_files.scene(request.seed, request.number, request.files)
    return generate(request.seed, request.number, request.grammar, request.files)


def do_scene(request: Request) -> None:
    """Check a scene and store what is found."""
    assets.write(request.files)
    scene = scene_of(request)
    found = checked(request, scene, request.effort)
    results.add(request.out, found)
    is_ours = request.scene is None and request.effort.rungs == random_files.ALONE
    if is_ours and not found.findings:
        for name in assets.named(scene):
            (request.files / name).unlink()


def do_reduce(request: Request) -> None:
    """Reduce a finding and store it, also if nothing could be left out."""
    assets.write(request.files)
    finding = request.finding
    assert finding is not None
    effort = effort_for(request.effort, finding)
    latest = [finding]

    def fails(candidate: Data) -> bool:
        again = next((f for f in checked(request, candidate, effort).findings), None)
        if again is None or not alike(again, finding):
            return False
        latest[0] = again
        return True

    scene = scene_of(request)
    if not fails(scene):
        effort = request.effort
    found = reduce(scene, fails, seconds=request.seconds)
    fails(found.scene)
    results.add(
        request.out,
        Reduced(
            number=request.number,
            finding=latest[0],
            scene=found.scene,
            tried=found.tried,
            pixels=effort.pixels,
            types=sorted(f"{kind}:{name}" for kind, name in types_in(found.scene)),
            pictures=pictures_of(found.scene, request.files),
        ),
    )


def effort_for(effort: Effort, finding: Finding) -> Effort:
    """Only the rung that failed, with more rays."""
    rung = "identities" if finding.rung.startswith("identity") else finding.rung
    rung = {"images": "statistics", "scene": "render", "compare": "geometry"}.get(rung, rung)
    # Statistics may show again what a rung below them found.
    return effort.model_copy(
        update={
            "rungs": (rung,),
            "pixels": MORE * effort.pixels,
            "light_pixels": MORE * effort.light_pixels,
            "identity_rays": MORE * effort.identity_rays,
            "every": 1,
        }
    )


def alike(one: Finding, other: Finding) -> bool:
    """Whether two findings have the same rung and cause; which numbers of a hit differ may change
    while a scene becomes smaller, who is right may not."""
    if one.rung != other.rung:
        return False
    return one.cause.partition(":")[0] == other.cause.partition(":")[0]


if __name__ == "__main__":
    main()
