"""All crossings of a ray with one primitive; path tracing needs only the first of them."""

import math
from typing import Any, NamedTuple

from reference_rt.core.ray import Ray
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.dispatch import intersect, spans
from reference_rt.shapes.meshes.watertight import Shear
from reference_rt.shapes.shape import Spans, no_spans, one_span
from reference_rt.shapes.tables import BOX, QUADRIC, SPHERE, TORUS, Shapes, by_code

MAX_CROSSINGS = 4
"""The most crossings of one primitive: of a torus, and of a capped quadric of two sheets."""


class Along(NamedTuple):
    """Up to MOST crossings of a ray.  spans: t and u of each;  v: `Crossing.v` of the first."""

    spans: Spans
    v: float


@kernel
def along(shapes: Shapes, kind: int, i: int, ray: Ray, shear: Shear) -> Along:
    """The crossings with primitive i of a kind, in order.  For shapes that can have several, t may
    be 0 or negative."""
    if kind in (SPHERE, BOX, TORUS):
        return Along(spans(shapes, kind, i, ray), 0.0)
    if kind == QUADRIC:
        return Along(_of_quadric(shapes, kind, i, ray), 0.0)
    found = intersect(shapes, kind, i, ray, shear)
    return Along(one_span(found.t, found.u, math.inf, 0.0), found.v)


@by_code("crossings")
def _of_quadric(shapes: Shapes, kind: int, i: int, ray: Ray) -> Spans:
    return no_spans()


@kernel
def _rows(table: Any) -> int:
    return len(table.owner)


@by_code(lambda module: _rows)
def primitive_count(shapes: Shapes, kind: int) -> int:
    """The number of primitives of a kind."""
    return 0
