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
from comparisons.mitsuba.translate.shapes.quadrics import (
    BOTTOM,
    TOP,
    disk_soup,
    quadric_surface,
    side_surface,
)
from comparisons.mitsuba.translate.shapes.stand_ins import Box as Limits
from comparisons.mitsuba.translate.shapes.stand_ins import (
    Implicit,
    Patch,
    measured_error,
    meshed,
)
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
            return soups + (_caps(shape) if shape.capped else []), distance
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
    return [soup], measured_error(soup, surface, m)[0]


def _caps(shape: Cylinder | Cone) -> list[Soup]:
    if isinstance(shape, Cylinder):
        ends = ((shape.z_min, shape.radius, BOTTOM), (shape.z_max, shape.radius, TOP))
        reach = shape.radius
    else:
        ends = ((0.0, shape.radius, BOTTOM), (shape.height, shape.top_radius, TOP))
        reach = max(shape.radius, shape.top_radius)
    return [disk_soup(z, r, face, reach) for z, r, face in ends if r > 0.0]


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
