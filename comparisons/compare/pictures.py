"""The pictures of a scene by both renderers, for each integrator."""

import time

import numpy as np

from comparisons.compare.judge import Rendered, of_replicates
from comparisons.geometry.sizes import ShapeSizes
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.results.case import Images
from comparisons.rungs.layers.seen import Seen
from comparisons.rungs.rays.camera import camera_rays
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.whitted import plugin_radiance
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.image import display
from reference_rt.rendering.render import Picture, render
from reference_rt.rendering.scene import Scene


def cast(scene: Scene, tables: SceneTables, counterpart: Counterpart) -> Rendered:
    """Ray casting: the displayed layer; Mitsuba's is made from its own hits of the same rays."""
    ours = render(scene, tables=tables)
    start = time.perf_counter()
    theirs, notes = mitsuba_cast(scene, counterpart, ours)
    seconds = _seconds(ours, time.perf_counter() - start)
    return Rendered(Images(display(ours), theirs), seconds, notes=notes)


def mitsuba_cast(
    scene: Scene, counterpart: Counterpart, ours: Picture
) -> tuple[FloatArray, tuple[str, ...]]:
    """The layer that `ours` shows, as displayed (height, width, 3), made from Mitsuba's hits of the
    rays through the pixel centres; and notes for the reader."""
    film = scene.film
    y, x = np.mgrid[0 : film.height, 0 : film.width]
    o, d = camera_rays(scene, x.ravel() + 0.5, y.ravel() + 0.5)
    hits = trace(counterpart, o, d)
    notes = [f"the pictures show the layer '{ours.shown}' in display values, not radiance"]
    uv = np.where(hits.has_uv[:, None], hits.uv, ours.layers["uv"].reshape(-1, 2))
    if ours.shown == "uv" and not hits.has_uv[hits.shape >= 0].all():
        notes.append(
            "Mitsuba has different uv, or none, on some shapes: both pictures show ours there"
        )
    layers = {
        "colour": Seen(scene, ShapeSizes(scene)).colours(hits, of_vertices=True),
        "distance": hits.t,
        "normal": np.where(hits.stands_in[:, None], hits.ns, hits.n),
        "id": hits.shape.astype(np.float64),
        "uv": uv,
    }
    shaped = {k: v.reshape(film.height, film.width, *v.shape[1:]) for k, v in layers.items()}
    return display(Picture(shaped, ours.shown)), tuple(notes)


def whitted(scene: Scene, tables: SceneTables, counterpart: Counterpart) -> Rendered:
    """Recursive ray tracing: our plugin for Mitsuba traces the rays of our grid of samples."""
    ours = render(scene, tables=tables)
    start = time.perf_counter()
    theirs = mitsuba_whitted(scene, tables, counterpart)
    return Rendered(Images(ours.colour, theirs), _seconds(ours, time.perf_counter() - start))


def mitsuba_whitted(scene: Scene, tables: SceneTables, counterpart: Counterpart) -> FloatArray:
    """The picture (height, width, 3) by our plugin for Mitsuba."""
    assert isinstance(scene.integrator, Whitted)
    n = round(scene.resolved_sampler.spp**0.5)
    height, width = scene.film.height, scene.film.width
    y, x = np.mgrid[0 : height * n, 0 : width * n]
    rays = Rays(*camera_rays(scene, (x.ravel() + 0.5) / n, (y.ravel() + 0.5) / n))
    # Few large pieces: Dr.Jit traces the plugin anew for each.
    radiance = plugin_radiance(scene, tables, counterpart, scene.integrator)
    pieces = [
        radiance(Rays(rays.o[k : k + AT_ONCE], rays.d[k : k + AT_ONCE]))
        for k in range(0, len(rays.o), AT_ONCE)
    ]
    samples = np.concatenate(pieces).reshape(height, n, width, n, 3)
    return np.asarray(samples.mean(axis=(1, 3)))


AT_ONCE = 1 << 18
"""Rays per call of the plugin: its recursion takes many times their memory."""


def replicates(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    count: int,
    reference_spp: int | None,
    threads: int | None,
) -> Rendered:
    """Path tracing: `count` pictures by each renderer with independent seeds; the images are their
    means.  seconds["render"] is the median time of one picture."""
    sampler = scene.resolved_sampler
    first = getattr(sampler, "seed", 0)
    ours, times = [], []
    for k in range(count):
        seeded = scene.changed(sampler=sampler.model_copy(update={"seed": first + k}))
        picture = render(seeded, tables=tables, threads=threads)
        ours.append(picture.colour)
        times.append(picture.seconds)
    theirs = mitsuba_scene.render(counterpart.mi_scene, count, reference_spp or sampler.spp, first)
    seconds = {
        "candidate": {
            "compile": times[0]["compile"],
            "render": float(np.median([t["render"] for t in times])),
        },
        "reference": {"render": float(np.median(theirs.seconds))},
    }
    return of_replicates(np.stack(ours), theirs.pictures, seconds)


def _seconds(ours: Picture, mitsuba: float) -> dict[str, dict[str, float]]:
    times = {step: ours.seconds[step] for step in ("compile", "render")}
    return {"candidate": times, "reference": {"render": mitsuba}}
