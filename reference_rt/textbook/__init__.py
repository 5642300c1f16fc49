"""The text-book's alternatives, by name, on arrays of rays: to see what each costs and where it
fails.  The renderer does not use them; "the form that renders" in their docstrings says which it
has.

`intersect(name, parameters, origins, directions)` asks one shape, solid or scene; `METHODS` has
each method's text-book row, summary and source.  To add a family, write a file with its parameters,
kernels and `METHODS` beside these and name it below.
"""

from typing import Any

import numpy.typing as npt

from reference_rt.textbook import box, csg, hierarchy, polygon, sphere, triangle
from reference_rt.textbook.box import BoxParameters
from reference_rt.textbook.hierarchy import SceneParameters
from reference_rt.textbook.method import FloatArray, Method
from reference_rt.textbook.operands import CsgParameters
from reference_rt.textbook.polygon import PolygonParameters
from reference_rt.textbook.sphere import SphereParameters
from reference_rt.textbook.triangle import TriangleParameters

__all__ = [
    "METHODS",
    "BoxParameters",
    "CsgParameters",
    "Method",
    "PolygonParameters",
    "SceneParameters",
    "SphereParameters",
    "TriangleParameters",
    "intersect",
    "names",
]

METHODS: dict[str, Method] = {
    method.name: method
    for family in (sphere, triangle, box, polygon, csg, hierarchy)
    for method in family.METHODS
}


def names(family: str | None = None) -> tuple[str, ...]:
    """The names of all methods, or of one family: "sphere", "triangle", "box", "polygon", "csg",
    "hierarchy"."""
    families = list(dict.fromkeys(name.partition(".")[0] for name in METHODS))
    if family is not None and family not in families:
        raise ValueError(f"unknown family {family!r}; expected one of {', '.join(families)}")
    return tuple(n for n in METHODS if family is None or n.partition(".")[0] == family)


def intersect(
    name: str, parameters: Any, origins: npt.ArrayLike, directions: npt.ArrayLike
) -> FloatArray:
    """`Method.intersect` of the method with this name: t (n,), inf for a miss."""
    if name not in METHODS:
        raise ValueError(f"unknown method {name!r}; expected one of {', '.join(METHODS)}")
    return METHODS[name].intersect(parameters, origins, directions)
