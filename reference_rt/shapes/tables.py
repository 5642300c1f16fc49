"""The tables of all types of shapes, and their codes.

To add a shape: a file with its description, table and kernels; here its code, its field of
`Shapes`, its line in `TABLES`, and `Primitive`.  docs/extending.md has the whole recipe.
"""

from typing import Any, NamedTuple

from reference_rt.jit.by_code import ByCode
from reference_rt.jit.links import LINK, declare
from reference_rt.shapes import box
from reference_rt.shapes.box import Box, Boxes
from reference_rt.shapes.curved import quadrics, sphere, torus
from reference_rt.shapes.curved.quadric import Cone, Cylinder, Quadric
from reference_rt.shapes.curved.quadrics import Quadrics
from reference_rt.shapes.curved.sphere import Sphere, Spheres
from reference_rt.shapes.curved.torus import Tori, Torus
from reference_rt.shapes.flat import disk, plane, polygon, rectangle
from reference_rt.shapes.flat.disk import Disk, Disks
from reference_rt.shapes.flat.plane import Plane, Planes
from reference_rt.shapes.flat.polygon import Polygon, Polygons
from reference_rt.shapes.flat.rectangle import Rectangle, Rectangles
from reference_rt.shapes.meshes import triangle
from reference_rt.shapes.meshes.mesh import Mesh
from reference_rt.shapes.meshes.triangle import Triangle, Triangles

# Codes of `Hit.kind`: the table of which a primitive is a row.
SPHERE, RECTANGLE, BOX, TRIANGLE, DISK, PLANE, POLYGON, QUADRIC, TORUS = range(9)

Primitive = (
    Sphere
    | Rectangle
    | Triangle
    | Box
    | Mesh
    | Disk
    | Plane
    | Polygon
    | Quadric
    | Cylinder
    | Cone
    | Torus
)
"""The descriptions that are primitives; `reference_rt.shapes.csg` adds solids made of them."""


class Shapes(NamedTuple):
    """Every primitive of a scene, one table per type; None for a type that the scene lacks."""

    spheres: Spheres | None
    rectangles: Rectangles | None
    boxes: Boxes | None
    triangles: Triangles | None
    disks: Disks | None
    planes: Planes | None
    polygons: Polygons | None
    quadrics: Quadrics | None
    tori: Tori | None


TABLES: tuple[tuple[int, str, type, Any], ...] = (
    (SPHERE, "spheres", Spheres, sphere),
    (RECTANGLE, "rectangles", Rectangles, rectangle),
    (BOX, "boxes", Boxes, box),
    (TRIANGLE, "triangles", Triangles, triangle),
    (DISK, "disks", Disks, disk),
    (PLANE, "planes", Planes, plane),
    (POLYGON, "polygons", Polygons, polygon),
    (QUADRIC, "quadrics", Quadrics, quadrics),
    (TORUS, "tori", Tori, torus),
)
"""(code, field of Shapes, table, module with its kernels), in the order of the codes."""


declare(Shapes, LINK)

by_code = ByCode((code, field, module) for code, field, _, module in TABLES)
"""Decorates kernels that choose among the shapes; see `jit/by_code.py`."""
