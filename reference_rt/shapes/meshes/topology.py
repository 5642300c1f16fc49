"""Whether a mesh is closed, and where it is not: for solids, which need an inside."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray


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
