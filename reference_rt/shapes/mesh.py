"""Mesh: triangles from a file."""

from typing import Literal

import numpy as np

from reference_rt import transform
from reference_rt.shapes import triangle
from reference_rt.shapes.mesh_files import read_mesh
from reference_rt.shapes.shape import FloatArray, IntArray, Place, Shape


class Mesh(Shape):
    """The triangles of a file, with its vertex normals, texture coordinates and vertex colours.

    Geometric normals follow the winding in the file: under a transform that mirrors space the front
    stays the front, and what is closed does not turn inside out.
    """

    type: Literal["mesh"] = "mesh"
    file: str
    """An .obj or .ply file, or another that `shapes.mesh_files` reads; a relative name counts from
    the scene file's folder."""
    face_normals: bool = False
    """Shade with each triangle's own normal, whatever the file has."""

    def tabulate(self, place: Place) -> triangle.Triangles:
        m = self.map_in(place)
        path = place.folder / self.file
        data = read_mesh(path)
        vertices = transform.apply_points(m, data.vertices)[data.faces].reshape(-1, 9)
        normals = None
        if data.normals is not None and not self.face_normals:
            normals = transform.apply_normals(m, data.normals)
        # Without area there is no normal, but rounding alone makes rays hit: left out.
        n = triangle.geometric_normals(vertices)
        has_area = np.einsum("ij,ij->i", n, n) > 0.0
        if not has_area.any():
            raise ValueError(f"mesh {path}: no triangle has any area; expected one that has")
        faces = data.faces
        if not has_area.all():
            vertices, faces = vertices[has_area], faces[has_area]
        triangles = triangle.soup(
            np.ascontiguousarray(vertices),
            place,
            normals=_at_corners(normals, faces),
            uvs=_at_corners(data.uv, faces),
            colours=_at_corners(data.colours, faces),
        )
        return triangle.facing(m, triangles)


def _at_corners(values: FloatArray | None, faces: IntArray) -> FloatArray | None:
    """(m, 3 k) values at the corners of faces (m, 3), from those of vertices (n, k)."""
    return None if values is None else values[faces].reshape(len(faces), -1)
