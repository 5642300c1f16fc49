"""Constructive solid geometry: union, intersection and difference of solids, nested to any depth.

`sphere & box - cylinder` in Python; in a scene file a tree of `union`, `intersection` and
`difference`, whose `of` lists the operands.
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
