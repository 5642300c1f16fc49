"""A mesh that emits, as a Mitsuba emitter: `{"type": "mesh_area"}`.

Mitsuba's own, `area`, is not exact on meshes:

- It samples a texture's uv in proportion to its brightness, and looks for the place of the surface
  with these uv: on a mesh there may be none, or several.
- Colours of vertices depend on the triangle, which its samples do not tell.
- With vertex normals, these decide which side shines, and the density of its samples is computed
  with them instead of with the triangle's normal.

This one samples triangles by area.
"""

from typing import Any

import numpy as np

from comparisons.mitsuba.plugins import base


def register(mi: Any) -> None:
    """Define the emitter for the current variant, and register it."""
    import drjit as dr

    class MeshArea(mi.Emitter):  # type: ignore[misc]
        """Parameters: radiance, a texture or a colour;  by_normals: whether vertex normals, not the
        triangle's, decide which side shines, as on a mesh that stands in for a curved surface."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.radiance = base.colour(mi, properties["radiance"])
            self.by_normals = properties.get("by_normals", False)
            self.m_flags = mi.EmitterFlags.Surface | mi.EmitterFlags.SpatiallyVarying
            self.triangles: Any = None

        def prepare(self) -> None:
            """The distribution of the triangles' areas, once the mesh is known."""
            if self.triangles is None:
                values = mi.traverse(self.get_shape())
                vertices = np.array(values["vertex_positions"], np.float64).reshape(-1, 3)
                corners = vertices[np.array(values["faces"]).reshape(-1, 3)]
                sides = corners[:, 1:] - corners[:, :1]
                areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
                self.area = float(areas.sum())
                self.triangles = mi.DiscreteDistribution(areas.astype(np.float32))

        def eval(self, si: Any, active: Any = True) -> Any:
            n = si.sh_frame.n if self.by_normals else si.n
            shines = dr.dot(n, si.to_world(si.wi)) > 0.0
            return dr.select(shines, self.radiance(si, active), 0.0)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            """A point of the mesh, uniform by area; only its front shines."""
            self.prepare()
            # Not kept: the mesh has the emitter, and a circle through Mitsuba is never freed.
            mesh = self.get_shape()
            index, rest = self.triangles.sample_reuse(sample.x, active)
            place = mi.warp.square_to_uniform_triangle(mi.Point2f(rest, sample.y))
            weights = (1.0 - place.x - place.y, place.x, place.y)
            corners = mi.Vector3u(mesh.face_indices(index, active))
            a, b, c = (mesh.vertex_position(corner, active) for corner in corners)
            p = a * weights[0] + b * weights[1] + c * weights[2]
            n = dr.normalize(dr.cross(b - a, c - a))
            normal = n
            if mesh.has_vertex_normals():
                normal = dr.normalize(self.mixed(mesh.vertex_normal, corners, weights, active))
            wide = base.is_wide(mi)
            si = dr.zeros(mi.SurfaceInteraction3f) if wide else mi.SurfaceInteraction3f()
            si.p, si.n, si.prim_index = p, n, index
            si.shape = mi.ShapePtr(mesh) if wide else mesh
            si.uv = place  # Mitsuba's, and ours, where a mesh has none of its own
            if mesh.has_vertex_texcoords():
                si.uv = self.mixed(mesh.vertex_texcoord, corners, weights, active)
            d = p - it.p
            distance2 = dr.squared_norm(d)
            ds = dr.zeros(mi.DirectionSample3f) if wide else mi.DirectionSample3f()
            ds.p, ds.n, ds.uv, ds.time = p, normal, si.uv, it.time
            ds.dist = dr.sqrt(distance2)
            ds.d = d / ds.dist
            ds.emitter = mi.EmitterPtr(self) if wide else self
            # Only for the weights of multiple importance sampling, and the same as for a hit, of
            # which no more is known than the normal of the vertices.
            ds.pdf = self.pdf_direction(it, ds, active)
            shines = dr.dot(ds.d, normal if self.by_normals else n) < 0.0
            radiance = dr.select(shines, self.radiance(si, active), 0.0)
            return ds, radiance * (self.area * dr.abs(dr.dot(ds.d, n)) / distance2)

        @staticmethod
        def mixed(of_vertex: Any, corners: Any, weights: Any, active: Any) -> Any:
            """A quantity of a triangle's corners, interpolated."""
            values = [of_vertex(corner, active) for corner in corners]
            return values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2]

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            self.prepare()
            cosine = dr.maximum(dr.abs(dr.dot(ds.d, ds.n)), 1e-6)
            return dr.square(ds.dist) / (self.area * cosine)

        def to_string(self) -> str:
            return "MeshArea[]"

    mi.register_emitter("mesh_area", MeshArea)
