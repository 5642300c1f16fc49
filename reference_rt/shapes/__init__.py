"""All shapes: one file each.  `tables` says how to add one; `dispatch` chooses among them."""

from reference_rt.core.arrays import IntArray
from reference_rt.shapes.box import Box
from reference_rt.shapes.brute_force import Packets, nearest, nearest_of_ray, nearest_of_rays
from reference_rt.shapes.curved.cone import Cone
from reference_rt.shapes.curved.cylinder import Cylinder
from reference_rt.shapes.curved.quadric import Quadric
from reference_rt.shapes.curved.sphere import Sphere
from reference_rt.shapes.curved.torus import Torus
from reference_rt.shapes.dispatch import (
    face,
    intersect,
    middle,
    owner,
    pdf,
    sample,
    spans,
    surface,
    tangents,
    uv,
)
from reference_rt.shapes.flat.disk import Disk
from reference_rt.shapes.flat.plane import Plane
from reference_rt.shapes.flat.polygon import Polygon
from reference_rt.shapes.flat.rectangle import Rectangle
from reference_rt.shapes.meshes.mesh import Mesh
from reference_rt.shapes.meshes.triangle import Triangle
from reference_rt.shapes.shape import Shape
from reference_rt.shapes.tables import (
    BOX,
    DISK,
    PLANE,
    POLYGON,
    QUADRIC,
    RECTANGLE,
    SPHERE,
    TABLES,
    TORUS,
    TRIANGLE,
    Primitive,
    Shapes,
)

__all__ = [
    "BOX",
    "DISK",
    "PLANE",
    "POLYGON",
    "QUADRIC",
    "RECTANGLE",
    "SPHERE",
    "TABLES",
    "TORUS",
    "TRIANGLE",
    "Box",
    "Cone",
    "Cylinder",
    "Disk",
    "IntArray",
    "Mesh",
    "Packets",
    "Plane",
    "Polygon",
    "Primitive",
    "Quadric",
    "Rectangle",
    "Shape",
    "Shapes",
    "Sphere",
    "Torus",
    "Triangle",
    "face",
    "intersect",
    "middle",
    "nearest",
    "nearest_of_ray",
    "nearest_of_rays",
    "owner",
    "pdf",
    "sample",
    "spans",
    "surface",
    "tangents",
    "uv",
]
