"""Textbook intersection methods, by name, to measure what each costs and where it fails.

The renderer does not use them; a docstring that says "the renderer's method" marks the one that it
also has.  `intersect(name, parameters, origins, directions)` intersects one shape, solid or scene;
`METHODS` has each method's textbook row, summary and source.

Contract of a method: a kernel of a ray and the prepared parameters that returns the smallest t > 0
in units of |d|, inf for a miss; its docstring states "Cost:" (operations) and "Fails:" (known
failures, which the tests check); `reference-rt methods` prints both.  In both, u = 2^-53.  To add
a family: a file with its parameters (a NamedTuple), kernels and `METHODS`, named in `METHODS`
below.
"""

from typing import Any

import numpy.typing as npt

from reference_rt.textbook import box, csg, hierarchy, picture, polygon, sphere, triangle
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
    for family in (sphere, triangle, box, polygon, csg, hierarchy, picture)
    for method in family.METHODS
}


def names(family: str | None = None) -> tuple[str, ...]:
    """The names of all methods, or of one family: "sphere", "triangle", "box", "polygon", "csg",
    "hierarchy", "picture"."""
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
