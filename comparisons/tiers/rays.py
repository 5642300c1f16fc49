"""The rays that the rungs compare: of the camera, at random, and from what was hit."""

from typing import NamedTuple

import numpy as np

from comparisons.tiers.bounds import ShapeSizes, largest, round32
from comparisons.tiers.camera import camera_rays, pixel_centres
from reference_rt import query
from reference_rt.scene import Scene
from reference_rt.shapes.shape import FloatArray
from reference_rt.tables import SceneTables

RAY_EPSILON = 1500.0 * 2.0**-24
"""Mitsuba's `math::RayEpsilon`: rays that leave a surface begin (1 + max |p|) times this off it."""

SHADOW_EPSILON = 10.0 * RAY_EPSILON
"""Mitsuba's `math::ShadowEpsilon`: shadow rays end this fraction of their length early."""


class Rays(NamedTuple):
    """Origins and directions (n, 3), float32 values held in float64."""

    o: FloatArray
    d: FloatArray


def pixel_rays(scene: Scene, most: int) -> Rays:
    """Camera rays through at most `most` pixel centres, as float32 holds them."""
    o, d = camera_rays(scene, *pixel_centres(scene.film, most))
    return Rays(round32(o), round32(d))


def mixed_rays(scene: Scene, tables: SceneTables, sizes: ShapeSizes, most: int, seed: int) -> Rays:
    """At most `most` camera rays, as many random ones through the scene's bounds, and one in a
    random direction from each camera ray's hit."""
    camera = pixel_rays(scene, most)
    if len(scene.shapes) == 0:
        return camera
    rng = np.random.default_rng(seed)
    n = len(camera.o)
    margin = 0.1 * (sizes.upper - sizes.lower)  # so that some begin outside
    start, end = rng.uniform(sizes.lower - margin, sizes.upper + margin, (2, n, 3))
    hits = query.intersect(tables, camera.o, camera.d)
    hit = hits.shape >= 0
    out = rng.normal(size=(n, 3))[hit]
    # Off the surface as far as Mitsuba's own rays: an origin within float32's error of a surface
    # would be on no defined side of it.
    side = np.sign(np.sum(out * hits.n[hit], axis=1))
    height = side * (1.0 + largest(hits.p[hit])) * RAY_EPSILON
    from_hits = hits.p[hit] + hits.n[hit] * height[:, None]
    d = np.concatenate([end - start, out])
    d /= np.linalg.norm(d, axis=1)[:, None]
    return Rays(
        np.concatenate([camera.o, round32(start), round32(from_hits)]),
        np.concatenate([camera.d, round32(d)]),
    )
