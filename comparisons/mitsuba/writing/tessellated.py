"""Shapes as triangles: exact for flat shapes, fine for curved ones, whose error is measured."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from comparisons.mitsuba.translate.shapes.around import around_z
from comparisons.mitsuba.translate.shapes.caps import cap_faces
from comparisons.mitsuba.translate.shapes.flat import polygon_soup
from comparisons.mitsuba.translate.shapes.meshes import Soup
from comparisons.mitsuba.translate.shapes.native import box_of_triangles, sphere_surface
from comparisons.mitsuba.translate.shapes.patches import Box as Limits
from comparisons.mitsuba.translate.shapes.patches import (
    Implicit,
    Patch,
    meshed,
)
from comparisons.mitsuba.translate.shapes.quadrics import (
    quadric_surface,
    side_surface,
)
from comparisons.mitsuba.translate.shapes.stand_in_errors import measured_error
from comparisons.mitsuba.translate.shapes.tori import torus_surface
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import (
    Box,
    Cone,
    Cylinder,
    Disk,
    Mesh,
    Polygon,
    Quadric,
    Rectangle,
    Shape,
    Sphere,
    Torus,
    Triangle,
)
from reference_rt.shapes.meshes.files.data import MeshData
from reference_rt.shapes.meshes.triangle_table import geometric_normals
from reference_rt.shapes.meshes.vertex_normals import unit
from reference_rt.shapes.shape import TabulationContext

SIDES = 1024
"""Triangles of a disk."""


class Tessellated(NamedTuple):
    """mesh: under the shape's own transform, its front counter-clockwise;  distance: the largest
    one from the surface, 0 for flat shapes but for a disk's rim."""

    mesh: MeshData
    distance: float


def tessellated(shape: Shape, folder: Path) -> Tessellated:
    """The triangles of a shape.  Raises ValueError; TypeError for planes and solids."""
    if isinstance(shape, Triangle | Mesh):
        table = shape.tabulate(TabulationContext(folder=folder))
        return Tessellated(
            MeshData(
                table.vertices.reshape(-1, 3),
                np.arange(3 * len(table.vertices)).reshape(-1, 3),
                None if table.normals is None else table.normals.reshape(-1, 3),
                None if table.uvs is None else table.uvs.reshape(-1, 2),
                None if table.colours is None else table.colours.reshape(-1, 3),
            ),
            0.0,
        )
    m = transform.affine(shape.transform)
    soups, distance = _soups(shape, m)
    mirrored = transform.flips_orientation(m)
    return Tessellated(_joined([soup.moved(m, mirrored) for soup in soups]), distance)


def _soups(shape: Shape, m: transform.Affine) -> tuple[list[Soup], float]:
    """The parts of a shape in its own coordinates, and its error under the map m."""
    match shape:
        case Sphere():
            return _curved(*sphere_surface(shape), None, m)
        case Torus():
            return _curved(*torus_surface(shape), None, m)
        case Quadric():
            patches, surface, box = quadric_surface(shape)
            soups, distance = _curved(patches, surface, box, m) if patches else ([], 0.0)
            soups = [around_z(soup, box) for soup in soups]
            if shape.capped:
                caps, faces = cap_faces(surface.value, box)
                soups += [caps] if len(faces) else []
            return soups, distance
        case Cylinder() | Cone():
            patch, surface = side_surface(shape)
            soups, distance = _curved([patch], surface, None, m)
            return soups + (_caps(shape, patch) if shape.capped else []), distance
        case Box():
            return [box_of_triangles(np.eye(3, 4))], 0.0
        case Polygon():
            return [polygon_soup(shape)], 0.0
        case Rectangle():
            corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
            flat = np.column_stack([corners, np.zeros(4)])
            faces = np.array([[0, 1, 2], [0, 2, 3]])
            return [Soup(flat, uvs=0.5 * (corners + 1.0), faces=faces)], 0.0
        case Disk():
            return [_disk()], (1.0 - np.cos(np.pi / SIDES)) * float(np.abs(m[:, :2]).max())
    raise TypeError(f"no triangles for {type(shape).__name__}")


def _curved(
    patches: Sequence[Patch], surface: Implicit, box: Limits | None, m: transform.Affine
) -> tuple[list[Soup], float]:
    soup = meshed(patches, surface, box, 1.0)
    return [_welded(soup)], measured_error(soup, surface, m)[0]


GRID = 1e-9
"""Vertices of one place, over the size of the mesh: apart by rounding where a patch meets itself.
"""


def _welded(soup: Soup) -> Soup:
    """The mesh with vertices of one place at the very same place, so that it is closed, and without
    the triangles that lose their area."""
    size = float(np.ptp(soup.positions, axis=0).max())
    places = np.round(soup.positions / (GRID * size)).astype(np.int64)
    _, first, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    corners = number[soup.faces]
    kept = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return Soup(
        soup.positions[first][number], soup.normals, soup.uvs, soup.colours, soup.faces[kept]
    )


def is_closed(mesh: MeshData) -> bool:
    """Whether each edge of a triangle is, the other way round, that of another; by position."""
    _, number = np.unique(mesh.vertices, axis=0, return_inverse=True)
    corners = number.ravel()[mesh.faces]
    a, b = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    n = int(corners.max()) + 1
    return np.array_equal(np.sort(a * n + b), np.sort(b * n + a))


def _caps(shape: Cylinder | Cone, side: Patch) -> list[Soup]:
    """Fans about the axis, whose rims are those of the side."""
    if isinstance(shape, Cylinder):
        radii, reach = (shape.radius, shape.radius), shape.radius
    else:
        radii = shape.radius, shape.top_radius
        reach = max(radii)
    u = np.arange(side.cells[0]) / side.cells[0]
    k = np.arange(len(u))
    found = []
    for v, radius in zip((0.0, 1.0), radii, strict=True):
        if radius == 0.0:
            continue
        rim = side.point(u, np.full_like(u, v))
        positions = np.vstack([[[0.0, 0.0, rim[0, 2]]], rim])
        faces = np.column_stack([np.zeros_like(k), 1 + k, 1 + (k + 1) % len(k)])
        faces = faces if v == 1.0 else faces[:, ::-1]
        found.append(Soup(positions, uvs=0.5 * (1.0 + positions[:, :2] / reach), faces=faces))
    return found


def _disk() -> Soup:
    """The unit disk, with uv of its own in each triangle: the distance from the middle, and the
    angle from 0 to 1."""
    turn = np.arange(SIDES + 1) / SIDES
    rim = np.column_stack([np.cos(2.0 * np.pi * turn), np.sin(2.0 * np.pi * turn), 0.0 * turn])
    k = np.arange(SIDES)
    corners = np.stack([np.zeros((SIDES, 3)), rim[k], rim[k + 1]], axis=1)
    uv = np.stack(
        [
            np.column_stack([np.zeros(SIDES), 0.5 * (turn[k] + turn[k + 1])]),
            np.column_stack([np.ones(SIDES), turn[k]]),
            np.column_stack([np.ones(SIDES), turn[k + 1]]),
        ],
        axis=1,
    )
    return Soup(corners.reshape(-1, 3), uvs=uv.reshape(-1, 2))


def _joined(soups: Sequence[Soup]) -> MeshData:
    """One mesh.  Where only some parts have normals, the others get those of their triangles."""
    if not soups:
        raise ValueError("has no surface")
    any_normals = any(soup.normals is not None for soup in soups)
    vertices, faces, normals, uvs = [], [], [], []
    count = 0
    for soup in soups:
        vertices.append(soup.positions)
        faces.append(soup.faces + count)
        uvs.append(np.zeros((len(soup.positions), 2)) if soup.uvs is None else soup.uvs)
        if any_normals:
            normals.append(unit(_flat_normals(soup) if soup.normals is None else soup.normals))
        count += len(soup.positions)
    return MeshData(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.concatenate(normals) if any_normals else None,
        np.concatenate(uvs) if all(soup.uvs is not None for soup in soups) else None,
    )


def _flat_normals(soup: Soup) -> FloatArray:
    """(n, 3) at the vertices of a part whose neighbouring triangles are in one plane."""
    found = np.zeros((len(soup.positions), 3))
    of_faces = geometric_normals(soup.positions[soup.faces].reshape(-1, 9))
    for corner in range(3):
        found[soup.faces[:, corner]] = of_faces
    return found


__all__ = ["Tessellated", "tessellated"]
