"""Shapes as triangles for Cycles, which has no curved ones: from their equations, and fine enough
that no picture shows it."""

from collections.abc import Callable
from functools import singledispatch
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.geometry import affine
from comparisons.mitsuba.second import described
from comparisons.renderers import NoCounterpartError
from reference_rt.core.arrays import FloatArray, IntArray

FINE = 256
"""Cells of a full turn.  Points are on the surface, and the middle of a cell's side is
1 - cos(pi / FINE) = 7.5e-5 of the radius inside; `_grown` halves it."""


class Surface(NamedTuple):
    """A mesh before its transform: vertices (n, 3), faces (m, 3), and by corner (3 m, k), or None:
    unit normals and uv."""

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None = None
    uv: FloatArray | None = None

    def placed(self, m: affine.Affine) -> dict[str, Any]:
        """Its arrays under a map; its front stays its front."""
        faces, columns = self.faces, {}
        for name in ("normals", "uv"):
            if (column := getattr(self, name)) is not None:
                columns[name] = column.reshape(len(faces), 3, -1)
        if "normals" in columns:
            flat = affine.apply_normals(m, columns["normals"].reshape(-1, 3))
            columns["normals"] = flat.reshape(len(faces), 3, 3)
        if affine.mirrors(m):
            faces = faces[:, ::-1]
            columns = {name: column[:, ::-1] for name, column in columns.items()}
        flat_columns = {k: v.reshape(3 * len(faces), -1) for k, v in columns.items()}
        return {"vertices": affine.apply_points(m, self.vertices), "faces": faces, **flat_columns}


def name_of(shape: Any) -> str:
    """The type of a shape, as scene files name it."""
    return str(shape.type)


@singledispatch
def surface_of(shape: Any, folder: Path) -> Surface:
    """The mesh of a shape.  Raises NoCounterpartError."""
    raise NoCounterpartError(f"the shape {name_of(shape)}")


SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


@surface_of.register
def _(shape: rt.Rectangle, folder: Path) -> Surface:
    uv = (SQUARE[HALVES].reshape(-1, 2) + 1.0) / 2.0
    return Surface(np.column_stack([SQUARE, np.zeros(4)]), HALVES, uv=uv)


@surface_of.register
def _(shape: rt.Box, folder: Path) -> Surface:
    front = np.column_stack([SQUARE, np.ones(4)])
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = np.roll(front * [1.0, sign, sign], axis, axis=1)  # turned, not mirrored
            sides.append(side)
    faces = np.concatenate([HALVES + 4 * k for k in range(6)])
    return Surface(np.concatenate(sides), faces)


@surface_of.register
def _(shape: rt.Triangle | rt.Mesh, folder: Path) -> Surface:
    mesh = described(shape, folder)
    n = len(mesh.points)
    normals, uv = (None if c is None else c.reshape(3 * n, -1) for c in (mesh.normals, mesh.uv))
    faces = np.arange(3 * n).reshape(-1, 3)
    return Surface(mesh.points.reshape(-1, 3), faces, normals, uv)


Patch = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""(u, v), each (...) from 0 to 1 -> points and unit normals (..., 3); u x v points to the front."""


def _patch(of: Patch, n: int, m: int, uv: FloatArray | None = None) -> Surface:
    """n x m cells, two triangles each; those without an area, at a pole, are left out.  uv: the map
    (2, 3) from u, v, 1 to texture coordinates, where these are linear in them."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 1.0, m + 1), indexing="ij")
    points, normals = (x.reshape(-1, 3) for x in of(u, v))
    k = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    p, q, r, s = (c.ravel() for c in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    faces = np.concatenate([np.column_stack([p, q, r]), np.column_stack([p, r, s])])
    corners = points[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces = faces[np.linalg.norm(area, axis=1) > 1e-12 * np.ptp(points, axis=0).max() ** 2]
    coordinates = None
    if uv is not None:
        coordinates = (np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3) @ uv.T)[faces]
        coordinates = coordinates.reshape(-1, 2)
    return Surface(points, faces, normals[faces].reshape(-1, 3), coordinates)


def _joined(*parts: Surface) -> Surface:
    """Meshes with texture coordinates as one; a part without normals is flat."""
    start, vertices, faces, normals, uv = 0, [], [], [], []
    for part in parts:
        vertices.append(part.vertices)
        faces.append(part.faces + start)
        start += len(part.vertices)
        flat = part.normals
        if flat is None:
            a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
            n = np.cross(b - a, c - a)
            flat = np.repeat(n / np.linalg.norm(n, axis=1, keepdims=True), 3, axis=0)
        normals.append(flat)
        assert part.uv is not None
        uv.append(part.uv)
    return Surface(
        np.concatenate(vertices), np.concatenate(faces), np.concatenate(normals), np.concatenate(uv)
    )


def _turn(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.cos(2.0 * np.pi * u), np.sin(2.0 * np.pi * u)


def _grown(n: int) -> float:
    """A factor on the radius of n points of a circle: half of it lies outside, as much inside."""
    return float(2.0 / (1.0 + np.cos(np.pi / n)))


@surface_of.register
def _(shape: rt.Sphere, folder: Path) -> Surface:
    def point(u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        x, y = _turn(u)
        z, r = -np.cos(np.pi * v), np.sin(np.pi * v)
        n = np.stack([r * x, r * y, z], axis=-1)
        return np.array(shape.center) + shape.radius * _grown(FINE) ** 2 * n, n

    return _patch(point, FINE, FINE // 2, np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]]))


def _disk(radius: float, z: float, sign: float, half: float | None = None) -> Surface:
    """A disk that faces sign z.  half: of the side of the square over which its texture coordinates
    are x and y."""
    n = 4 * FINE
    x, y = _turn(np.arange(n) / n)
    rim = radius * _grown(n) * np.column_stack([x, sign * y])
    vertices = np.vstack([[0.0, 0.0, z], np.column_stack([rim, np.full(n, z)])])
    k = np.arange(n)
    faces = np.column_stack([np.zeros(n, np.int64), k + 1, (k + 1) % n + 1])
    uv = None if half is None else (vertices[faces, :2].reshape(-1, 2) / half + 1.0) / 2.0
    return Surface(vertices, faces, uv=uv)


@surface_of.register
def _(shape: rt.Disk, folder: Path) -> Surface:
    return _disk(1.0, 0.0, 1.0)


def _frustum(bottom: float, top: float, low: float, high: float, capped: bool) -> Surface:
    """The side of a cylinder or cone about z, and its caps."""
    slope = (bottom - top) / (high - low)
    n = 4 * FINE

    def side(u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        x, y = _turn(u)
        r = _grown(n) * (bottom + (top - bottom) * v)
        normal = np.stack([x, y, np.full_like(x, slope)], axis=-1) / np.hypot(1.0, slope)
        return np.stack([r * x, r * y, low + (high - low) * v], axis=-1), normal

    parts = [_patch(side, n, 1 if bottom == top else 16, np.eye(2, 3))]
    if capped:
        ends, half = ((bottom, low, -1.0), (top, high, 1.0)), max(bottom, top)
        parts += [_disk(r, z, sign, half) for r, z, sign in ends if r > 0.0]
    return _joined(*parts)


@surface_of.register
def _(shape: rt.Cylinder, folder: Path) -> Surface:
    return _frustum(shape.radius, shape.radius, shape.z_min, shape.z_max, shape.capped)


@surface_of.register
def _(shape: rt.Cone, folder: Path) -> Surface:
    return _frustum(shape.radius, shape.top_radius, 0.0, shape.height, shape.capped)


@surface_of.register
def _(shape: rt.Torus, folder: Path) -> Surface:
    def point(u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        (x, y), (a, b) = _turn(u), _turn(v)
        n = np.stack([a * x, a * y, b], axis=-1)
        r = shape.minor_radius * _grown(FINE)
        ring = shape.major_radius * _grown(4 * FINE)
        return np.stack([ring * x, ring * y, np.zeros_like(x)], axis=-1) + r * n, n

    return _patch(point, 4 * FINE, FINE)
