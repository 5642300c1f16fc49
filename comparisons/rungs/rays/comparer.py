"""Our hits against Mitsuba's: errors over their bounds."""

import numpy as np

from comparisons.geometry.sizes import ShapeSizes
from comparisons.mitsuba.hits import MitsubaHits
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.slide import slide
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.query import Intersections
from reference_rt.shapes import Cone, Cylinder, Disk, Sphere

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


__all__ = ["DISCRETE", "KINDS", "Comparer"]
