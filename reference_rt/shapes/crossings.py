"""All crossings of a ray with one primitive, which path tracing, after the first, does not need."""

import math
from typing import Any, NamedTuple

from reference_rt.core.ray import Ray
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.curved.quadrics import Quadrics, crossings
from reference_rt.shapes.dispatch import intersect, spans
from reference_rt.shapes.meshes.watertight import Shear
from reference_rt.shapes.shape import Spans, no_spans, one_span
from reference_rt.shapes.tables import BOX, QUADRIC, SPHERE, TORUS, Shapes, by_code

MOST = 4
"""Of one primitive: a torus has so many, and so has a capped quadric of two sheets."""


class Along(NamedTuple):
    """Up to MOST crossings of a ray: `Spans`, with what more its first needs, as `Crossing.v`."""

    spans: Spans
    v: float


@kernel
def along(shapes: Shapes, kind: int, i: int, ray: Ray, shear: Shear) -> Along:
    """Those of primitive i of a kind, in order; the t of those of shapes that can have several may
    be 0 and below."""
    if kind in (SPHERE, BOX, TORUS):
        return Along(spans(shapes, kind, i, ray), 0.0)
    if kind == QUADRIC:
        return Along(_of_quadric(shapes.quadrics, i, ray), 0.0)
    found = intersect(shapes, kind, i, ray, shear)
    return Along(one_span(found.t, found.u, math.inf, 0.0), found.v)


@kernel
def _of_quadric(quadrics: Quadrics | None, i: int, ray: Ray) -> Spans:
    if quadrics is None:
        return no_spans()
    return crossings(quadrics, i, ray)


@kernel
def _rows(table: Any) -> int:
    return len(table.owner)


@by_code(lambda module: _rows)
def number_of(shapes: Shapes, kind: int) -> int:
    """How many primitives of a kind there are."""
    return 0
