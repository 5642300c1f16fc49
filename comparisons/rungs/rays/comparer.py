"""Our hits against Mitsuba's: errors over their bounds."""

import numpy as np

from comparisons.mitsuba.hits import MitsubaHits
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.slide import slide
from comparisons.shapes import type_of
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.query import Intersections

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
        # A miss has leaf -1: the last entry.
        self._unwrapped = [*(type_of(leaf.shape).unwrapped for leaf in sizes.leaves), None]

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
            turn = e / np.minimum(self.sizes.bend_of(ours), theirs.height)
            moved = e / np.minimum(self.sizes.feature_of(ours), theirs.height)
            error_t = np.abs(theirs.t - ours.t) * length / e
            error_n = np.linalg.norm(normal - ours.n, axis=1) / (turn + theirs.turn)
            bent = 2.0 * turn / self.sizes.straightness_of(ours)
            error_ns = np.linalg.norm(theirs.ns - ours.ns, axis=1) / (bent + theirs.turn)
            error_uv = (
                np.linalg.norm(self._spot(theirs, ours) - self._spot(ours, ours), axis=1) / moved
            )
        error_uv[~theirs.has_uv] = 0.0
        errors = np.column_stack([error_t, error_n, error_ns, error_uv])
        errors[~same] = 0.0  # meaningless on a different surface
        # A NaN counts as an infinite error.
        return np.hstack(
            [np.where(np.column_stack(different), np.inf, 0.0), np.nan_to_num(errors, nan=np.inf)]
        )

    def _spot(self, hits: Intersections, ours: Intersections) -> FloatArray:
        """uv as coordinates (n, 3) without seam or pole, as far as the shape's faces have any."""
        leaf = self.sizes.leaf_of(ours)
        found = np.column_stack([hits.uv, np.zeros(len(leaf))])
        for unwrapped in {function for function in self._unwrapped if function is not None}:
            is_its = np.array([function is unwrapped for function in self._unwrapped])
            rows = is_its[leaf] & (ours.primitive == 0)
            found[rows] = unwrapped(hits.uv[rows])
        return found


__all__ = ["DISCRETE", "KINDS", "Comparer"]
