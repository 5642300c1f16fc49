"""Watertight ray-triangle test: edge functions in ray space, exact for rays through edges too."""

from typing import Any, NamedTuple

from reference_rt.core.arrays import FloatArray, IdArray
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import component
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import VECTOR_WIDTH, select, simd_kernel
from reference_rt.shapes.rounding import product_error


class Shear(NamedTuple):
    """The transform to ray space, where the direction is the unit z axis: the axes permuted to x y
    z, the origin, and the shear (Woop, Benthin & Wald 2013, JCGT 2(1))."""

    x: int
    y: int
    z: int
    o_x: float
    o_y: float
    o_z: float
    s_x: float
    s_y: float
    s_z: float


@kernel
def shear_of(ray: Ray) -> Shear:
    """Computed once per ray: the largest axis of d becomes z; x and y swap to keep the winding."""
    z = 2
    if abs(ray.d.x) >= abs(ray.d.y) and abs(ray.d.x) >= abs(ray.d.z):
        z = 0
    elif abs(ray.d.y) >= abs(ray.d.z):
        z = 1
    x, y = (z + 1) % 3, (z + 2) % 3
    d_z = component(ray.d, z)
    if d_z < 0.0:
        x, y = y, x
    return Shear(
        x,
        y,
        z,
        component(ray.o, x),
        component(ray.o, y),
        component(ray.o, z),
        component(ray.d, x) / d_z,
        component(ray.d, y) / d_z,
        1.0 / d_z,
    )


CANCELLED = 16.0
"""The largest ratio of the products of edge functions to the triangle's projected area, their sum,
at which the rounded edge functions are used.

The products round by u each, and so the barycentrics by CANCELLED u: the error of the point is this
fraction of the projected triangle.  Where more digits cancel, on slivers and for grazing rays, the
error could be as large as the triangle."""


class Projection(NamedTuple):
    """A triangle in ray space: its edge functions, whose sum is twice its area, and the depths of
    its vertices; side: 0 for a miss, 1 if the ray comes from the front, -1 from behind."""

    side: int
    e0: float
    e1: float
    e2: float
    a_z: float
    b_z: float
    c_z: float


@kernel
def project(points: FloatArray, corners: IdArray, i: int, shear: Shear) -> Projection:
    """The triangle whose vertices are the points (m, 3) in the rows corners[i], in ray space."""
    a, b, c = int(corners[i, 0]), int(corners[i, 1]), int(corners[i, 2])
    return _project(points.reshape(-1), 3 * a, 3 * b, 3 * c, 1, shear)


@kernel
def load_projection(
    corners: FloatArray, first: int, size: int, lane: int, shear: Shear, seen: FloatArray
) -> Projection:
    """A triangle of a BVH leaf, in ray space;  seen: the results that `project_leaf` has stored."""
    if seen[_DOUBT + lane] == 0.0:
        e0 = seen[lane]
        side = 1 if e0 > 0.0 else -1
        e1, e2 = seen[VECTOR_WIDTH + lane], seen[2 * VECTOR_WIDTH + lane]
        depths = (
            seen[3 * VECTOR_WIDTH + lane],
            seen[4 * VECTOR_WIDTH + lane],
            seen[5 * VECTOR_WIDTH + lane],
        )
        return Projection(side, e0, e1, e2, depths[0], depths[1], depths[2])
    a = 9 * first + lane
    return _project(corners, a, a + 3 * size, a + 6 * size, size, shear)


@kernel
def _project(v: FloatArray, a: int, b: int, c: int, stride: int, shear: Shear) -> Projection:
    """The triangle whose vertices have the coordinates v[a], v[a + stride] and v[a + 2 stride], and
    so on from b and from c (Woop, Benthin & Wald 2013).

    The projection of a vertex does not depend on the triangle, and the edge functions of two
    neighbours differ only in sign.  Products round monotonically: a difference that is not 0 has
    the right sign.  Where it is 0, `exact_edge_function` decides: a ray through a shared edge or
    vertex meets exactly those of the triangles around it that it would meet a hair beside it.
    """
    x, y, z = stride * shear.x, stride * shear.y, stride * shear.z
    a_z = v[a + z] - shear.o_z
    b_z = v[b + z] - shear.o_z
    c_z = v[c + z] - shear.o_z
    a_x = v[a + x] - shear.o_x - shear.s_x * a_z
    b_x = v[b + x] - shear.o_x - shear.s_x * b_z
    c_x = v[c + x] - shear.o_x - shear.s_x * c_z
    a_y = v[a + y] - shear.o_y - shear.s_y * a_z
    b_y = v[b + y] - shear.o_y - shear.s_y * b_z
    c_y = v[c + y] - shear.o_y - shear.s_y * c_z
    left0, right0 = c_x * b_y, c_y * b_x
    left1, right1 = a_x * c_y, a_y * c_x
    left2, right2 = b_x * a_y, b_y * a_x
    e0, e1, e2 = left0 - right0, left1 - right1, left2 - right2
    side = 0
    if e0 > 0.0 and e1 > 0.0 and e2 > 0.0:
        side = 1
    elif e0 < 0.0 and e1 < 0.0 and e2 < 0.0:
        side = -1
    if side != 0:
        size = abs(left0) + abs(right0) + abs(left1) + abs(right1) + abs(left2) + abs(right2)
        if size > CANCELLED * abs(e0 + e1 + e2):
            e0, _ = exact_edge_function(c_x, c_y, b_x, b_y)
            e1, _ = exact_edge_function(a_x, a_y, c_x, c_y)
            e2, _ = exact_edge_function(b_x, b_y, a_x, a_y)
    elif e0 == 0.0 or e1 == 0.0 or e2 == 0.0:
        e0, s0 = exact_edge_function(c_x, c_y, b_x, b_y)
        e1, s1 = exact_edge_function(a_x, a_y, c_x, c_y)
        e2, s2 = exact_edge_function(b_x, b_y, a_x, a_y)
        side = s0 if s0 == s1 and s1 == s2 else 0
    return Projection(side, e0, e1, e2, a_z, b_z, c_z)


_DOUBT = 6 * VECTOR_WIDTH
PROJECTION_FLOATS = 7 * VECTOR_WIDTH


@simd_kernel
def _project_leaf(
    corners: Any,
    start: Any,
    size: Any,
    x: Any,
    y: Any,
    z: Any,
    o_x: Any,
    o_y: Any,
    o_z: Any,
    s_x: Any,
    s_y: Any,
    seen: Any,
) -> Any:
    """`_project` for the triangles of a BVH leaf, by the same operations, without the exact cases:
    stores which triangles need these.  Returns those whose edge functions do not differ in sign."""
    x, y, z = start + x * size, start + y * size, start + z * size
    a_z = corners.load(z) - o_z
    b_z = corners.load(z + 3 * size) - o_z
    c_z = corners.load(z + 6 * size) - o_z
    a_x = corners.load(x) - o_x - s_x * a_z
    b_x = corners.load(x + 3 * size) - o_x - s_x * b_z
    c_x = corners.load(x + 6 * size) - o_x - s_x * c_z
    a_y = corners.load(y) - o_y - s_y * a_z
    b_y = corners.load(y + 3 * size) - o_y - s_y * b_z
    c_y = corners.load(y + 6 * size) - o_y - s_y * c_z
    left0, right0 = c_x * b_y, c_y * b_x
    left1, right1 = a_x * c_y, a_y * c_x
    left2, right2 = b_x * a_y, b_y * a_x
    e0, e1, e2 = left0 - right0, left1 - right1, left2 - right2
    for k, number in enumerate((e0, e1, e2, a_z, b_z, c_z)):
        seen.store(k * VECTOR_WIDTH, number)
    products = abs(left0) + abs(right0) + abs(left1) + abs(right1) + abs(left2) + abs(right2)
    in_front = (e0 > 0.0) & (e1 > 0.0) & (e2 > 0.0)
    behind = (e0 < 0.0) & (e1 < 0.0) & (e2 < 0.0)
    cancelled = products > abs(e0 + e1 + e2) * CANCELLED
    seen.store(_DOUBT, select((in_front | behind) & ~cancelled, 0.0, 1.0))
    below = (e0 < 0.0) | (e1 < 0.0) | (e2 < 0.0)
    above = (e0 > 0.0) | (e1 > 0.0) | (e2 > 0.0)
    return ~(below & above)


@kernel
def project_leaf(corners: FloatArray, first: int, size: int, shear: Shear, seen: FloatArray) -> int:
    """Projects the triangles of a BVH leaf in SIMD.  Returns, as bits, for which of them
    `load_projection` must be called: all that the ray meets, and some whose edges it passes
    through; seen (`PROJECTION_FLOATS`,): where the results are stored for that.

    The vertices of references first .. first + size, VECTOR_WIDTH at most, are in `corners` from 9
    first on: the first coordinate of each, the second of each, and so on.  Lanes beyond the last
    reference read the numbers that follow, and are ignored.
    """
    met = _project_leaf(
        corners,
        9 * first,
        size,
        shear.x,
        shear.y,
        shear.z,
        shear.o_x,
        shear.o_y,
        shear.o_z,
        shear.s_x,
        shear.s_y,
        seen,
    )
    return met & ((1 << size) - 1)


@kernel
def exact_edge_function(p_x: float, p_y: float, q_x: float, q_y: float) -> tuple[float, int]:
    """The edge function p_x q_y - p_y q_x to within one rounding, and its exact sign.

    On the edge it is the sign beside the edge, as if the ray were moved by (h, h²) for an
    infinitesimal h > 0 (simulation of simplicity): 0 only for an edge without length.
    """
    left, right = p_x * q_y, p_y * q_x
    e = left - right + (product_error(p_x, q_y, left) - product_error(p_y, q_x, right))
    along_x, along_y = p_y - q_y, q_x - p_x
    for decides in (e, along_x, along_y):
        if decides > 0.0:
            return e, 1
        if decides < 0.0:
            return e, -1
    return 0.0, 0
