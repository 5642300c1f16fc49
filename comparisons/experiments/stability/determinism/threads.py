"""Pictures by any number of threads, ours and Mitsuba's."""

import importlib
from typing import Any

import reference_rt as rt
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.bits import on_threads, over, same_bits
from comparisons.experiments.stability.harness.core import MITSUBA, OURS, Draw, FloatArray, Outcome
from comparisons.mitsuba.backend import LLVM, SCALAR, backend, variant
from comparisons.mitsuba.scene import picture
from comparisons.mitsuba.translate import load

_module: Any = importlib.import_module("reference_rt.rendering.units")

Outcomes = dict[str, Outcome]

SMALL_BAND = 64


def threads(draw: Draw, x: float) -> Outcomes:
    """In bands so small that threads have something to share."""
    previous = _module.SAMPLES_PER_TILE
    _module.SAMPLES_PER_TILE = SMALL_BAND
    try:
        found = {OURS: over(draw, lambda s, _: (on_threads(s), on_threads(s, int(x))))}
    finally:
        _module.SAMPLES_PER_TILE = previous
    if draw.mitsuba:
        found[MITSUBA] = _mitsuba_threads(draw, SCALAR, rt.BoxFilter(), int(x))
    return found


def wide_filter(variant_name: str, draw: Draw, x: float) -> Outcomes:
    """Ours has no samples that pixels share: each pixel's filter draws its own."""

    def pictures(scene: rt.Scene, _: str) -> tuple[FloatArray, FloatArray]:
        wide = _filtered(scene, rt.GaussianFilter())
        return on_threads(wide), on_threads(wide, int(x))

    found = {OURS: over(draw, pictures)}
    if draw.mitsuba and (variant_name == SCALAR or backend().variant == LLVM):
        found[MITSUBA] = _mitsuba_threads(draw, variant_name, rt.GaussianFilter(), int(x))
    return found


def _filtered(scene: rt.Scene, film_filter: Any, **size: int) -> rt.Scene:
    return scene.changed(film=scene.film.model_copy(update={"filter": film_filter, **size}))


def _mitsuba_threads(draw: Draw, name: str, film_filter: Any, count: int) -> Outcome:
    """The path-traced scene, one seed: one thread, then others, each count three times."""
    import drjit as dr

    scene = _filtered(scenes.path(draw.folder), film_filter, width=96, height=72)
    with variant(name):
        mi_scene = load(scene).mi_scene
        before = dr.thread_count()
        try:
            dr.set_thread_count(1)
            first = picture(mi_scene, 4, seed=1)
            dr.set_thread_count(count)
            total = Outcome(0, 0)
            for _ in range(3):
                total += same_bits(first, picture(mi_scene, 4, seed=1))
        finally:
            dr.set_thread_count(before)
    return total
