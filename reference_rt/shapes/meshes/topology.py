"""The edges and vertices of meshes: whether a mesh is closed, and where it is not (solids need an
inside); vertex normals for meshes without any.

A vertex normal is the mean normal of the faces around the vertex, weighted by
each face's angle there (Thürmer & Wüthrich 1998, "Computing vertex normals from polygonal facets",
Journal of Graphics Tools 3(1)).  Unlike with weights of area, or equal ones, the result does not
depend on how a surface is cut into triangles.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF


class BoundaryEdges(NamedTuple):
    """The k edges at which a mesh is not closed, in the order of the first face that has them.

    `ends` (k, 2, 3): positions; `forward`, `backward` (k,): the number of faces that go along the
    edge from its first to its second end, and back.
    """

    ends: FloatArray
    forward: IntArray
    backward: IntArray


def boundary_edges(faces: npt.NDArray[np.integer], vertices: FloatArray) -> BoundaryEdges:
    """The edges that are not used exactly once in each direction.

    `faces` (m, 3), `vertices` (n, 3).  Vertices with identical coordinates are the same.  A face
    with two equal corners has no inside and is ignored; one without area but with three different
    corners counts, since ignoring it would leave a gap between edges.
    """
    point, firsts = number_rows(vertices)
    f = point[faces]
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    start, end = f.reshape(-1), np.roll(f, -1, axis=1).reshape(-1)
    n = len(firsts)  # below 3e9, so that products fit
    there, back = np.sort(start * n + end), np.sort(end * n + start)
    if np.array_equal(there, back) and np.all(there[1:] != there[:-1]):
        nothing = np.zeros(0, np.int64)  # the fast path: closed, as most meshes are
        return BoundaryEdges(np.zeros((0, 2, 3)), nothing, nothing)
    _, first, edge, uses = np.unique(
        np.minimum(start, end) * n + np.maximum(start, end),
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    # Forward is the direction of the first face that has the edge.
    forward = np.bincount(edge, weights=start == start[first][edge], minlength=len(first))
    forward = forward.astype(np.int64)
    open_ = np.flatnonzero((forward != 1) | (uses != 2))
    open_ = open_[np.argsort(first[open_])]
    ends = vertices[firsts[np.stack([start[first[open_]], end[first[open_]]], axis=1)]]
    return BoundaryEdges(ends, forward[open_], uses[open_] - forward[open_])


def number_rows(rows: FloatArray) -> tuple[IntArray, IntArray]:
    """Numbers the different rows of (n, k): the number of each row, (n,), and for each number the
    index of a row that has it."""
    order = np.lexsort(rows.T)  # -0 and 0 compare as equal, here and below
    new = np.ones(len(rows), bool)
    new[1:] = np.any(rows[order[1:]] != rows[order[:-1]], axis=1)
    number = np.empty(len(rows), np.int64)
    number[order] = np.cumsum(new) - 1
    return number, order[new]


def describe_boundary(triangles: FloatArray, most: int = 3) -> str:
    """One line on why triangles, (m, 9) or (m, 3, 3), are not closed: the number of edges at fault
    and the first of them; "" if they are closed."""
    corners = triangles.reshape(-1, 3)
    edges = boundary_edges(np.arange(len(corners)).reshape(-1, 3), corners)
    count = len(edges.ends)
    if count == 0:
        return ""
    shown = [
        f"{_shown(a)} to {_shown(b)} has {there} and {back}"
        for (a, b), there, back in zip(
            edges.ends[:most].tolist(),
            edges.forward[:most].tolist(),
            edges.backward[:most].tolist(),
            strict=True,
        )
    ]
    more = [f"and {count - most} more"] if count > most else []
    number = "1 edge does" if count == 1 else f"{count} edges do"
    return (
        f"it is not closed: {number} not have one face in each direction: "
        f"{', '.join(shown + more)}; expected a closed mesh"
    )


def _shown(p: list[float]) -> str:
    return "(" + ", ".join(f"{x:.9g}" for x in p) + ")"


TERM = 16
"""The most roundings of a face's term of a sum: ten of its unit normal, three of its angle, one of
their product."""


def smooth_normals(vertices: FloatArray, faces: IntArray, uv: FloatArray | None) -> FloatArray:
    """Unit normals (m, 9) at the corners of faces (m, 3), from positions (n, 3).

    Vertices of the same position and texture coordinates uv (n, 2) are one: files repeat a vertex
    for each face (.stl does), but along a seam of the texture the two sides have normals of their
    own, as in Mitsuba and trimesh.

    A face without area adds nothing.  Where the normals of a vertex cancel, as on two sides of a
    sheet, and where no face around it has an area, each corner has the normal of its own face, or
    (0, 0, 1) if that has no area either.
    """
    number, firsts = number_rows(vertices if uv is None else np.column_stack([vertices, uv]))
    n, weights = np.empty(faces.shape), np.empty(faces.shape)
    blocks = [slice(begin, begin + _TOGETHER) for begin in range(0, len(faces), _TOGETHER)]
    for here in blocks:
        n[here], angles = _normals_and_angles(vertices[faces[here]])
        weights[here] = np.where(_has_area(n[here]), angles, 0.0)
    vertex = number[faces]
    sums = np.stack([_summed(vertex, weights * n[:, k : k + 1], len(firsts)) for k in range(3)], 1)
    total = _summed(vertex, weights, len(firsts))
    count = np.bincount(vertex.ravel(), minlength=len(firsts))
    # The error of a sum of k terms: k - 1 roundings of the sum of their sizes, and those of each.
    error = UNIT_ROUNDOFF * (count + TERM) * total
    smooth, mean = np.linalg.norm(sums, axis=1) > error, unit(sums)
    del weights, number
    at_corners = np.empty((*faces.shape, 3))
    for here in blocks:
        own = np.where(_has_area(n[here]), n[here], [0.0, 0.0, 1.0])
        which = vertex[here]
        at_corners[here] = np.where(smooth[which][:, :, None], mean[which], own[:, None, :])
    return at_corners.reshape(-1, 9)


_TOGETHER = 1 << 15
"""Faces whose normals are computed together: more only take more memory."""


def _has_area(n: FloatArray) -> npt.NDArray[np.bool_]:
    """Which normals (m, 3) are not 0: (m, 1)."""
    found: npt.NDArray[np.bool_] = np.any(n != 0.0, axis=1, keepdims=True)
    return found


def unit(vectors: FloatArray) -> FloatArray:
    """(n, 3) vectors, of any length, normalised; 0 stays 0."""
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    scaled = np.divide(vectors, largest, out=np.zeros_like(vectors), where=largest > 0.0)
    length = np.linalg.norm(scaled, axis=1, keepdims=True)
    return np.asarray(np.divide(scaled, length, out=scaled, where=length > 0.0))


def _summed(vertex: IntArray, values: FloatArray, count: int) -> FloatArray:
    return np.asarray(
        np.bincount(vertex.ravel(), weights=values.ravel(), minlength=count), np.float64
    )


def _normals_and_angles(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (m, 3), 0 without area, and the angles (m, 3) at the corners (m, 3, 3)."""
    # Scaled by powers of two, which is exact, so that no difference or product overflows.
    corners = _near_one(corners)
    edges = _near_one(np.roll(corners, -1, axis=1) - corners)  # from each corner to the next
    a, b = edges[:, 0], -edges[:, 2]
    cross = np.stack(
        [_determinant(a[:, k - 2], a[:, k - 1], b[:, k - 2], b[:, k - 1]) for k in range(3)], axis=1
    )
    double_area = np.linalg.norm(cross, axis=1)
    cosines = -np.einsum("mki,mki->mk", edges, np.roll(edges, 1, axis=1))
    return unit(cross), np.arctan2(double_area[:, None], cosines)


def _near_one(rows: FloatArray) -> FloatArray:
    """(m, 3, 3), each of the m scaled by a power of two so that its largest number is about 1."""
    _, exponent = np.frexp(np.abs(rows).max(axis=(1, 2)))
    return np.asarray(np.ldexp(rows, -exponent[:, None, None]))


def _determinant(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """a d - b c to within two roundings, also for slivers, whose two products nearly cancel."""
    x, y = a * d, b * c
    return np.asarray((x - y) + (_lost(a, d, x) - _lost(b, c, y)))


def _lost(a: FloatArray, b: FloatArray, product: FloatArray) -> Any:
    """a b - product, exactly (Dekker 1971, "A floating-point technique for extending the available
    precision", Numerische Mathematik 18): factors are cut into halves of 26 bits."""
    (a1, a2), (b1, b2) = _halves(a), _halves(b)
    return ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2


def _halves(a: FloatArray) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    c = (2.0**27 + 1.0) * a
    high = c - (c - a)
    return high, a - high
