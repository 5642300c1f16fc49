"""The rays that the rungs compare: camera rays, random rays, and rays from hits."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from comparisons.geometry.frame import Frame, round32
from comparisons.geometry.sizes import ShapeSizes
from comparisons.mitsuba.hits import MitsubaHits
from comparisons.rungs.rays.camera import camera_rays, pixel_centres
from comparisons.rungs.rays.resolution import slide
from reference_rt.cameras.film import Film
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Cone, Cylinder, Disk, Sphere

__all__ = ["DISCRETE", "KINDS", "Comparer"]


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


def random_rays(sizes: ShapeSizes, n: int, rng: np.random.Generator) -> Rays:
    """n rays from a random point in the scene's bounds, grown by a tenth, towards another."""
    margin = 0.1 * (sizes.upper - sizes.lower)  # some start outside
    start, end = rng.uniform(sizes.lower - margin, sizes.upper + margin, (2, n, 3))
    d = end - start
    length = np.linalg.norm(d, axis=1)[:, None]
    d = np.divide(d, length, out=np.tile([0.0, 0.0, 1.0], (n, 1)), where=length > 0.0)
    return Rays(sizes.frame.rounded(start), round32(d))


# ---- our hits against Mitsuba's: errors over their bounds ----------------------------------------


KINDS = (
    "hit",
    "shape",
    "instance",
    "part",
    "primitive",
    "t",
    "normal",
    "shading_normal",
    "uv",
)
DISCRETE = 5
"""The first so many of KINDS identify the primitive: a different one is an infinite error."""


class Comparer:
    """Errors of Mitsuba's hits over their bounds, in one scene."""

    def __init__(self, sizes: ShapeSizes) -> None:
        self.sizes = sizes
        shapes = [leaf.shape for leaf in sizes.leaves]
        # A miss has leaf -1: the last entry.
        shapes_and_none = [*shapes, None]
        self._round = np.array([isinstance(s, Sphere) for s in shapes_and_none])
        self._disk = np.array([isinstance(s, Disk) for s in shapes_and_none])
        self._tube = np.array([isinstance(s, Cylinder | Cone) for s in shapes_and_none])

    def ratios(self, rays: Rays, ours: Intersections, theirs: MitsubaHits) -> FloatArray:
        """(n, len(KINDS)): error over bound, infinite for a different shape, part or face.

        e = (delta + sag) / cos is how far the point may slide along the surface.  The bound of t is
        e; of uv and normals e over the smallest length on which they change; of shading normals
        twice that, as they turn by up to two unit vectors on that length, and more where those of a
        triangle's vertices nearly cancel.  Where Mitsuba has
        triangles in place of a flat shape, their heights are such lengths too.  Where a mesh stands
        in for a curved surface, its shading normal is used as the geometric one too.
        """
        hit = (ours.shape >= 0) & (theirs.shape >= 0)
        different = [(ours.shape >= 0) != (theirs.shape >= 0)]
        same = hit
        for name in KINDS[1:DISCRETE]:
            equal = getattr(ours, name) == getattr(theirs, name)
            different.append(same & ~equal)
            same = same & equal
        length = np.linalg.norm(rays.d, axis=1)
        normal = np.where(theirs.stands_in[:, None], theirs.ns, theirs.n)
        with np.errstate(divide="ignore", invalid="ignore"):
            e = slide(self.sizes, rays.o, rays.d, ours, theirs.sag)
            turn = e / np.minimum(self.sizes.feature_of(ours), theirs.height)
            error_t = np.abs(theirs.t - ours.t) * length / e
            error_n = np.linalg.norm(normal - ours.n, axis=1) / (turn + theirs.turn)
            bent = 2.0 * turn / self.sizes.straightness_of(ours)
            error_ns = np.linalg.norm(theirs.ns - ours.ns, axis=1) / (bent + theirs.turn)
            error_uv = (
                np.linalg.norm(self._spot(theirs, ours) - self._spot(ours, ours), axis=1) / turn
            )
        error_uv[~theirs.has_uv] = 0.0
        errors = np.column_stack([error_t, error_n, error_ns, error_uv])
        errors[~same] = 0.0  # meaningless on a different surface
        # A NaN counts as an infinite error.
        return np.hstack(
            [np.where(np.column_stack(different), np.inf, 0.0), np.nan_to_num(errors, nan=np.inf)]
        )

    def _spot(self, hits: Intersections, ours: Intersections) -> FloatArray:
        """uv as coordinates (n, 3) without seam or pole: of a sphere a unit vector, of a disk x and
        y, of a cylinder or cone a point of the unit circle and v."""
        leaf = self.sizes.leaf_of(ours)
        u, v = hits.uv.T
        on_sphere = np.column_stack([_circle(u, np.sin(np.pi * v)), np.cos(np.pi * v)])
        on_disk = np.column_stack([_circle(v, u), np.zeros_like(u)])
        on_tube = np.column_stack([_circle(u, np.ones_like(u)), v])
        flat = np.column_stack([u, v, np.zeros_like(u)])
        side = self._tube[leaf] & (ours.primitive == 0)
        chosen = np.select(
            [m[:, None] for m in (self._round[leaf], self._disk[leaf], side)],
            [on_sphere, on_disk, on_tube],
            flat,
        )
        return np.asarray(chosen)


def _circle(turns: FloatArray, radius: FloatArray) -> FloatArray:
    """x, y (n, 2)."""
    phi = 2.0 * np.pi * turns
    return np.column_stack([radius * np.cos(phi), radius * np.sin(phi)])
