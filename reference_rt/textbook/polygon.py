"""Planar polygon of one or more rings: even-odd, winding number and angle sum (row T9).

All intersect the plane, project along the largest axis of the normal (`along_normal`: along the
normal itself), and test in two dimensions whether the point is inside.  There, vertices are
relative to the point.  Costs are per edge, beside 10 +, 9 *, 1 / for the plane.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.ray import UNIT_ROUNDOFF, Ray, at
from reference_rt.core.vec3 import Vec3, component, dot
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.textbook.method import FloatArray, Method, family, points, ray_of, vector


class PolygonParameters(NamedTuple):
    """Rings, each (k, 3) points in world coordinates, k >= 3, all in one plane.  The last point is
    joined to the first.

    Rings may be concave and cross themselves and each other.  A ring within a ring is a hole for
    `even_odd`; for `winding` and `angle_sum` only if it has the opposite orientation.
    """

    rings: Sequence[npt.ArrayLike]


Prepared = tuple[FloatArray, Vec3, Vec3, int]
"""edges (m, 4): both ends in two dimensions; normal; a point of the plane; the projected axis."""


def _plane(vertices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(normal (3,), point (3,)) of the plane of all vertices.

    It is spanned by the vertex farthest from the first and the one farthest from their line,
    because the area normal (Newell) may be zero for rings that cross themselves.  The component
    along that line is removed first: the cross product of two long legs of a thin polygon rounds by
    more than its thickness.
    """
    legs = vertices - vertices[0]
    along = legs[np.argmax(np.linalg.norm(legs, axis=1))]
    # An affine map rounds each coordinate some 8 times, and the computation here as often again.
    error = 32.0 * UNIT_ROUNDOFF * np.abs(vertices).max()
    # tiny: if all vertices are equal.
    across = legs - np.outer(legs @ along / max(along @ along, np.finfo(float).tiny), along)
    heights = np.linalg.norm(across, axis=1)
    if not heights.max() > error:
        raise ValueError("the polygon has no area; expected three vertices that are not on a line")
    normal = np.cross(along, across[np.argmax(heights)])
    off = np.abs(legs @ normal).max() / np.linalg.norm(normal)
    if off > error:
        raise ValueError(f"a vertex is {off:.3g} off the plane of the others; expected one plane")
    return normal, vertices[0]


def _rings(polygon: PolygonParameters) -> list[FloatArray]:
    """Checked."""
    rings = [points(ring, "ring") for ring in polygon.rings]
    if not rings or min(len(ring) for ring in rings) < 3:
        raise ValueError("expected at least one ring, and three vertices in each")
    return rings


def _edges(rings: list[FloatArray]) -> FloatArray:
    """(m, 4): both ends of the edges of rings (k, 2)."""
    edges = np.concatenate([np.hstack([ring, np.roll(ring, -1, 0)]) for ring in rings])
    return np.ascontiguousarray(edges)


def prepare(polygon: PolygonParameters) -> Prepared:
    """The rings as edges in two dimensions, and the plane, checked."""
    rings = _rings(polygon)
    normal, point = _plane(np.concatenate(rings))
    axis = int(np.argmax(np.abs(normal)))
    kept = [(axis + 1) % 3, (axis + 2) % 3]
    edges = _edges([ring[:, kept] for ring in rings])
    return edges, vector(normal, "normal"), vector(point, "point"), axis


Framed = tuple[FloatArray, Vec3, Vec3, Vec3, Vec3]
"""edges (m, 4): both ends in the frame of the plane, from its point; normal; that point; the two
unit vectors of the frame."""


def prepare_framed(polygon: PolygonParameters) -> Framed:
    """The rings as edges in an orthonormal frame of the plane, and the plane, checked."""
    rings = _rings(polygon)
    normal, point = _plane(np.concatenate(rings))
    x = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    frame = np.stack([x, np.cross(normal, x)])
    frame /= np.linalg.norm(frame, axis=1, keepdims=True)
    edges = _edges([(ring - point) @ frame.T for ring in rings])
    return edges, *(vector(v, "frame") for v in (normal, point, *frame))  # type: ignore[return-value]


@kernel
def plane_distance(ray: Ray, normal: Vec3, point: Vec3) -> float:
    """t > 0 at which the ray hits the plane; inf if it is parallel or points away."""
    slope = dot(normal, ray.d)
    if slope == 0.0:
        return math.inf
    t = dot(normal, point - ray.o) / slope
    return t if t > 0.0 else math.inf


@kernel
def even_odd(ray: Ray, edges: FloatArray, normal: Vec3, point: Vec3, axis: int) -> float:
    """Inside if a line from the point to +x crosses an odd number of edges (Jordan).

    Vertex rule: a vertex on the line counts as above it, so an edge spans the half-open range
    of y from its lower end (included) to its upper, and each vertex passed counts once.  An edge
    that spans y = 0 crosses at x = a_x - a_y (b_x - a_x) / (b_y - a_y).
    Cost: 4 +; an edge that spans needs 3 +, 1 *, 1 / more.
    Fails: at edges.  The crossing of the reversed edge rounds differently: of points on the edge of
    two neighbours, measured, one in five belongs to neither and one in ten to both.
    """
    t = plane_distance(ray, normal, point)
    if t == math.inf:
        return math.inf
    p = at(ray, t)
    x, y = component(p, (axis + 1) % 3), component(p, (axis + 2) % 3)
    inside = False
    for i in range(len(edges)):
        a_x, a_y = edges[i, 0] - x, edges[i, 1] - y
        b_x, b_y = edges[i, 2] - x, edges[i, 3] - y
        if (a_y >= 0.0) != (b_y >= 0.0):
            if a_x - a_y * (b_x - a_x) / (b_y - a_y) > 0.0:
                inside = not inside
    return t if inside else math.inf


@kernel
def winding_number(edges: FloatArray, x: float, y: float) -> int:
    """How often the rings wind around (x, y): see `winding`."""
    number = 0
    for i in range(len(edges)):
        a_x, a_y = edges[i, 0] - x, edges[i, 1] - y
        b_x, b_y = edges[i, 2] - x, edges[i, 3] - y
        if (a_y >= 0.0) != (b_y >= 0.0):
            side = a_x * b_y - a_y * b_x
            if b_y >= 0.0 and side > 0.0:
                number += 1
            elif b_y < 0.0 and side < 0.0:
                number -= 1
    return number


@kernel
def winding(ray: Ray, edges: FloatArray, normal: Vec3, point: Vec3, axis: int) -> float:
    """Inside if the rings wind around the point: a signed count of crossings that is not zero.

    An edge that crosses the line to +x upwards counts +1, downwards -1, by the same vertex rule;
    the sign of a x b says on which side of the point it passes.  That sign is exactly the opposite
    for the reversed edge, so that a point belongs to exactly one of two neighbours.
    Cost: 4 +; an edge that spans needs 1 +, 2 * more.
    Fails: at edges in oblique planes, where neighbours round the point itself differently.
    """
    t = plane_distance(ray, normal, point)
    if t == math.inf:
        return math.inf
    p = at(ray, t)
    x, y = component(p, (axis + 1) % 3), component(p, (axis + 2) % 3)
    return t if winding_number(edges, x, y) != 0 else math.inf


@kernel
def along_normal(ray: Ray, edges: FloatArray, normal: Vec3, point: Vec3, u: Vec3, v: Vec3) -> float:
    """`winding`, with point and vertices projected along the normal, onto axes u and v in the
    plane: no area shrinks.

    Cost: as `winding`, and 7 +, 6 * for the point.
    Fails: at edges in all planes: the vertices are rounded in the frame of each polygon, so that
    neighbours do not even share them.
    """
    t = plane_distance(ray, normal, point)
    if t == math.inf:
        return math.inf
    p = at(ray, t) - point
    return t if winding_number(edges, dot(u, p), dot(v, p)) != 0 else math.inf


@kernel
def angle_sum(ray: Ray, edges: FloatArray, normal: Vec3, point: Vec3, axis: int) -> float:
    """Inside if the signed angles that the edges subtend sum to ±2 pi, not to 0.

    The sum is 2 pi times the winding number; it is compared with pi.
    Cost: 7 +, 4 *, 1 atan2.
    Fails: at edges, where the angle is pi or -pi by the sign of a zero: both neighbours may own the
    point.  The rounding of the sum is harmless: some m u for m edges, against pi.
    """
    t = plane_distance(ray, normal, point)
    if t == math.inf:
        return math.inf
    p = at(ray, t)
    x, y = component(p, (axis + 1) % 3), component(p, (axis + 2) % 3)
    total = 0.0
    for i in range(len(edges)):
        a_x, a_y = edges[i, 0] - x, edges[i, 1] - y
        b_x, b_y = edges[i, 2] - x, edges[i, 3] - y
        total += math.atan2(a_x * b_y - a_y * b_x, a_x * b_x + a_y * b_y)
    return t if abs(total) > math.pi else math.inf


@entry_kernel
def _even_odd(polygon: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = even_odd(ray_of(o, d, i), *polygon)


@entry_kernel
def _winding(polygon: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = winding(ray_of(o, d, i), *polygon)


@entry_kernel
def _along_normal(polygon: Framed, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = along_normal(ray_of(o, d, i), *polygon)


@entry_kernel
def _angle_sum(polygon: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = angle_sum(ray_of(o, d, i), *polygon)


_method = family("polygon", "T9", PolygonParameters, prepare)

METHODS = (
    _method(
        "even_odd",
        "an odd number of edges crossed, with the half-open vertex rule",
        "Shimrat 1962, Algorithm 112; Haines 1994, Point in Polygon Strategies, Graphics Gems IV",
        _even_odd,
    ),
    _method(
        "winding",
        "a signed count of crossings",
        "Hormann & Agathos 2001, Computational Geometry 20(3)",
        _winding,
    ),
    _method(
        "angle_sum",
        "the sum of signed angles",
        "Haines 1994, Point in Polygon Strategies, Graphics Gems IV",
        _angle_sum,
    ),
    Method(
        "polygon.along_normal",
        "T9",
        "a signed count of crossings, projected along the normal",
        "elementary",
        PolygonParameters,
        prepare_framed,
        _along_normal,
    ),
)
