"""The surface of a shape by the equation of its description's numbers, in the shape's own space.

Nothing here knows our tables, our kernels or Mitsuba's.  The rung `files` holds our hits against
it; Mitsuba and Cycles, which lack some of these shapes, get meshes of its patches.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray

Limits = tuple[FloatArray, FloatArray]


class Patch(NamedTuple):
    """A parametric patch of a surface, with u, v in [0, 1].

    point(u, v): arrays of one shape -> (..., 3);  cells: their numbers along u and v;  has_uv:
    whether u and v are the texture coordinates of our shape; other patches may reach beyond its
    ends.
    """

    point: Callable[[FloatArray, FloatArray], FloatArray]
    cells: tuple[int, int]
    has_uv: bool = False


class Surface(NamedTuple):
    """The surface f = 0.

    value: f of points (..., 3) -> (...), which grows towards the front;  gradient: f's, (..., 3);
    middle, half: of a box around it;  is_full: whether most lines through that box meet it;
    patches: that cover it, made when they are asked for;  ends: the box at which it ends, if at
    one, whose limits may be infinite;  capped: whether it is closed there, where f <= 0;  outline:
    of points, at most 0 within that of a flat surface.
    """

    value: Callable[[FloatArray], FloatArray]
    gradient: Callable[[FloatArray], FloatArray]
    middle: tuple[float, float, float]
    half: tuple[float, float, float]
    is_full: bool = False
    patches: Callable[[], list[Patch]] = list
    ends: Limits | None = None
    capped: bool = False
    outline: Callable[[FloatArray], FloatArray] | None = None

    def distance(self, q: FloatArray) -> FloatArray:
        """(n,): how far points (n, 3) are from the surface, and from its caps; to first order."""
        off = self._off(q)
        side = np.abs(off)
        if self.outline is not None:
            side = np.maximum(side, self.outline(q))
        if self.ends is None:
            return np.asarray(side)
        low, high = self.ends
        outside = np.maximum(low - q, q - high).max(axis=1)
        side = np.maximum(side, outside)
        if not self.capped:
            return np.asarray(side)
        cap = np.maximum(self._from_faces(q).min(axis=1), np.maximum(outside, off))
        return np.asarray(np.minimum(side, cap))

    def normals(self, q: FloatArray) -> FloatArray:
        """(n, 3): along the normals at points (n, 3) of the surface or of its caps."""
        n = np.asarray(self.gradient(q))
        if not self.capped or self.ends is None:
            return n
        of_faces = self._from_faces(q)
        axis, rows = of_faces.argmin(axis=1), np.arange(len(q))
        on_cap = of_faces.min(axis=1) < np.abs(self._off(q))
        outward = np.zeros_like(q)
        outward[rows, axis] = np.where(q[rows, axis] > np.array(self.middle)[axis], 1.0, -1.0)
        return np.where(on_cap[:, None], outward, n)

    def _off(self, q: FloatArray) -> FloatArray:
        """f over its slope: a length, next to the surface."""
        slope = np.linalg.norm(self.gradient(q), axis=1)
        return np.asarray(self.value(q) / np.where(slope > 0.0, slope, 1.0))

    def _from_faces(self, q: FloatArray) -> FloatArray:
        """(n, 3): the distances from the nearer face of the ends, along each axis."""
        assert self.ends is not None
        low, high = self.ends
        return np.minimum(np.abs(q - low), np.abs(q - high))
