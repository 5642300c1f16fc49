"""Triangles with normals, uv and colours at their vertices: `Soup`."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.backend import mitsuba
from comparisons.textures.texture import uv_attribute
from comparisons.textures.vertex_colours import VERTEX_COLOUR, VERTEX_LUMINANCE
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.vec3 import Vec3, luminance


class Soup:
    """A mesh: positions (v, 3) of its vertices, and of each vertex, or None, unit normals (v, 3),
    uv (v, 2), colours (v, 3), uv of other sets (v, 2 k).

    faces (n, 3): indices of vertices, None if every three vertices are a triangle;  numbers (n,):
    our face numbers, None if they count from 0.
    """

    def __init__(
        self,
        positions: FloatArray,
        normals: FloatArray | None = None,
        uvs: FloatArray | None = None,
        colours: FloatArray | None = None,
        faces: IntArray | None = None,
        numbers: IntArray | None = None,
        more_uvs: FloatArray | None = None,
    ) -> None:
        self.numbers, self.more_uvs = numbers, more_uvs
        self.positions, self.normals, self.uvs, self.colours = positions, normals, uvs, colours
        self.faces = np.arange(len(positions)).reshape(-1, 3) if faces is None else faces

    def moved(self, m: affine.Affine, mirrored: bool) -> "Soup":
        """The mesh under an affine map;  mirrored: reverse the corners, and so the front.

        Normals are not made unit again: between vertices they are interpolated, and an instance
        interpolates before it maps them.
        """
        normals = None
        if self.normals is not None:
            normals = self.normals @ affine.invert(m)[:, :3]
            normals /= np.abs(normals).max()
        positions = affine.apply_points(m, self.positions)
        if not mirrored:
            faces = self.faces
            return Soup(positions, normals, self.uvs, self.colours, faces, more_uvs=self.more_uvs)
        uvs = self.uvs
        if uvs is None and len(positions) == 3 * len(self.faces):
            # Mitsuba's default uv are the barycentrics in its order of the corners.
            uvs = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(self.faces), 1))
        faces = self.faces[:, [0, 2, 1]]
        return Soup(positions, normals, uvs, self.colours, faces, more_uvs=self.more_uvs)

    def at_corners(self) -> "Soup":
        """The same with a vertex for each corner."""
        at = self.faces.ravel()
        normals, uvs, colours, more = (
            None if column is None else column[at]
            for column in (self.normals, self.uvs, self.colours, self.more_uvs)
        )
        at_corners = self.positions[at], normals, uvs, colours
        return Soup(*at_corners, numbers=self.numbers, more_uvs=more)

    def is_like(self, other: "Soup") -> bool:
        """Whether another one has the same numbers, but for some roundings of float64."""
        for name in ("numbers", "positions", "normals", "uvs", "colours", "more_uvs"):
            a, b = getattr(self, name), getattr(other, name)
            if a is None or b is None:
                if a is not b:
                    return False
            elif a.shape != b.shape or np.abs(a - b).max() > 2.0**-44 * np.abs(a).max():
                return False
        return True

    def all_of_face(self, number: int) -> IntArray:
        """`Plugin.faces` of a mesh whose triangles are all one face of ours."""
        return np.full(len(self.faces), number)

    def mesh(self, parts: dict[str, Any]) -> Any:
        """Mitsuba's mesh object;  parts: its BSDF and emitter."""
        mi = mitsuba()
        properties = mi.Properties()
        for name, part in parts.items():
            properties[name] = mi.load_dict(part)
        mesh = mi.Mesh(
            "mesh",
            len(self.positions),
            len(self.faces),
            has_vertex_normals=self.normals is not None,
            has_vertex_texcoords=self.uvs is not None,
            props=properties,
        )
        values = mi.traverse(mesh)
        values["vertex_positions"] = self.positions.astype(np.float32).ravel()
        values["faces"] = self.faces.astype(np.uint32).ravel()
        if self.normals is not None:
            values["vertex_normals"] = self.normals.astype(np.float32).ravel()
        if self.uvs is not None:
            values["vertex_texcoords"] = self.uvs.astype(np.float32).ravel()
        values.update()
        for name, column in self.attributes().items():
            width = column.size // len(self.positions)
            mesh.add_attribute(name, width, column.astype(np.float32).ravel())
        return mesh

    def attributes(self) -> dict[str, FloatArray]:
        """What Mitsuba's mesh has at its vertices by our names; of one number or of three."""
        found = {}
        if self.colours is not None:
            found[VERTEX_COLOUR] = self.colours
            found[VERTEX_LUMINANCE] = np.asarray(luminance(Vec3(*self.colours.T)))
        if self.more_uvs is not None:
            nothing = np.zeros((len(self.positions), 1))
            for k in range(self.more_uvs.shape[1] // 2):
                uv = self.more_uvs[:, 2 * k : 2 * k + 2]
                found[uv_attribute(k + 1)] = np.hstack([uv, nothing])
        return found


def heights_of(corners: FloatArray) -> FloatArray:
    """(n,): the smallest height of each triangle;  corners: (n, 3, 3)."""
    v = corners
    edges = np.linalg.norm(v - np.roll(v, 1, axis=1), axis=2).max(axis=1)
    double_area = np.linalg.norm(np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]), axis=1)
    return np.asarray(np.divide(double_area, edges, out=np.zeros_like(edges), where=edges > 0.0))


def joined(parts: Sequence[Soup]) -> Soup:
    """Meshes with normals and uv as one."""
    starts = np.cumsum([0, *(len(part.positions) for part in parts)])
    return Soup(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.uvs for part in parts]),
        faces=np.concatenate([part.faces + at for part, at in zip(parts, starts, strict=False)]),
    )
