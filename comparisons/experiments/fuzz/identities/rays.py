"""The scene before it is changed: its picture, random rays, and their hits."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from comparisons.geometry.sizes import ShapeSizes
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene


class Bench(NamedTuple):
    """A scene's rays o, d (n, 3), of which some start on surfaces, and their first hits;  size: of
    the largest coordinate that matters."""

    tables: SceneTables
    o: FloatArray
    d: FloatArray
    hits: Intersections
    size: float


def bench(scene: Scene, rng: np.random.Generator, n: int) -> Bench:
    """A third from the eye, a third between random points, a third from where those hit."""
    tables = scene.tables
    sizes = ShapeSizes(scene)
    eye = np.array(scene.camera.eye)
    finite = np.isfinite(sizes.lower) & np.isfinite(sizes.upper)
    lower = np.where(finite, np.minimum(sizes.lower, eye), eye - 1.0)
    upper = np.where(finite, np.maximum(sizes.upper, eye), eye + 1.0)
    few = n // 3
    target = rng.uniform(lower, upper, (few, 3))
    o = np.concatenate([np.tile(eye, (few, 1)), rng.uniform(lower, upper, (few, 3))])
    d = np.concatenate([target - eye, rng.uniform(lower, upper, (few, 3)) - o[few:]])
    first = query.intersect(tables, o, d)
    met = np.flatnonzero(first.shape >= 0)[:few]
    o = np.concatenate([o, first.p[met] + 1e-3 * (upper - lower).max() * first.n[met]])
    d = np.concatenate([d, rng.normal(size=(len(met), 3))])
    kept = np.any(d != 0.0, axis=1)
    o, d = o[kept], d[kept]
    size = float(np.abs([lower, upper]).max())
    return Bench(tables, o, d, query.intersect(tables, o, d), size)


class Original:
    """The scene before it is changed;  rng: draws the changes and the rays;  rays: how many.  The
    picture and the hits of rays are computed once for all identities."""

    def __init__(self, scene: Scene, rng: np.random.Generator, rays: int) -> None:
        self.scene, self.rng, self.rays = scene, rng, rays

    @cached_property
    def picture(self) -> Picture:
        return render(self.scene, threads=1, tables=self.scene.tables)

    @cached_property
    def bench(self) -> Bench:
        return bench(self.scene, self.rng, self.rays)


def words(hits: Intersections, k: int) -> str:
    """A hit, for people."""
    if hits.shape[k] < 0:
        return "nothing"
    return (
        f"shape {hits.shape[k]}, part {hits.part[k]}, primitive {hits.primitive[k]}, "
        f"t = {float(hits.t[k])!r}, n = {hits.n[k].tolist()}"
    )


def ray_words(at: Bench, k: int) -> str:
    """A ray, for people."""
    return f"the ray from {at.o[k].tolist()} along {at.d[k].tolist()}"
