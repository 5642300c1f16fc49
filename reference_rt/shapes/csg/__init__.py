"""Constructive solid geometry: union, intersection and difference of solids, nested to any depth.

`sphere & box - cylinder` in Python; in a scene file a tree of unions, intersections and
differences, whose `of` lists the operands.  Operands are primitives with spans and closed meshes.

- `description.py`: the tree, its operands from left to right, and its postfix program;
- `tables.py`: operands and programs of all solids of a scene;
- `anchor.py`: the local origin from which the coordinates of a solid's operands count.

Rays are evaluated in `accel/csg.py`: the program combines, for each stretch of the ray, whether it
is inside of each operand.

To add an operation: a description as `Union` in `shapes/shape.py`; a code in `tables.py`; a case in
`postfix`, and one in `accel/csg.py`.
"""

from reference_rt.shapes.csg.anchor import Anchored, anchored
from reference_rt.shapes.csg.description import AnyShape, operands_of, postfix
from reference_rt.shapes.csg.tables import AND, NOT, OR, Solids
from reference_rt.shapes.shape import Difference, Intersection, Solid, Union

__all__ = [
    "AND",
    "NOT",
    "OR",
    "Anchored",
    "AnyShape",
    "Difference",
    "Intersection",
    "Solid",
    "Solids",
    "Union",
    "anchored",
    "operands_of",
    "postfix",
]
