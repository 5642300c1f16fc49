"""Mesh: triangles from a file, or from arrays."""

from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.diagnosis import FieldError
from reference_rt.core.model import AS_DIGEST, Examples, Floats2, Floats2s, Floats3, Integers3
from reference_rt.core.transform import IDENTITY, Affine
from reference_rt.shapes.meshes.files import MeshData, read_mesh
from reference_rt.shapes.meshes.files.data import RawMesh, checked
from reference_rt.shapes.meshes.topology import smooth_normals
from reference_rt.shapes.meshes.triangle_table import Triangles, facing, have_area, table_of
from reference_rt.shapes.shape import Shape, TabulationContext

_MOST_NAMED = 12
"""The number of ignored parts of a file that a warning names."""

_LONGEST = 60
"""Characters of a name in a warning: a damaged file may have any names."""


_TETRAHEDRON: dict[str, Any] = {
    "vertices": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "faces": ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
}


class Mesh(Shape):
    """Triangles of a file, or of arrays, with optional vertex normals, texture coordinates and
    colours.

    Geometric normals follow the winding of the vertices.  Under a transform that mirrors space the
    front stays the front, so that closed meshes do not turn inside out.
    """

    EXAMPLES: ClassVar[Examples] = (
        _TETRAHEDRON,
        {**_TETRAHEDRON, "smooth": True},
        {
            **_TETRAHEDRON,
            "normals": ((-1, -1, -1), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
            "uv": ((0, 0), (1, 0), (0, 1), (1, 1)),
            "more_uv": ((0, 0), (0, 2), (3, 0), (3, 2)),
            "colours": ((1, 1, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        },
        {**_TETRAHEDRON, "normals": ((-1, -1, -1), *np.eye(3)), "face_normals": True},
    )
    array_fields: ClassVar[frozenset[str]] = frozenset(
        ("vertices", "faces", "normals", "uv", "more_uv", "colours")
    )

    type: Literal["mesh"] = "mesh"
    file: str | None = None
    """The file, relative to the scene file: .obj, .ply, .stl, .off, .gltf, .glb, .3mf and other
    formats that trimesh reads.  Without one: `vertices` and `faces`."""
    vertices: Floats3 | None = None
    """Positions (n, 3), before the transform, in scene units."""
    faces: Integers3 | None = None
    """Triangles (m, 3): indices of vertices from 0, counter-clockwise seen from the front."""
    normals: Floats3 | None = None
    """Vertex normals (n, 3) of any length but 0, before the transform.  Default: none; shading
    normals are geometric."""
    uv: Floats2 | None = None
    """Texture coordinates (n, 2); (0, 0) is the lower left corner of an image."""
    more_uv: Floats2s | None = None
    """Further sets of texture coordinates (n, 2 k): of each vertex u and v of set 1, then of set 2
    and so on, for textures with that `uv_set`.  Default: none."""
    colours: Floats3 | None = None
    """Vertex colours (n, 3), linear sRGB of at least 0."""
    face_normals: bool = False
    """Whether to shade with each triangle's geometric normal, and to ignore vertex normals."""
    smooth: bool = False
    """Whether to compute vertex normals where there are none: the mean of the faces around a
    vertex, weighted by angle, before the transform.  Vertices of equal position and uv are one."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = [name for name in sorted(self.array_fields) if getattr(self, name) is not None]
        if self.file is not None and given:
            raise FieldError(given[0], "beside a file; expected one of the two")
        if self.file is None and (self.vertices is None or self.faces is None):
            raise ValueError("expected a file, or vertices and faces")
        if self.smooth and self.face_normals:
            raise FieldError("smooth", "beside face_normals; expected one of the two at most")
        if self.file is None:
            try:
                self.data(Path())
            except FieldError as error:
                raise FieldError(error.field, str(error).lstrip(": ")) from None
        return self

    def __eq__(self, other: object) -> bool:
        """Whether the descriptions are equal; arrays are compared by value."""
        return type(other) is type(self) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> str:
        return self.model_dump_json(context=AS_DIGEST)

    def data(self, folder: Path) -> MeshData:
        """The mesh of the file, or of the arrays.  Raises ValueError."""
        if self.file is not None:
            return read_mesh(folder / self.file)
        assert self.vertices is not None
        assert self.faces is not None
        return checked(
            RawMesh(
                self.vertices,
                self.faces,
                self.normals,
                self.uv,
                self.colours,
                more_uv=self.more_uv,
            )
        )

    def tabulate(self, context: TabulationContext) -> Triangles:
        m = self.map_in(context)
        data = self.data(context.folder)
        name = "the mesh" if self.file is None else f"mesh {context.folder / self.file}"
        if data.ignored:
            context.warn(context.owner, f"{name}: {_ignored_message(data.ignored)}")
        points = transform.apply_points(m, data.vertices)
        # Triangles without area have no normal, and rays meet them by rounding alone: left out.
        has_area = have_area(points, data.faces)
        if not has_area.any():
            raise ValueError(f"{name}: no triangle has any area; expected one that has")
        faces, numbers = data.faces, None
        if not has_area.all():
            numbers = np.flatnonzero(has_area)
            faces = faces[has_area]
            context.warn(
                context.owner,
                f"{name}: {len(has_area) - len(numbers):,} of {len(has_area):,} triangles have no "
                "area, or one that float64 cannot hold, and are left out (the others keep their "
                "numbers); expected triangles with an area",
            )
        normals = self._normals(data, faces, m)
        uvs, colours = _at_corners(data.uv, faces), _at_corners(data.colours, faces)
        more_uvs = _at_corners(data.more_uv, faces)
        del data  # a large mesh is held once
        is_used = np.zeros(len(points), bool)
        is_used[faces] = True
        if is_used.all():
            corners = faces.astype(np.int32)
        else:
            points = points[is_used]
            corners = (np.cumsum(is_used, dtype=np.int32) - np.int32(1))[faces]
        del faces
        return facing(
            m, table_of(points, corners, context, normals, uvs, colours, more_uvs, numbers)
        )

    def makes_normals(self, data: MeshData) -> bool:
        """Whether the mesh has vertex normals that its data do not have."""
        return self.smooth and data.normals is None

    def _normals(self, data: MeshData, faces: IntArray, m: Affine) -> FloatArray | None:
        """Unit normals (m, 9) at the corners of faces, in the world."""
        if self.makes_normals(data):
            made = smooth_normals(data.vertices, faces, data.uv).reshape(-1, 3)
            return (made if m is IDENTITY else transform.apply_normals(m, made)).reshape(-1, 9)
        if data.normals is None or self.face_normals:
            return None
        return _at_corners(transform.apply_normals(m, data.normals), faces)


def _ignored_message(ignored: tuple[str, ...]) -> str:
    names = [name[:_LONGEST] for name in ignored[:_MOST_NAMED]]
    more = [f"{len(ignored) - len(names)} more"] if len(ignored) > len(names) else []
    return (
        f"ignored: {', '.join(names + more)}; expected positions, faces, and of the vertices "
        "normals, texture coordinates and colours"
    )


def _at_corners(values: FloatArray | None, faces: IntArray) -> FloatArray | None:
    """(m, 3 k) values at the corners of faces (m, 3), from those of vertices (n, k)."""
    return None if values is None else values[faces].reshape(len(faces), -1)
