"""Polygon: rings of points in a plane, concave, with holes, crossing themselves.

The coordinates in the plane are those of the shape's own space without the largest axis of the
normal: the scene's own numbers, up to a power of two.  For polygons of points at z = 0 under one
transform, a point of a ray therefore has the same two coordinates, and a point on a shared edge or
corner belongs to exactly one of them.
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, WithJsonSchema, WrapValidator

from reference_rt.core import transform
from reference_rt.core.arrays import Bounds, FloatArray, IntArray
from reference_rt.core.model import Examples, Vector
from reference_rt.core.ray import UNIT_ROUNDOFF, Crossing, Hit, Ray, miss
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.flat import base
from reference_rt.shapes.flat.base import Integers, integers
from reference_rt.shapes.rounding import product_error
from reference_rt.shapes.shape import Shape, TabulationContext, Tangents, outward

NEARLY = 10**9 - 1, 10**9
"""Components of a normal with this quotient count as equal: roundings of decimals differ by far
less."""

OFF_PLANE = 64
"""The largest distance of a point from the plane of the others, in u times the largest coordinate:
a map rounds a point's coordinates some eight times, and at the other points the error of a plane
through three points is up to eight times as large."""

MASKS = {"even_odd": 1, "nonzero": -1}
"""The bits of a winding number of which at least one is 1 inside."""


def _point(value: Any, handler: Any) -> Any:
    if isinstance(value, list | tuple) and len(value) == 2:
        value = (*value, 0.0)
    try:
        return handler(value)
    except ValidationError:
        raise ValueError("expected two or three finite numbers [x, y] or [x, y, z]") from None


def _ring(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) < 3:
        raise ValueError("expected a ring of at least three points")
    return value


def _rings(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) < 1:
        raise ValueError("expected a list of rings, one at least")
    return value


_NUMBERS = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}

RingPoint = Annotated[Vector, WrapValidator(_point), WithJsonSchema(_NUMBERS)]
Ring = Annotated[tuple[RingPoint, ...], Field(strict=False), BeforeValidator(_ring)]


_STAR = ((0.0, 1.0), (0.6, -0.8), (-1.0, 0.3), (1.0, 0.3), (-0.6, -0.8))


class Polygon(Shape):
    """A flat area with any outline: concave, with holes, or self-intersecting.  All points lie in
    one plane; points of two numbers lie at z = 0.

    The front is the side from which the rings enclose more area counter-clockwise than clockwise.
    If both are equal, as in a figure eight, the first turn of the first ring is counter-clockwise.
    Under a transform that mirrors space the front stays the front.
    """

    EXAMPLES: ClassVar[Examples] = (
        {"rings": (((0, 0, 0), (1, 0, 1), (0, 1, 1)),)},
        *({"rings": (_STAR,), "fill": fill} for fill in ("even_odd", "nonzero")),
    )
    type: Literal["polygon"] = "polygon"
    rings: Annotated[tuple[Ring, ...], Field(strict=False), BeforeValidator(_rings)]
    """Rings of points [x, y] or [x, y, z], closed by themselves: the first point is not repeated.
    They may cross and touch themselves and each other."""
    fill: Literal["even_odd", "nonzero"] = "even_odd"
    """What is inside.  `even_odd`: points that a line to infinity leaves by crossing an odd number
    of edges, so that a ring in a ring is a hole.  `nonzero`: points that the rings wind around, so
    that only an opposite ring is a hole."""

    def tabulate(self, context: TabulationContext) -> "Polygons":
        m = self.map_in(context)
        points = np.array([p for ring in self.rings for p in ring])
        if np.abs(points).max() > 2.0**1000:
            raise ValueError("its coordinates overflow; expected finite numbers")
        ends = np.cumsum([len(ring) for ring in self.rings])
        axis, origin, slopes = _plane(points, ends)
        kept = [(axis + 1) % 3, (axis + 2) % 3]
        # A power of two, which is exact: products of scaled coordinates neither overflow nor
        # underflow.
        scale = math.ldexp(1.0, math.frexp(np.abs(points[:, kept]).max())[1])
        rings = np.split(points[:, kept] / scale, ends[:-1])
        outline = np.concatenate([np.hstack([r, np.roll(r, -1, axis=0)]) for r in rings])
        clockwise = _is_clockwise(outline, ends)
        if not _has_edges(outline, self.fill):
            raise ValueError(
                "the polygon has no area: its edges take each other back; expected others"
            )
        linear = m[:, :3]
        edges = [
            (linear[:, k] - s * linear[:, axis]) * scale for k, s in zip(kept, slopes, strict=True)
        ]
        made = base.columns(linear[:, axis] * origin + m[:, 3], edges[0], edges[1], context)
        if clockwise != transform.flips_orientation(m):
            made["normal"] = -made["normal"]
        return Polygons(
            lower=outline[:, :2].min(axis=0)[None],
            upper=outline[:, :2].max(axis=0)[None],
            mask=np.array([MASKS[self.fill]]),
            first=np.array([0]),
            size=np.array([len(outline)]),
            outline=outline,
            **made,
        )


class Polygons(NamedTuple):
    """n polygons of m edges in all.

    The columns of `flat.base` and of `placement.owners`;  lower, upper (n, 2): corners of the
    bounding rectangle;  mask (n,): the bits of a winding number that are not all 0 inside;
    first, size (n,): a polygon's edges in `outline`;  outline (m, 4): x, y of both ends.
    """

    center: FloatArray
    normal: FloatArray
    x_of: FloatArray
    y_of: FloatArray
    x_edge: FloatArray
    y_edge: FloatArray
    lower: FloatArray
    upper: FloatArray
    mask: IntArray
    first: IntArray
    size: IntArray
    outline: FloatArray
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


RAGGED = ("outline",)
"""Columns whose rows are not those of the polygons."""


def align(parts: Sequence[Polygons]) -> list[Polygons]:
    """Tables whose outlines may be put one after another."""
    starts = np.cumsum([0] + [len(part.outline) for part in parts])
    return [p._replace(first=p.first + k) for p, k in zip(parts, starts, strict=False)]


def bounds(polygons: Polygons) -> Bounds:
    """Boxes (n, 3), (n, 3) that contain the polygons, rounded outwards."""
    lower, upper = np.empty((2, *polygons.center.shape))
    for i, (k, size) in enumerate(zip(polygons.first, polygons.size, strict=True)):
        edges = np.array([polygons.x_edge[i], polygons.y_edge[i]])
        offsets = polygons.outline[k : k + size, :2] @ edges
        lower[i], upper[i] = offsets.min(axis=0), offsets.max(axis=0)
    # Two products and two sums.
    reach = np.abs(polygons.x_edge) + np.abs(polygons.y_edge)
    slack = 4.0 * UNIT_ROUNDOFF * (np.abs(polygons.center) + reach)
    return outward(polygons.center + lower - slack, polygons.center + upper + slack)


def _plane(points: FloatArray, ends: IntArray) -> tuple[int, float, tuple[float, float]]:
    """The plane of the points (m, 3): (k, a, (s, r)) of x_k = a - s x_(k+1) - r x_(k+2), in which k
    is the largest axis of the normal, the first of those NEARLY as large: the last digit of
    a corner must not turn the uv of a roof of 45 degrees.

    Exact except for the last rounding.  It is the plane of the first point and of two others that
    are as far away as possible.
    """
    p, one = integers(points)
    from_first = p - p[0]
    farthest = from_first[np.argmax((from_first * from_first).sum(axis=1))]
    crosses = np.cross(farthest, from_first)
    n = crosses[np.argmax((crosses * crosses).sum(axis=1))]
    if not n.any():
        raise ValueError("the polygon has no area: all its points are on a line")
    heights = from_first @ n
    k = int(np.argmax(np.abs(heights)))
    # |height / |n|| against OFF_PLANE u max |p|, squared.
    if heights[k] ** 2 * 2**106 > (OFF_PLANE * np.abs(p).max()) ** 2 * (n @ n):
        largest = np.abs(n).max()
        off = abs(heights[k]) / (largest * one) / math.hypot(*(n / largest))
        ring = int(np.searchsorted(ends, k, side="right"))
        number = k - (ends[ring - 1] if ring > 0 else 0)
        raise ValueError(
            f"ring {ring}: point {number} is {off:.3g} off the plane of the others; expected all "
            "in one plane"
        )
    size = np.abs(n)
    axis = int(np.argmax(size * NEARLY[1] >= size.max() * NEARLY[0]))
    s, r = n[(axis + 1) % 3] / n[axis], n[(axis + 2) % 3] / n[axis]
    return axis, (n @ p[0]) / (n[axis] * one), (s, r)


def _has_edges(outline: FloatArray, fill: str) -> bool:
    """Whether any edge is left when those that the rings go along in both directions cancel (for
    the even-odd rule, those that they go along an even number of times)."""
    times: Counter[tuple[float, ...]] = Counter()
    for a_x, a_y, b_x, b_y in (outline + 0.0).tolist():  # -0 + 0 is 0
        if (a_x, a_y) < (b_x, b_y):
            times[a_x, a_y, b_x, b_y] += 1
        elif (a_x, a_y) > (b_x, b_y):
            times[b_x, b_y, a_x, a_y] -= 1
    return any(n & MASKS[fill] for n in times.values())


def _is_clockwise(outline: FloatArray, ends: IntArray) -> bool:
    """Whether the rings go round clockwise as a whole; exact."""
    edges, _ = integers(outline)
    area = (edges[:, 0] * edges[:, 3] - edges[:, 1] * edges[:, 2]).sum()
    if area == 0:
        rings = np.split(edges[:, 2:] - edges[:, :2], ends[:-1])
        area = next((turn for ring in rings for turn in _turns(ring)), 0)
    if area == 0:
        raise ValueError("the polygon has no area: the points of each ring are on a line")
    return bool(area < 0)


def _turns(steps: Integers) -> Integers:
    """The turn from each of the steps (k, 2) to the next: above 0 if counter-clockwise; without
    straight ones."""
    steps = steps[(steps != 0).any(axis=1)]
    following = np.roll(steps, -1, axis=0)
    turns: Integers = steps[:, 0] * following[:, 1] - steps[:, 1] * following[:, 0]
    return np.asarray(turns[turns != 0])


@kernel
def exceeds(a: float, b: float, c: float, d: float) -> bool:
    """Whether a b > c d, exactly: rounding keeps the order of the products or makes them equal;
    then the rounding errors decide."""
    p, q = a * b, c * d
    if p != q:
        return p > q
    larger: bool = product_error(a, b, p) > product_error(c, d, q)
    return larger


@kernel
def winding_number(polygons: Polygons, i: int, x: float, y: float) -> int:
    """The winding number of polygon i around the point: the number of edges that cross the line
    from it to +x upwards, less those downwards (Sunday 2001).  Its last bit is 1 if the number of
    edges is odd.

    A vertex on the line counts as below, an edge through the point as passing on its left: a point
    on an edge belongs to the polygon on its right or, if the edge is level, above.  Vertices are
    taken relative to the point, rounded once, in the same way for all edges there; from these,
    `exceeds` is exact.
    """
    outline = polygons.outline
    winding = 0
    begin = polygons.first[i]
    for k in range(begin, begin + polygons.size[i]):
        a_y, b_y = outline[k, 1], outline[k, 3]
        if (a_y > y) != (b_y > y):
            a_x, b_x = outline[k, 0] - x, outline[k, 2] - x
            a_y, b_y = a_y - y, b_y - y
            if b_y > 0.0:
                if exceeds(a_x, b_y, a_y, b_x):
                    winding += 1
            elif exceeds(a_y, b_x, a_x, b_y):
                winding -= 1
    return winding


@kernel
def intersect(polygons: Polygons, i: int, ray: Ray) -> Crossing:
    """Where the ray meets polygon i, at a cost proportional to the number of its edges; u, v are x,
    y of the plane."""
    found = base.meet(polygons, i, ray)
    x, y = found.u, found.v
    # Outside of the bounding rectangle the winding number is 0.
    if found.t == math.inf or x < polygons.lower[i, 0] or x > polygons.upper[i, 0]:
        return miss()
    if y < polygons.lower[i, 1] or y > polygons.upper[i, 1]:
        return miss()
    if winding_number(polygons, i, x, y) & polygons.mask[i] != 0:
        return found
    return miss()


surface = base.surface


@kernel
def uv(polygons: Polygons, ray: Ray, hit: Hit) -> tuple[float, float]:
    """x and y of the plane, from 0 to 1 across the bounding rectangle."""
    lower, upper = polygons.lower, polygons.upper
    u = (hit.u - lower[hit.row, 0]) / (upper[hit.row, 0] - lower[hit.row, 0])
    v = (hit.v - lower[hit.row, 1]) / (upper[hit.row, 1] - lower[hit.row, 1])
    return u, v


@kernel
def tangents(polygons: Polygons, ray: Ray, hit: Hit) -> Tangents:
    i, lower, upper = hit.row, polygons.lower, polygons.upper
    return Tangents(
        row(polygons.x_edge, i) * (upper[i, 0] - lower[i, 0]),
        row(polygons.y_edge, i) * (upper[i, 1] - lower[i, 1]),
    )
