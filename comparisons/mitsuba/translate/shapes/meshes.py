"""Meshes -> Mitsuba: the triangles of our tables in our order, so that Mitsuba's prim_index is a
row of our table.  The table lacks the file's triangles without area, but keeps the file's
numbers."""

from typing import Any

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.stand_ins import Plugin, same_uv
from comparisons.mitsuba.translate.shapes.choice import translate_shape
from comparisons.mitsuba.translate.shapes.plugins import Site, instance_of, with_mesh_light
from comparisons.mitsuba.translate.textures import VERTEX_COLOUR, VERTEX_LUMINANCE
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.shapes import Mesh, Triangle
from reference_rt.shapes.meshes.triangle import Triangles
from reference_rt.shapes.shape import TabulationContext

MOST_TRIANGLES = 4_000_000
"""Most triangles of all copies of a mesh together, 0.3 kB each.  With more Mitsuba gets instances,
which it traces less exactly: in groups it ignores the flag for watertight intersections (of 100,000
rays at edges 7,226 passed between triangles; without a group, 15)."""

MOST_INSTANCES = 32
"""Most instances in a scene of Mitsuba's fast variants: see `counterpart.InstancedGroup`."""


class Soup:
    """A mesh: positions (v, 3) of its vertices, and of each vertex, or None, unit normals (v, 3),
    uv (v, 2), colours (v, 3).

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
    ) -> None:
        self.numbers = numbers
        self.positions, self.normals, self.uvs, self.colours = positions, normals, uvs, colours
        self.faces = np.arange(len(positions)).reshape(-1, 3) if faces is None else faces

    def moved(self, m: transform.Affine, mirrored: bool) -> "Soup":
        """The mesh under an affine map;  mirrored: reverse the corners, and so the front.

        Normals are not made unit again: between vertices they are interpolated, and an instance
        interpolates before it maps them.
        """
        normals = None
        if self.normals is not None:
            normals = self.normals @ transform.invert(m)[:, :3]
            normals /= np.abs(normals).max()
        positions = transform.apply_points(m, self.positions)
        if not mirrored:
            return Soup(positions, normals, self.uvs, self.colours, self.faces)
        uvs = self.uvs
        if uvs is None and len(positions) == 3 * len(self.faces):
            # Mitsuba's default uv are the barycentrics in its order of the corners.
            uvs = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(self.faces), 1))
        return Soup(positions, normals, uvs, self.colours, self.faces[:, [0, 2, 1]])

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
        if self.colours is not None:
            grey = np.asarray(luminance(Vec3(*self.colours.T)))
            for name, column in ((VERTEX_COLOUR, self.colours), (VERTEX_LUMINANCE, grey)):
                mesh.add_attribute(
                    name, column.size // len(grey), column.astype(np.float32).ravel()
                )
        return mesh


@translate_shape.register(Triangle)
@translate_shape.register(Mesh)
def _(shape: Triangle | Mesh, site: Site) -> list[Plugin]:
    key = ("triangles", id(shape))
    if key not in site.shared:
        site.shared[key] = _soup(shape.tabulate(TabulationContext(folder=site.place.folder)))
    soup: Soup = site.shared[key]
    site = with_mesh_light(site, normals=soup.normals is not None)
    key = ("mesh", id(shape))
    plugin = placed(soup, key, site.place.outer, site.mirrored, site)
    return [plugin._replace(uv=same_uv, faces=soup.numbers)]


def placed(soup: Soup, key: Any, m: transform.Affine, mirrored: bool, site: Site) -> Plugin:
    """Triangles under the map m: a mesh, or, with many copies that do not emit, an instance of the
    one mesh for `key`.  `mirrored`: see `Soup.moved`."""
    parts = site.parts if soup.colours is None else site.coloured
    few = site.copies * len(soup.faces) <= MOST_TRIANGLES
    if site.copies == 1 or few or "emitter" in site.parts:
        return Plugin(soup.moved(m, mirrored).mesh(parts))
    # Mitsuba transforms normals of instances as we do: the front stays the front.
    return instance_of(str(key), lambda: soup.mesh(parts), m, site)


def _soup(table: Triangles) -> Soup:
    return Soup(
        table.vertices.reshape(-1, 3),
        None if table.normals is None else table.normals.reshape(-1, 3),
        None if table.uvs is None else table.uvs.reshape(-1, 2),
        None if table.colours is None else table.colours.reshape(-1, 3),
        numbers=table.face,
    )
