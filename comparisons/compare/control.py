"""Mitsuba against itself, in another variant and with other seeds: a difference is a fault of the
harness or of Mitsuba, not of reference_rt."""

import math
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from comparisons.compare import pictures
from comparisons.compare.budget import Budget
from comparisons.compare.darkness import why_dark
from comparisons.compare.judge import Evidence, Rendered, judge, of_replicates
from comparisons.mitsuba import backend
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.results.case import Case, Images, RungResult
from comparisons.translator import UntranslatableError, load
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import RayCast, Whitted
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

MOST_PIXELS = 64 * 48
"""Size limit of pictures without noise: scalar variants trace their rays one by one in Python."""


def control(scene: Scene, budget: Budget, say: Callable[[str], None]) -> Case:
    """Compare the pictures of a scene by two of Mitsuba's variants.  Raises SceneError,
    ReferenceUnavailableError."""
    if scene.integrator.deterministic:
        scene = smaller(scene)
    chosen = backend.backend().variant
    variants = {"candidate": backend.SCALAR, "reference": chosen}
    replicates: list[FloatArray] = []
    seconds: dict[str, dict[str, float]] = {}
    sides = (f"Mitsuba's {backend.SCALAR}", f"Mitsuba's {chosen}")
    rungs: tuple[RungResult, ...] = ()
    rendered = None
    try:
        for number, (side, variant) in enumerate(variants.items()):
            start = time.perf_counter()
            with backend.variant(variant):
                # The candidate's seeds must not overlap the reference's.
                replicates.append(of_seeds(scene, budget, (1 - number) * 100_000))
            seconds[side] = {"render": time.perf_counter() - start}
            say(f"{variant}: {seconds[side]['render']:.1f} s")
    except (UntranslatableError, NoLightError) as error:
        rungs = (RungResult("statistics", "not-comparable", str(error)),)
    else:
        if scene.integrator.deterministic:
            rendered = Rendered(Images(replicates[0][0], replicates[1][0]))
        else:
            rendered = of_replicates(replicates[0], replicates[1], seconds)
    darkness = partial(why_dark, scene)
    name = f"{scene.name} (control)"
    evidence = Evidence(name, rungs, rendered, seconds, sides=sides, darkness=darkness)
    return judge(evidence, budget.limit)


def smaller(scene: Scene) -> Scene:
    """The scene with at most MOST_PIXELS, of about the same aspect ratio."""
    film = scene.film
    factor = min(1.0, math.sqrt(MOST_PIXELS / (film.width * film.height)))
    sides = {side: max(1, round(factor * getattr(film, side))) for side in ("width", "height")}
    return scene.changed(film=film.model_copy(update=sides))


class NoLightError(Exception):
    """The scene has no counterpart in Mitsuba that can be lit."""


def of_seeds(scene: Scene, budget: Budget, seed: int) -> FloatArray:
    """(replicates, height, width, 3) by the active variant; one replicate if deterministic."""
    counterpart = load(scene)
    if isinstance(scene.integrator, RayCast):
        return pictures.mitsuba_cast(scene, counterpart, render(scene))[0][np.newaxis]
    if counterpart.no_light_reason:
        raise NoLightError(counterpart.no_light_reason)
    if isinstance(scene.integrator, Whitted):
        return pictures.mitsuba_whitted(scene, build_tables(scene), counterpart)[np.newaxis]
    if counterpart.no_pictures_reason:
        raise NoLightError(counterpart.no_pictures_reason)
    spp = scene.resolved_sampler.spp
    return mitsuba_scene.render(counterpart.mi_scene, budget.replicates, spp, seed).pictures
