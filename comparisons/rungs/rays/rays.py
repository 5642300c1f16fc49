"""The rays that the rungs compare: camera rays, random rays, and rays from hits."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from comparisons.geometry.frame import Frame, round32
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.camera import camera_rays, pixel_centres
from reference_rt.cameras.film import Film
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene


class Rays(NamedTuple):
    """Origins and directions (n, 3), float32 values held in float64."""

    o: FloatArray
    d: FloatArray

    def rows(self, rows: IntArray) -> "Rays":
        """The rays of some rows."""
        return Rays(self.o[rows], self.d[rows])


def joined(*parts: Rays) -> Rays:
    """The rays of all parts, in order."""
    return Rays(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def pixel_rays(scene: Scene, frame: Frame, most: int) -> Rays:
    """Camera rays through at most `most` pixel centres, rounded to float32 in the frame."""
    o, d = camera_rays(scene, *pixel_centres(scene.film, most))
    return Rays(frame.rounded(o), round32(d))


def described(film: Film, most: int, rays: Rays, k: int) -> str:
    """Ray `k` in words, with its pixel if it is a camera ray: those of `pixel_rays` come first."""
    x, y = pixel_centres(film, most)
    of = f"the ray of pixel ({int(x[k])}, {int(y[k])})" if k < len(x) else "the ray"
    return f"{of} from {rays.o[k].tolist()} along {rays.d[k].tolist()}"


def mixed_rays(
    scene: Scene,
    tables: SceneTables,
    sizes: ShapeSizes,
    most: int,
    seed: int,
    sags: Mapping[int, float] = MappingProxyType({}),
) -> Rays:
    """3 `most` rays: at most `most` camera rays, at most `most` in random directions from the hits
    of these and others, and for the rest random rays through the scene's bounds.

    sags: `Counterpart.sags`.
    """
    camera = pixel_rays(scene, sizes.frame, most)
    if len(scene.shapes) == 0:
        return camera
    rng = np.random.default_rng(seed)
    through = random_rays(sizes, 3 * most - len(camera.o), rng)
    first = joined(camera, through)
    hits = query.intersect(tables, first.o, first.d)
    hit = np.flatnonzero(hits.shape >= 0)[:most]
    out = rng.normal(size=(len(hit), 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    # Offset from the surface, and from a mesh that stands in for it, by Mitsuba's own epsilon: an
    # origin within float32's error of a surface would be on no defined side of it.
    side = np.sign(np.sum(out * hits.n[hit], axis=1))
    sag = np.array([sags.get(shape, 0.0) for shape in hits.shape[hit].tolist()])
    height = side * (sizes.frame.epsilon(hits.p[hit]) + sag)
    start = hits.p[hit] + hits.n[hit] * height[:, None]
    from_hits = Rays(sizes.frame.rounded(start), round32(out))
    rest = 3 * most - len(camera.o) - len(hit)
    return joined(camera, Rays(through.o[:rest], through.d[:rest]), from_hits)


FLAT = 2.0**-20
"""Of a scene's largest extent: one that is thinner has no thickness in float32."""


def random_rays(sizes: ShapeSizes, n: int, rng: np.random.Generator) -> Rays:
    """n rays from a random point in the scene's bounds, grown by a tenth, towards another."""
    extent = sizes.upper - sizes.lower
    # Some start outside; and those of a flat scene do not lie in it, where rounding decides.
    margin = 0.1 * np.where(extent > FLAT * extent.max(), extent, extent.max())
    start, end = rng.uniform(sizes.lower - margin, sizes.upper + margin, (2, n, 3))
    d = end - start
    length = np.linalg.norm(d, axis=1)[:, None]
    d = np.divide(d, length, out=np.tile([0.0, 0.0, 1.0], (n, 1)), where=length > 0.0)
    return Rays(sizes.frame.rounded(start), round32(d))
