"""The table of all triangles, those of meshes included, and how its rows are made."""

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from reference_rt.core import transform
from reference_rt.core.arrays import Bounds, FloatArray, IdArray, IntArray
from reference_rt.shapes.shape import TabulationContext

T = TypeVar("T", bound=np.generic)


class Triangles(NamedTuple):
    """n triangles: points (m, 3), and corners (n, 3), int32, the rows of v0 v1 v2 in these; unit
    vertex normals (n, 9), texture coordinates (n, 6) and linear sRGB colours (n, 9; -1 for none) of
    the vertices, each None if no triangle has any; the columns of `placement.owners`, int32, with
    the number in the shape or in the mesh's file as face; more_uvs (n, 3 2 k), the sets 1 to k of
    texture coordinates, of each vertex one after the other.  Of a scene, owner, material and light
    have one row where they are the same for all: see `shared`; more_uvs are the textures'.

    Each triangle's vertices in a row of their own take 72 bytes, in place of 24 or so.
    """

    points: FloatArray
    corners: IdArray
    normals: FloatArray | None
    uvs: FloatArray | None
    colours: FloatArray | None
    owner: IdArray
    material: IdArray
    light: IdArray
    face: IdArray
    more_uvs: FloatArray | None = None

    @property
    def vertices(self) -> FloatArray:
        """v0 v1 v2 of each triangle (n, 9), a copy."""
        return self.points[self.corners].reshape(-1, 9)


RAGGED = ("points",)
"""The column that has no row for each triangle."""


def table_of(
    points: FloatArray,
    corners: npt.NDArray[np.integer],
    context: TabulationContext,
    normals: FloatArray | None = None,
    uvs: FloatArray | None = None,
    colours: FloatArray | None = None,
    more_uvs: FloatArray | None = None,
    face: IntArray | None = None,
) -> Triangles:
    """Triangles of one shape: see `Triangles` and `shared`; `face` defaults to 0, 1, 2, ..."""
    return Triangles(
        points=points,
        corners=corners.astype(np.int32, copy=False),
        normals=normals,
        uvs=uvs,
        colours=colours,
        owner=np.array([context.owner], np.int32),
        material=np.array([context.material], np.int32),
        light=np.array([-1], np.int32),
        face=np.arange(len(corners), dtype=np.int32) if face is None else face.astype(np.int32),
        more_uvs=more_uvs,
    )


def shared(triangles: Triangles) -> Triangles:
    """One row of the columns that are the same for all triangles, such as those of a single mesh:
    less memory, and a number that stays in the cache."""
    columns = {name: getattr(triangles, name) for name in _OFTEN_SHARED}
    same = {name: c[:1].copy() for name, c in columns.items() if (c == c[0]).all()}
    return triangles._replace(**same)


def spread(triangles: Triangles) -> Triangles:
    """One row for each triangle again, see `shared`."""
    n = len(triangles.face)
    columns = {name: getattr(triangles, name) for name in _OFTEN_SHARED}
    return triangles._replace(**{k: np.repeat(c, n // len(c)) for k, c in columns.items()})


_OFTEN_SHARED = "owner", "material", "light"


def facing(m: transform.Affine, triangles: Triangles) -> Triangles:
    """Keeps the front of triangles whose vertices the map m has transformed: one that flips
    orientation reverses the order of the corners, which is reversed again here."""
    if not transform.flips_orientation(m):
        return triangles
    uvs = _barycentrics(triangles) if triangles.uvs is None else triangles.uvs
    return triangles._replace(
        corners=_exchanged(triangles.corners),
        normals=None if triangles.normals is None else _exchanged(triangles.normals),
        uvs=_exchanged(uvs),
        colours=None if triangles.colours is None else _exchanged(triangles.colours),
        more_uvs=None if triangles.more_uvs is None else _exchanged(triangles.more_uvs),
    )


def _exchanged(corners: npt.NDArray[T]) -> npt.NDArray[T]:
    """(n, 3 k) with the second and the third corner exchanged."""
    return np.ascontiguousarray(
        corners.reshape(len(corners), 3, -1)[:, [0, 2, 1]].reshape(corners.shape)
    )


def _barycentrics(triangles: Triangles) -> FloatArray:
    """The texture coordinates (n, 6) of triangles that have none: barycentrics."""
    return np.repeat([[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]], len(triangles.face), axis=0)


def align(parts: Sequence[Triangles]) -> list[Triangles]:
    """Gives all tables the columns that any of them has, with a row for each triangle, and corners
    the rows of points in all tables one after another, so that they can be concatenated."""
    if len(parts) == 1:
        return [*parts]
    parts = [spread(part) for part in parts]
    if any(part.normals is not None for part in parts):
        parts = [
            part._replace(normals=_flat_normals(part)) if part.normals is None else part
            for part in parts
        ]
    if any(part.uvs is not None for part in parts):
        parts = [
            part._replace(uvs=_barycentrics(part)) if part.uvs is None else part for part in parts
        ]
    if any(part.colours is not None for part in parts):
        parts = [
            part._replace(colours=np.full((len(part.face), 9), -1.0))
            if part.colours is None
            else part
            for part in parts
        ]
    if sets := max(map(more_sets, parts)):
        parts = [part._replace(more_uvs=_padded(part, sets)) for part in parts]
    starts = np.cumsum([0] + [len(part.points) for part in parts], dtype=np.int32)
    return [
        part if start == 0 else part._replace(corners=part.corners + start)
        for part, start in zip(parts, starts[:-1], strict=True)
    ]


def more_sets(triangles: Triangles) -> int:
    """The number of sets of texture coordinates beyond the triangles' own."""
    return 0 if triangles.more_uvs is None else triangles.more_uvs.shape[1] // 6


def _padded(triangles: Triangles, sets: int) -> FloatArray:
    """`more_uvs` with so many sets; those that no texture looks up are 0."""
    found = np.zeros((len(triangles.face), 3, 2 * sets))
    if triangles.more_uvs is not None:
        own = triangles.more_uvs.reshape(len(found), 3, -1)
        found[:, :, : own.shape[2]] = own
    return found.reshape(len(found), -1)


def _flat_normals(triangles: Triangles) -> FloatArray:
    """Each triangle's own normal at its vertices."""
    n = geometric_normals(triangles.vertices)
    with np.errstate(invalid="ignore"):
        n = np.nan_to_num(n / np.linalg.norm(n, axis=1, keepdims=True))
    return np.tile(n, 3)


def geometric_normals(vertices: FloatArray) -> FloatArray:
    """Normals (n, 3), as long as twice the area, of vertices (n, 9)."""
    v = vertices.reshape(-1, 3, 3)
    return np.asarray(np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]))


def unit_normals(triangles: Triangles) -> FloatArray:
    """The unit normals (n, 3)."""
    found = geometric_normals(triangles.vertices)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def have_area(points: FloatArray, corners: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
    """Which triangles, see `Triangles`, have an area that float64 can hold: (n,)."""
    found = np.empty(len(corners), bool)
    for begin in range(0, len(corners), _TOGETHER):
        n = geometric_normals(points[corners[begin : begin + _TOGETHER]])
        found[begin : begin + _TOGETHER] = np.einsum("ij,ij->i", n, n) > 0.0
    return found


_TOGETHER = 1 << 15
"""Triangles that are computed together: more only take more memory."""


def areas(triangles: Triangles) -> FloatArray:
    return np.asarray(0.5 * np.linalg.norm(geometric_normals(triangles.vertices), axis=1))


def extent(triangles: Triangles) -> Bounds:
    """The box (3,), (3,) around all of them: each of the points is a vertex."""
    return triangles.points.min(axis=0), triangles.points.max(axis=0)


def bounds(triangles: Triangles) -> Bounds:
    """Boxes (n, 3), (n, 3), exact: minima and maxima of vertices."""
    a, b, c = (triangles.points[triangles.corners[:, k]] for k in range(3))
    # In pairs: NumPy's minimum along an axis of length three takes ten times as long.
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
