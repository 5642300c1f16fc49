"""Triangles of the polygons of a mesh file.

A convex polygon becomes a fan about its first corner.  The fan of a concave one would cover area
outside of it, another for each first corner: it is cut by ear clipping (Held 2001, here Mapbox's
library) in the plane of two coordinates, from a corner that does not depend on the file's order.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF


def fans(corners: npt.NDArray[Any], counts: IntArray) -> npt.NDArray[Any]:
    """Triangles (m, 3) of polygons: a fan about the first corner of each.

    `corners`: the indices of all polygons, one after the other; `counts`: the number of corners of
    each.
    """
    if len(counts) and counts.min() < 3:
        bad = int(np.argmin(counts >= 3))
        raise ValueError(f"face {bad} has {counts[bad]} corners; expected at least three")
    if len(corners) == 3 * len(counts):
        return corners.reshape(-1, 3)
    first = np.repeat(np.cumsum(counts) - counts, counts - 2)
    second = first + 1 + ramps(counts - 2)
    return np.stack([corners[first], corners[second], corners[second + 1]], axis=1)


@np.errstate(all="ignore")  # polygons without area, numbers that overflow
def triangulated(
    points: npt.NDArray[Any], corners: npt.NDArray[Any], counts: IntArray
) -> tuple[npt.NDArray[Any], int]:
    """Triangles (m, 3) of polygons, those of each one after the other, and how many polygons are
    concave.

    `points` (n, 3): the vertices;  `corners`, `counts`: as of `fans`.  Polygons with an index out
    of range, or a corner that is not finite, become fans.
    """
    triangles = fans(corners, counts)
    if len(triangles) == len(counts):
        return triangles, 0
    concave = _concave(np.asarray(points, np.float64), corners, counts)
    if len(concave) == 0:
        return triangles, 0
    firsts, starts = np.cumsum(counts) - counts, np.cumsum(counts - 2) - (counts - 2)
    parts, done = [], 0
    for k in concave.tolist():
        polygon = corners[firsts[k] : firsts[k] + counts[k]]
        parts += [triangles[done : starts[k]], polygon[_ears(points[polygon])]]
        done = starts[k] + counts[k] - 2
    return np.concatenate([*parts, triangles[done:]]), len(concave)


def _concave(points: FloatArray, corners: IntArray, counts: IntArray) -> IntArray:
    """Numbers of the polygons that turn the other way at one of their corners, seen along their
    normal."""
    large = np.flatnonzero(counts > 3)
    sizes = counts[large]
    firsts = np.cumsum(sizes) - sizes
    places = np.repeat((np.cumsum(counts) - counts)[large], sizes) + ramps(sizes)
    index = corners[places]
    valid = np.logical_and.reduceat((index >= 0) & (index < len(points)), firsts)
    p = points[np.clip(index, 0, max(len(points) - 1, 0))]
    last = firsts + sizes - 1
    after = np.arange(len(p)) + 1
    after[last] = firsts
    edge = p[after] - p  # from each corner to the next
    before = np.empty_like(edge)
    before[after] = edge
    # Twice the area, about the polygon's first corner, as a vector (Newell).
    arm = p - np.repeat(p[firsts], sizes, axis=0)
    normal = np.add.reduceat(np.cross(arm, arm[after]), firsts)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    turn = np.einsum("ij,ij->i", np.cross(before, edge), np.repeat(normal, sizes, axis=0))
    # Differences, products and sums round each term by 4 u, and there are six of at most |a||b|.
    bound = 24.0 * UNIT_ROUNDOFF * np.linalg.norm(before, axis=1) * np.linalg.norm(edge, axis=1)
    return large[valid & np.logical_or.reduceat(turn < -bound, firsts)]


def _ears(p: FloatArray) -> IntArray:
    """Triangles (m, 3) of one polygon (n, 3), as numbers of its corners."""
    from mapbox_earcut import triangulate_float64  # few files need it

    n = len(p)
    order = np.roll(np.arange(n), -int(np.lexsort(p.T)[0]))
    arm = p - p[0]
    normal = np.cross(arm, np.roll(arm, -1, axis=0)).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    u, v = ((1, 2), (2, 0), (0, 1))[axis]
    flat = np.ascontiguousarray(arm[:, [u, v]])
    found = triangulate_float64(flat[order], np.array([n], np.uint32)).reshape(-1, 3)
    if len(found) == 0:  # without area
        return fans(np.arange(n), np.array([n]))
    triangles: IntArray = order[found.astype(np.int64)]
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    to_b, to_c = b - a, c - a
    area = (to_b[:, 0] * to_c[:, 1] - to_b[:, 1] * to_c[:, 0]).sum()
    return triangles if area * normal[axis] > 0.0 else triangles[:, ::-1]


def doubt(concave: int) -> tuple[str, ...]:
    """What `MeshData.doubtful` says of so many concave polygons."""
    return (f"{concave} concave polygons",) if concave else ()


def ramps(counts: IntArray) -> IntArray:
    """0, 1, ..., count - 1 for each count, one after the other."""
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
