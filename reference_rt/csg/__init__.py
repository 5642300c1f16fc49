"""Constructive solid geometry: union, intersection and difference of solids, nested to any depth.

`sphere & box - cylinder` in Python; in a scene file a tree of `union`, `intersection` and
`difference`, whose `of` lists the operands.
"""

from reference_rt.csg.anchor import Anchored, anchored
from reference_rt.csg.description import (
    AnyShape,
    Difference,
    Intersection,
    Solid,
    Union,
    operands_of,
    postfix,
)
from reference_rt.csg.tables import AND, NOT, OR, Solids

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
