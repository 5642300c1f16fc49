"""All shapes: one file each.  `tables` says how to add one; `dispatch` chooses among them."""

from reference_rt.shapes.box import Box
from reference_rt.shapes.cone import Cone
from reference_rt.shapes.cylinder import Cylinder
from reference_rt.shapes.disk import Disk
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
from reference_rt.shapes.few import Packets, nearest, nearest_of_ray, nearest_of_rays
from reference_rt.shapes.mesh import Mesh
from reference_rt.shapes.plane import Plane
from reference_rt.shapes.polygon import Polygon
from reference_rt.shapes.quadric import Quadric
from reference_rt.shapes.rectangle import Rectangle
from reference_rt.shapes.shape import IntArray, Shape
from reference_rt.shapes.sphere import Sphere
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
from reference_rt.shapes.torus import Torus
from reference_rt.shapes.triangle import Triangle

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
