"""The pictures of a scene by both renderers, for each integrator."""

import time
from dataclasses import replace

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.judge import Rendered, of_replicates
from comparisons.compare.looks import Pool, mean_picture
from comparisons.compare.watched import Say, Watched
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import Images
from comparisons.rungs.layers.seen import Seen
from comparisons.rungs.rays.camera import camera_rays, ends
from comparisons.rungs.rays.plugin_trees import PluginTrees
from comparisons.rungs.rays.rays import Rays
from comparisons.statistics import replicates_asked
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.image import display
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.render import render
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
    hits = trace(counterpart, o, d, t_max=ends(scene, d))
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


def layers(
    scene: Scene, tables: SceneTables, counterpart: Counterpart
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Distances and shading normals of both sides, each (height, width, 3), by the rays through the
    pixels' centres; 0 for rays that miss."""
    film = scene.film
    y, x = np.mgrid[0 : film.height, 0 : film.width]
    o, d = camera_rays(scene, x.ravel() + 0.5, y.ravel() + 0.5)
    sides = query.intersect(tables, o, d), trace(counterpart, o, d)
    pairs = {}
    for name, values in (("distance", [h.t for h in sides]), ("normal", [h.ns for h in sides])):
        pair = [np.zeros((len(o), 3)), np.zeros((len(o), 3))]
        for picture, hits, some in zip(pair, sides, values, strict=True):
            hit = hits.shape >= 0
            picture[hit] = some.reshape(len(o), -1)[hit]
        pairs[name] = pair[0].reshape(*y.shape, 3), pair[1].reshape(*y.shape, 3)
    return pairs


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
    radiance = PluginTrees(scene, tables, counterpart, scene.integrator)
    t_max, pieces = ends(scene, rays.d), []
    for k in range(0, len(rays.o), AT_ONCE):
        piece = slice(k, k + AT_ONCE)
        pieces.append(radiance(Rays(rays.o[piece], rays.d[piece]), t_max[piece]))
    samples = np.concatenate(pieces).reshape(height, n, width, n, 3)
    return np.asarray(samples.mean(axis=(1, 3)))


AT_ONCE = 1 << 18
"""Rays per call of the plugin: its recursion takes many times their memory."""


_BATCH = 16
"""Pictures by Mitsuba that are in memory before they are averaged."""


class Replicates:
    """Path tracing: pictures by each renderer with independent seeds, as many as are asked for."""

    def __init__(
        self,
        scene: Scene,
        tables: SceneTables,
        counterpart: Counterpart,
        budget: Budget,
        threads: int | None,
        most: int,
        say: Say,
    ) -> None:
        """budget: has Mitsuba's samples and their sampler, which `counterpart` has, too;  threads:
        ours;  most: see `comparisons.compare.looks.Pool`;  say: is shown the pictures as they grow
        if it is `Watched`."""
        self._watch = say.pictures if isinstance(say, Watched) else None
        self._scene, self._tables, self._counterpart = scene, tables, counterpart
        self._threads, self._sampler = threads, scene.resolved_sampler
        self._reference_spp = budget.reference_spp or self._sampler.spp
        self._reference_sampler = budget.reference_sampler
        self._sides = Pool(most, mean_picture), Pool(most, mean_picture)
        self._times: list[dict[str, float]] = []
        self._mitsuba_times: list[float] = []
        self._taken = self._reference_spp

    def grow(self, count: int) -> None:
        """Render until there are `count` replicates of each side."""
        ours, theirs = self._sides
        made = len(ours)
        seed = getattr(self._sampler, "seed", 0)
        for begun in range(made, count, _BATCH):
            rendered = mitsuba_scene.render(
                self._counterpart.mi_scene,
                min(_BATCH, count - begun),
                self._reference_spp,
                seed + begun,
                self._reference_sampler,
                warm_up=begun == 0,
            )
            for other in rendered.pictures:
                theirs.add(other)
            self._grown()
            self._mitsuba_times += rendered.seconds.tolist()
            self._taken = rendered.spp
        for k in range(made, count):
            seeded = self._scene.changed(
                sampler=self._sampler.model_copy(update={"seed": seed + k})
            )
            picture = render(seeded, tables=self._tables, threads=self._threads)
            ours.add(picture.colour)
            self._times.append(picture.seconds)
            self._grown()

    def _grown(self) -> None:
        if self._watch is not None:
            self._watch(*(side.pictures() for side in self._sides))

    @property
    def count(self) -> int:
        """The replicates of each side."""
        return len(self._sides[0])

    def asked(self, limit: float, level: float) -> int:
        """How many replicates it takes to see a bias of `limit` at a look with this share of the
        levels, by the noise of those that there are."""
        kept = self._sides[0].pictures()
        each = self.count // len(kept)
        ours, theirs = (np.stack(side.pictures()) for side in self._sides)
        return each * replicates_asked(ours, theirs, limit, level)

    def rendered(self) -> Rendered:
        """What there is so far; the images are its means.  seconds["render"] is the median time of
        one picture."""
        times = self._times
        seconds = {
            "candidate": {
                "compile": times[0]["compile"],
                "render": float(np.median([t["render"] for t in times])),
            },
            "reference": {"render": float(np.median(self._mitsuba_times))},
        }
        ours, theirs = self._sides
        note = (
            f"{self.count} pictures by each renderer, of {self._sampler.spp} samples per pixel "
            f"({self._sampler.type}) and of {self._taken} (Mitsuba's {self._reference_sampler})"
        )
        made = of_replicates(np.stack(ours.pictures()), np.stack(theirs.pictures()), seconds)
        return replace(made, notes=(note,))


def _seconds(ours: Picture, mitsuba: float) -> dict[str, dict[str, float]]:
    times = {step: ours.seconds[step] for step in ("compile", "render")}
    return {"candidate": times, "reference": {"render": mitsuba}}
