"""Triangles of parametric surfaces, clipped to boxes."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from comparisons.mitsuba.translate.shapes.cutting import cut_away
from comparisons.mitsuba.translate.shapes.meshes import Soup
from reference_rt.core.arrays import FloatArray, IntArray

Box = tuple[FloatArray, FloatArray]


FEWEST = 4
"""Fewest cells along the side of a patch, unless it asks for less itself: hits slide along
triangles that are long and thin (see `quadrics.SIDE`)."""


class Patch(NamedTuple):
    """A parametric patch of a surface, with u, v in [0, 1].

    point(u, v): arrays of one shape -> (..., 3);  cells: their numbers along u and v;  has_uv:
    whether u and v are the texture coordinates of our shape.
    """

    point: Callable[[FloatArray, FloatArray], FloatArray]
    cells: tuple[int, int]
    has_uv: bool = False


class Implicit(NamedTuple):
    """The surface f = 0: f of points (..., 3) -> (...), and its gradient (..., 3)."""

    value: Callable[[FloatArray], FloatArray]
    gradient: Callable[[FloatArray], FloatArray]


def meshed(patches: Sequence[Patch], surface: Implicit, box: Box | None, fineness: float) -> Soup:
    """Patches as triangles that face where f grows, with f's normals, clipped to a box;  fineness:
    factor on the numbers of cells."""
    positions, normals, uvs, faces = [], [], [], []
    count = 0
    for patch in patches:
        cells = tuple(max(min(n, FEWEST), round(n * fineness)) for n in patch.cells)
        u, v = np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in cells), indexing="ij")
        grid = patch.point(u, v)
        n = _grid_normals(surface.gradient(grid))
        flat_grid, flat_normals = grid.reshape(-1, 3), n.reshape(-1, 3)
        some = _grid_faces(*cells)
        if box is not None:
            flat_grid, flat_normals, some = clipped(flat_grid, flat_normals, some, box)
        elif patch.has_uv:
            uvs.append(np.column_stack([u.ravel(), v.ravel()]))
        corners = flat_grid[some]
        winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        front = flat_normals[some].sum(axis=1)
        some = np.where((np.sum(winding * front, axis=1) < 0.0)[:, None], some[:, ::-1], some)
        some = some[np.linalg.norm(winding, axis=1) > 0.0]
        positions.append(flat_grid)
        normals.append(flat_normals)
        faces.append(some + count)
        count += len(flat_grid)
    uv = np.concatenate(uvs) if len(uvs) == len(positions) else None
    return Soup(np.concatenate(positions), np.concatenate(normals), uv, faces=np.concatenate(faces))


def _grid_normals(gradient: FloatArray) -> FloatArray:
    """Unit normals on a grid (a, b, 3); where the gradient vanishes (an apex), a neighbour's."""
    length = np.linalg.norm(gradient, axis=2, keepdims=True)
    n = np.divide(gradient, length, out=np.zeros_like(gradient), where=length > 0.0)
    for axis in (1, 0):
        for step in (-1, 1):
            beside = np.roll(n, step, axis=axis)
            n = np.where(np.any(n != 0.0, axis=2, keepdims=True), n, beside)
    return np.asarray(n)


def _grid_faces(a: int, b: int) -> IntArray:
    """Two triangles for each cell of a grid of (a + 1) (b + 1) points."""
    k = np.arange((a + 1) * (b + 1)).reshape(a + 1, b + 1)
    corners = [k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]]
    p, q, r, s = (c.ravel() for c in corners)
    return np.concatenate([np.column_stack([p, q, r]), np.column_stack([p, r, s])])


def clipped(
    positions: FloatArray, normals: FloatArray, faces: IntArray, box: Box
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Triangles clipped to a box."""
    data = np.hstack([positions, normals])
    for axis in range(3):
        for sign, limit in ((-1.0, box[0][axis]), (1.0, box[1][axis])):
            count = len(data)
            data, faces = cut_away(data, faces, partial(_beyond, axis, sign, limit))
            data[count:, axis] = limit
    n = data[:, 3:]
    length = np.linalg.norm(n, axis=1, keepdims=True)
    return data[:, :3], np.divide(n, length, out=np.zeros_like(n), where=length > 0.0), faces


def _beyond(axis: int, sign: float, limit: float, data: FloatArray) -> FloatArray:
    return np.asarray(sign * (data[:, axis] - limit))
