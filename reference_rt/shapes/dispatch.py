"""The kernels that all shapes have in common: each calls that of the shape's type.

kind is the code of a table (`Hit.kind`), i a row of it.  The chains of `if kind == ...` are
generated from `TABLES`.  A function's body is for types without the kernel (only solids have
`spans`, only shapes that can be lights `sample` and `pdf`) and for absent tables.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from reference_rt.core.ray import (
    Crossing,
    Hit,
    HitBlock,
    PointBlock,
    Ray,
    RayBlock,
    SurfacePoint,
    hit_of,
    miss,
    put_point,
    ray_of,
)
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.meshes.watertight import Shear
from reference_rt.shapes.shape import (
    NO_LIGHT_POINT,
    LightPoint,
    Spans,
    Tangents,
    in_column,
    no_spans,
    one_span,
)
from reference_rt.shapes.tables import Shapes, by_code


@by_code("intersect")
def intersect(shapes: Shapes, kind: int, i: int, ray: Ray, shear: Shear) -> Crossing:
    """Where the ray meets one primitive first, beyond t = 0.  shear: the ray's, for triangles."""
    return miss()


@by_code("surface", code="hit.kind")
def surface(shapes: Shapes, ray: Ray, hit: Hit) -> SurfacePoint:
    """The surface point at a hit of a primitive."""
    nothing = Vec3(0.0, 0.0, 0.0)
    return SurfacePoint(nothing, nothing, nothing, 0.0, -1, -1)


@by_code.stage()
def surfaces(
    table: Any, kind: int, rays: RayBlock, hits: HitBlock, n: int, points: PointBlock
) -> None:
    """The surface points of those of a block's first n hits that are on shapes of one type."""
    for j in range(n):
        if hits.codes[j] == kind:
            put_point(points, j, surface(table, ray_of(rays, j), hit_of(hits, j)))


@by_code("uv", code="hit.kind")
def uv(shapes: Shapes, ray: Ray, hit: Hit) -> tuple[float, float]:
    """The surface coordinates u, v at a hit."""
    return 0.0, 0.0


@by_code("tangents", code="hit.kind")
def tangents(shapes: Shapes, ray: Ray, hit: Hit) -> Tangents:
    """dp/du and dp/dv at a hit."""
    nothing = Vec3(0.0, 0.0, 0.0)
    return Tangents(nothing, nothing)


@by_code("face_of", code="hit.kind")
def face(shapes: Shapes, hit: Hit) -> int:
    """The number of the face that was hit, within its shape; 0 for shapes of one face."""
    return 0


@by_code("colour", code="hit.kind")
def colour(shapes: Shapes, hit: Hit, without: Vec3) -> Vec3:
    """The interpolated vertex colour of a mesh; `without` for hits that have none."""
    return without


@by_code("enters")
def enters(shapes: Shapes, kind: int, i: int, shear: Shear) -> int:
    """+1 if the ray comes to a triangle from the front, -1 if it comes from behind, 0 for a
    miss."""
    return 0


@kernel
def _owner_of_row(table: Any, i: int) -> int:
    return in_column(table.owner, i)


@by_code(lambda module: _owner_of_row)
def owner(shapes: Shapes, kind: int, i: int) -> int:
    """Index of the shape, in the scene or in its group, that a primitive belongs to."""
    return -1


@by_code("spans")
def spans(shapes: Shapes, kind: int, i: int, ray: Ray) -> Spans:
    """The intervals of t in which the ray's line is inside one solid."""
    return no_spans()


@by_code("sample")
def sample(
    shapes: Shapes, kind: int, i: int, area: float, p: Vec3, u0: float, u1: float
) -> LightPoint:
    """A point sampled on one primitive as a light for `p`; `pdf` returns its density.  area: of the
    primitive."""
    return NO_LIGHT_POINT


@by_code("sample_by_area")
def sample_fixed(
    shapes: Shapes, kind: int, i: int, area: float, p: Vec3, u0: float, u1: float
) -> LightPoint:
    """`sample`, but of a rectangle the same point wherever it is seen from."""
    return sample(shapes, kind, i, area, p, u0, u1)


@by_code("pdf")
def pdf(shapes: Shapes, kind: int, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle with which `sample` picks, from `p`, the point `q`."""
    return 0.0


MAX_CROSSINGS = 4
"""The most crossings of one primitive: of a torus, and of a capped quadric of two sheets."""


class Along(NamedTuple):
    """Up to MOST crossings of a ray.  spans: t and u of each;  v: `Crossing.v` of the first."""

    spans: Spans
    v: float


def _along_of(module: Any) -> Callable[..., Along] | None:
    crossings = getattr(module, "crossings", None)
    if crossings is None:
        return None

    @kernel
    def of_several(table: Any, i: int, ray: Ray) -> Along:
        return Along(crossings(table, i, ray), 0.0)

    return of_several


@by_code(_along_of)
def along(shapes: Shapes, kind: int, i: int, ray: Ray, shear: Shear) -> Along:
    """The crossings with primitive i of a kind, in order.  For shapes that can have several, t may
    be 0 or negative."""
    first = intersect(shapes, kind, i, ray, shear)
    return Along(one_span(first.t, first.u, math.inf, 0.0), first.v)


@kernel
def _rows(table: Any) -> int:
    return len(table.face)


@by_code(lambda module: _rows)
def primitive_count(shapes: Shapes, kind: int) -> int:
    """The number of primitives of a kind."""
    return 0
