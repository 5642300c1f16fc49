"""Pictures of a reduced scene for the page: ours and Mitsuba's."""

import warnings
from pathlib import Path

import numpy as np

from comparisons.compare.pictures import mitsuba_cast
from comparisons.experiments.fuzz.data import Data
from comparisons.experiments.fuzz.generate import parse
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.mitsuba.translate import load
from comparisons.report.thumbnails import png_url
from comparisons.statistics.metrics import encode, white_level
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import RayCast, Whitted
from reference_rt.rendering.image import display
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid

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
