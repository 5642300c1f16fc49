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
        """Parameters: radiance, a texture or a colour, 1 by default as `area` has it;  by_normals:
        whether vertex normals, not the triangle's, decide which side shines, as on a mesh that
        stands in for a curved surface;  turned: whether a triangle's front is on the side of its
        vertex normals whatever its winding, as our reader of Mitsuba's files turns it."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.radiance = base.colour(mi, properties.get("radiance", 1.0))
            self.by_normals = properties.get("by_normals", False)
            self.turned = properties.get("turned", False)
            self.m_flags = mi.EmitterFlags.Surface | mi.EmitterFlags.SpatiallyVarying
            self.triangles: Any = None

        def prepare(self) -> None:
            """The mesh's arrays, and the distribution of the triangles' areas, once the mesh is
            known.  Of a mesh that a file describes Python sees a shape alone, without what meshes
            have.

            Scalar variants render in several threads, which may all come here at once: nothing is
            seen of it until it is whole, `triangles` last.
            """
            if self.triangles is not None:
                return
            # Not kept: the mesh has the emitter, and a circle through Mitsuba is never freed.
            shape = self.get_shape()
            values = mi.traverse(shape)
            arrays = {"faces": np.array(values["faces"]).reshape(-1, 3)}
            for name, size in (("positions", 3), ("normals", 3), ("texcoords", 2)):
                numbers = np.array(values[f"vertex_{name}"], np.float64).reshape(-1, size)
                if len(numbers):
                    arrays[name] = numbers
            corners = arrays["positions"][arrays["faces"]]
            sides = corners[:, 1:] - corners[:, :1]
            areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
            if base.is_wide(mi):
                self.buffers = {
                    name: (mi.UInt32 if name == "faces" else mi.Float)(array.ravel())
                    for name, array in arrays.items()
                }
            self.flips = shape.has_flipped_normals()
            self.arrays, self.area = arrays, float(areas.sum())
            self.triangles = mi.DiscreteDistribution(areas.astype(np.float32))

        def row(self, kind: Any, name: str, index: Any, active: Any) -> Any:
            """A row of an array, as a vector."""
            if base.is_wide(mi):
                return dr.gather(kind, self.buffers[name], index, active)
            return kind(*self.arrays[name][int(index)].tolist())

        def corners(self, kind: Any, name: str, index: Any, active: Any) -> list[Any]:
            """What the three vertices of a triangle have."""
            vertices = self.row(mi.Vector3u, "faces", index, active)
            return [self.row(kind, name, vertex, active) for vertex in vertices]

        def eval(self, si: Any, active: Any = True) -> Any:
            n = si.sh_frame.n if self.by_normals else si.n
            if self.turned:
                self.prepare()
                n = n * self.side(-si.n if self.flips else si.n, si.prim_index, active)
            shines = dr.dot(n, si.to_world(si.wi)) > 0.0
            return dr.select(shines, self.radiance(si, active), 0.0)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            """A point of the mesh, uniform by area; only its front shines."""
            self.prepare()
            index, rest = self.triangles.sample_reuse(sample.x, active)
            place = mi.warp.square_to_uniform_triangle(mi.Point2f(rest, sample.y))
            weights = (1.0 - place.x - place.y, place.x, place.y)
            a, b, c = self.corners(mi.Point3f, "positions", index, active)
            p = a * weights[0] + b * weights[1] + c * weights[2]
            n = dr.normalize(dr.cross(b - a, c - a))
            normal = n
            if "normals" in self.arrays:
                normals = self.corners(mi.Vector3f, "normals", index, active)
                normal = dr.normalize(self.mixed(normals, weights))
            if self.turned:
                n = n * self.side(n, index, active)
            if self.flips:
                n, normal = -n, -normal
            wide = base.is_wide(mi)
            si = dr.zeros(mi.SurfaceInteraction3f) if wide else mi.SurfaceInteraction3f()
            si.p, si.n, si.prim_index = p, n, index
            mesh = self.get_shape()
            si.shape = mi.ShapePtr(mesh) if wide else mesh
            si.uv = place  # Mitsuba's, and ours, where a mesh has none of its own
            if "texcoords" in self.arrays:
                si.uv = self.mixed(self.corners(mi.Point2f, "texcoords", index, active), weights)
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

        def side(self, n: Any, index: Any, active: Any) -> Any:
            """1, or -1 where the normals of a triangle's vertices are on the other side of it."""
            if "normals" not in self.arrays:
                return 1.0
            total = sum(self.corners(mi.Vector3f, "normals", index, active))
            return dr.select(dr.dot(n, total) < 0.0, -1.0, 1.0)

        @staticmethod
        def mixed(of_vertices: list[Any], weights: Any) -> Any:
            """A quantity of a triangle's corners, interpolated."""
            return sum(value * weight for value, weight in zip(of_vertices, weights, strict=True))

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            self.prepare()
            cosine = dr.maximum(dr.abs(dr.dot(ds.d, ds.n)), 1e-6)
            return dr.square(ds.dist) / (self.area * cosine)

        def to_string(self) -> str:
            return "MeshArea[]"

    mi.register_emitter("mesh_area", MeshArea)
