"""The register of shapes: their descriptions, and the tables that hold them.

A new shape has a line in `Primitive` and, unless its rows are of a table that is there, one in
`Shapes`; all else follows from these two.  Its import as itself makes it a name of
`reference_rt.shapes`.
"""

from typing import Annotated, NamedTuple

from reference_rt.jit.by_code import ByCode, Table, tables_of
from reference_rt.jit.links import LINK, declare
from reference_rt.shapes import box
from reference_rt.shapes.box import Box as Box
from reference_rt.shapes.curved import quadrics, sphere, torus
from reference_rt.shapes.curved.quadric import Cone as Cone
from reference_rt.shapes.curved.quadric import Cylinder as Cylinder
from reference_rt.shapes.curved.quadric import Quadric as Quadric
from reference_rt.shapes.curved.sphere import Sphere as Sphere
from reference_rt.shapes.curved.torus import Torus as Torus
from reference_rt.shapes.flat import disk, plane, polygon, rectangle
from reference_rt.shapes.flat.disk import Disk as Disk
from reference_rt.shapes.flat.plane import Plane as Plane
from reference_rt.shapes.flat.polygon import Polygon as Polygon
from reference_rt.shapes.flat.rectangle import Rectangle as Rectangle
from reference_rt.shapes.meshes import triangle
from reference_rt.shapes.meshes.mesh import Mesh as Mesh
from reference_rt.shapes.meshes.triangle import Triangle as Triangle

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

    spheres: Annotated[sphere.Spheres | None, sphere]
    rectangles: Annotated[rectangle.Rectangles | None, rectangle]
    boxes: Annotated[box.Boxes | None, box]
    triangles: Annotated[triangle.Triangles | None, triangle]
    disks: Annotated[disk.Disks | None, disk]
    planes: Annotated[plane.Planes | None, plane]
    polygons: Annotated[polygon.Polygons | None, polygon]
    quadrics: Annotated[quadrics.Quadrics | None, quadrics]
    tori: Annotated[torus.Tori | None, torus]


TABLES: tuple[Table, ...] = tables_of(Shapes)
"""In the order of the codes, `Hit.kind`."""

CODES = {module: code for code, _, _, module in TABLES}
"""The code of a shape, by the module with its kernels."""

SPHERE, RECTANGLE, BOX = CODES[sphere], CODES[rectangle], CODES[box]
TRIANGLE, DISK, QUADRIC = CODES[triangle], CODES[disk], CODES[quadrics]

declare(Shapes, LINK)

by_code = ByCode(Shapes)
"""Decorates kernels that choose among the shapes; see `jit/by_code.py`."""
