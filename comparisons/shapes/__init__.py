"""What the comparison knows of shapes: equations and exact crossings, to and from Mitsuba, for
Cycles and pbrt; a file per type, whose contract is `ShapeType`.

A shape becomes a list of `Plugin`, each a Mitsuba shape and how to convert its hits; lengths in
scene coordinates.  Some are Mitsuba's own shapes, some exact triangles; elsewhere a fine mesh
stands in (`stand_ins`; `canonical` and `meshing` make it), whose distance from the surface is
measured.

To add a type: its file here, and a line in `SHAPES`.
"""

from typing import Any

from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.hits import Plugin
from comparisons.shapes.box import BOX
from comparisons.shapes.cone import CONE
from comparisons.shapes.cylinder import CYLINDER
from comparisons.shapes.disk import DISK
from comparisons.shapes.mesh import MESH, TRIANGLE
from comparisons.shapes.plane import PLANE
from comparisons.shapes.polygon import POLYGON
from comparisons.shapes.quadric import QUADRIC
from comparisons.shapes.rectangle import RECTANGLE
from comparisons.shapes.shape import ShapeType, TableType
from comparisons.shapes.site import Site
from comparisons.shapes.sphere import SPHERE
from comparisons.shapes.torus import TORUS

SHAPES: tuple[ShapeType[Any], ...] = (
    SPHERE,
    RECTANGLE,
    BOX,
    TRIANGLE,
    MESH,
    DISK,
    PLANE,
    POLYGON,
    QUADRIC,
    CYLINDER,
    CONE,
    TORUS,
)
"""All of them; what is made of others, instances and solids, is expanded first."""

_BY_TYPE = {one.of: one for one in SHAPES}

TABLES: dict[str, TableType] = {one.table.field: one.table for one in SHAPES if one.table}
"""By the field of `reference_rt.shapes.Shapes`."""


def type_of(shape: Any) -> ShapeType[Any]:
    """What is known of a shape's type.  Raises UntranslatableError for one that is not in
    SHAPES."""
    found = _BY_TYPE.get(type(shape))
    if found is None:
        raise UntranslatableError(shape, "shape")
    return found


def translate_shape(shape: Any, site: Site) -> list[Plugin]:
    """The Mitsuba shapes that represent one of ours, in order.

    Raises UntranslatableError, and ValueError for a file that cannot be used.
    """
    return type_of(shape).to_mitsuba(shape, site)
