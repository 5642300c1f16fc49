"""Curved surfaces that Mitsuba does not have, as fine meshes with the surface's own normals; how
far these are from the surface is measured, not assumed."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from comparisons.mitsuba.stand_ins import Plugin, StandIn
from comparisons.mitsuba.translate.shapes.cutting import cut_away
from comparisons.mitsuba.translate.shapes.meshes import Soup, placed
from comparisons.mitsuba.translate.shapes.plugins import Site
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes.shape import Shape

Box = tuple[FloatArray, FloatArray]


class Patch(NamedTuple):
    """A piece of a surface, of parameters u, v in [0, 1].

    point(u, v): arrays of one shape -> (..., 3);  cells: along u and v.
    """

    point: Callable[[FloatArray, FloatArray], FloatArray]
    cells: tuple[int, int]


class Implicit(NamedTuple):
    """The surface f = 0: f of points (..., 3) -> (...), and its gradient (..., 3)."""

    value: Callable[[FloatArray], FloatArray]
    gradient: Callable[[FloatArray], FloatArray]


def meshed(patches: Sequence[Patch], surface: Implicit, box: Box | None, fineness: float) -> Soup:
    """Patches as triangles that face where f grows, with f's normals, cut off at a box."""
    positions, normals, faces = [], [], []
    count = 0
    for patch in patches:
        cells = tuple(max(1, round(n * fineness)) if n > 1 else 1 for n in patch.cells)
        grid = patch.point(
            *np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in cells), indexing="ij")
        )
        n = _grid_normals(surface.gradient(grid))
        flat_grid, flat_normals = grid.reshape(-1, 3), n.reshape(-1, 3)
        some = _grid_faces(*cells)
        if box is not None:
            flat_grid, flat_normals, some = clipped(flat_grid, flat_normals, some, box)
        corners = flat_grid[some]
        winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        front = flat_normals[some].sum(axis=1)
        some = np.where((np.sum(winding * front, axis=1) < 0.0)[:, None], some[:, ::-1], some)
        some = some[np.linalg.norm(winding, axis=1) > 0.0]
        positions.append(flat_grid)
        normals.append(flat_normals)
        faces.append(some + count)
        count += len(flat_grid)
    return Soup(np.concatenate(positions), np.concatenate(normals), faces=np.concatenate(faces))


def stand_in(
    shape: Shape, patches: Sequence[Patch], surface: Implicit, box: Box | None, site: Site
) -> Plugin:
    """The mesh, described in the shape's own coordinates, where it stands, and how well it stands
    for the surface there."""
    own = transform.affine(shape.transform)
    key = ("stand-in", id(shape))
    if key not in site.shared:
        soup = meshed(patches, surface, box, 1.0)
        sag, turn = apart(soup, surface, own)
        coarse, _ = apart(meshed(patches, surface, box, 0.5), surface, own)
        name, ratio = type(shape).__name__.lower(), coarse / sag if sag > 0.0 else 1.0
        site.shared[key] = soup, StandIn(name, len(soup.faces), sag, turn, ratio)
    soup, found = site.shared[key]
    m = transform.compose(own, site.place.outer)
    # What is added to the shape's own map stretches distances, and turns angles, by this at most.
    stretch = np.linalg.svd(site.place.outer[:, :3], compute_uv=False)
    found = found._replace(
        sag=float(found.sag * stretch[0]), turn=float(found.turn * stretch[0] / stretch[-1])
    )
    mirrored = bool(np.linalg.det(m[:, :3]) < 0.0)
    plugin = placed(soup, key, m, mirrored, site)
    return plugin._replace(faces=soup.all_of_face(0), stand_in=found)


MEASURED = 50_000
"""Triangles that are measured at most, evenly strided: a surface that is smooth is as far from one
as from its neighbours."""

WEIGHTS = np.array([[1, 1, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]], np.float64)
WEIGHTS /= WEIGHTS.sum(axis=1, keepdims=True)
"""Barycentrics of where a triangle is compared with its surface: the middle, and of its sides."""


def apart(soup: Soup, surface: Implicit, m: transform.Affine) -> tuple[float, float]:
    """The largest distance and the largest angle, in radians, between a mesh and its surface.

    A distance is f over its gradient in the scene: exact but for terms of the distance squared.
    """
    inverse = transform.invert(m)[:, :3]
    faces = soup.faces[:: max(1, len(soup.faces) // MEASURED)]
    assert soup.normals is not None
    corners, normals = soup.positions[faces], soup.normals[faces]
    sag = turn = 0.0
    for weights in WEIGHTS:
        q = np.einsum("k,fki->fi", weights, corners)
        n = np.einsum("k,fki->fi", weights, normals) @ inverse
        gradient = surface.gradient(q) @ inverse
        steepness = np.linalg.norm(gradient, axis=1)
        known = steepness > 0.0
        distance = np.abs(surface.value(q))[known] / steepness[known]
        cross = np.linalg.norm(np.cross(n, gradient), axis=1)[known]
        angle = np.arctan2(cross, np.sum(n * gradient, axis=1)[known])
        sag, turn = max(sag, distance.max(initial=0.0)), max(turn, angle.max(initial=0.0))
    return float(sag), float(turn)


def _grid_normals(gradient: FloatArray) -> FloatArray:
    """Unit normals on a grid (a, b, 3); at a point where the gradient vanishes, an apex, that of
    the grid's next point."""
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
    """What lies in a box of triangles, cut along its sides."""
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
