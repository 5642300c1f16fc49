"""Is a mesh closed, and where not: for shapes that need an inside."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray


class BoundaryEdges(NamedTuple):
    """k edges that keep a mesh from being closed, in the order in which the faces come to them.

    `ends` (k, 2, 3): positions; `forward`, `backward` (k,): how many faces go along the edge from
    its first to its second end, and how many back.
    """

    ends: FloatArray
    forward: IntArray
    backward: IntArray


def boundary_edges(faces: npt.NDArray[np.integer], vertices: FloatArray) -> BoundaryEdges:
    """The edges that are not used exactly once in each direction.

    `faces` (m, 3), `vertices` (n, 3).  Vertices with identical coordinates are the same.  A face
    with two equal corners has no inside, and is taken as not being there; one without area but
    three different corners counts, since leaving it out would leave a gap between edges.
    """
    point, firsts = number_rows(vertices)
    f = point[faces]
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    start, end = f.reshape(-1), np.roll(f, -1, axis=1).reshape(-1)
    n = len(firsts)  # below 3e9, so that products fit
    there, back = np.sort(start * n + end), np.sort(end * n + start)
    if np.array_equal(there, back) and np.all(there[1:] != there[:-1]):
        nothing = np.zeros(0, np.int64)  # closed, as most meshes are: no need to name edges
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
    """The number of each of n rows (n, k), the same for equal ones; and of each number, a row that
    has it."""
    order = np.lexsort(rows.T)  # -0 and 0 compare as equal, here and below
    new = np.ones(len(rows), bool)
    new[1:] = np.any(rows[order[1:]] != rows[order[:-1]], axis=1)
    number = np.empty(len(rows), np.int64)
    number[order] = np.cumsum(new) - 1
    return number, order[new]


def describe_boundary(triangles: FloatArray, most: int = 3) -> str:
    """One line on why triangles, (m, 9) or (m, 3, 3), are not closed: the number of the edges in
    the way and the first ones of them; "" if they are closed."""
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
