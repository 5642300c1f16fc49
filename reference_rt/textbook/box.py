"""Axis-aligned closed box: six planes, and three slab tests (row T8).

Costs are for a hit from outside, without comparisons.
"""

import math
from typing import NamedTuple

import numpy.typing as npt

from reference_rt.core.ray import Ray, at
from reference_rt.core.vec3 import Vec3, component
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.textbook.method import FloatArray, family, ray_of, vector


class BoxParameters(NamedTuple):
    """The smallest and the largest corner (3,) in world coordinates."""

    lower: npt.ArrayLike
    upper: npt.ArrayLike


Prepared = tuple[Vec3, Vec3]


def prepare(box: BoxParameters) -> Prepared:
    """Both corners, checked."""
    lower, upper = vector(box.lower, "lower"), vector(box.upper, "upper")
    if not all(a <= b for a, b in zip(lower, upper, strict=True)):
        raise ValueError(f"expected lower <= upper on every axis, got {box.lower} and {box.upper}")
    return lower, upper


@kernel
def face(ray: Ray, lower: Vec3, upper: Vec3, axis: int, plane: float) -> float:
    """t > 0 of the face across `axis` at the coordinate `plane`, inf for a miss."""
    d = component(ray.d, axis)
    if d == 0.0:
        return math.inf
    t = (plane - component(ray.o, axis)) / d
    p = at(ray, t)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    inside_j = component(lower, j) <= component(p, j) <= component(upper, j)
    inside_k = component(lower, k) <= component(p, k) <= component(upper, k)
    return t if t > 0.0 and inside_j and inside_k else math.inf


@kernel
def six_planes(ray: Ray, lower: Vec3, upper: Vec3) -> float:
    """Each face separately: intersect its plane, test the point against the face; the nearest wins.

    Cost: 24 +, 18 *, 6 /.
    Fails: at edges, where the points of both faces may round to the outside.  The ray passes
    between them and hits the far side, a wrong t: measured, one ray in 200 aimed at an edge.
    """
    closest = math.inf
    for axis in range(3):
        t = face(ray, lower, upper, axis, component(lower, axis))
        if t < closest:
            closest = t
        t = face(ray, lower, upper, axis, component(upper, axis))
        if t < closest:
            closest = t
    return closest


@kernel
def slabs_parallel_test(ray: Ray, lower: Vec3, upper: Vec3) -> float:
    """Three slabs: the last entry and the first exit; parallel rays by a test.

    For d_axis = 0 the origin must lie in the slab, or the ray misses.  Else t = (plane - o) / d for
    both planes, in order.  Origin inside: t_far.
    Cost: 6 +, 6 /.
    Fails: only where t_near and t_far differ by at most two roundings, at a silhouette.
    """
    t_near, t_far = -math.inf, math.inf
    for axis in range(3):
        o, d = component(ray.o, axis), component(ray.d, axis)
        low, high = component(lower, axis), component(upper, axis)
        if d == 0.0:
            if o < low or o > high:
                return math.inf
        else:
            t0, t1 = (low - o) / d, (high - o) / d
            if t0 > t1:
                t0, t1 = t1, t0
            if t0 > t_near:
                t_near = t0
            if t1 < t_far:
                t_far = t1
            if t_near > t_far or t_far <= 0.0:
                return math.inf
    return t_near if t_near > 0.0 else t_far


@kernel
def slabs_ieee(ray: Ray, lower: Vec3, upper: Vec3) -> float:
    """Slabs by 1 / d, whose infinities replace the parallel test; the renderer's method.

    1 / ±0 = ±inf puts the planes at -inf and +inf for an origin in the slab, and both on one side
    for any other.  An origin in the plane itself gives 0 * inf = NaN, for which every comparison is
    false: the box is closed.  The reciprocals depend on the ray alone, so that many boxes share
    three divisions.
    Cost: 6 +, 6 *, 3 /.
    Fails: as `slabs_parallel_test`, with three roundings; |d_axis| < 2**-1024 counts as parallel.
    """
    t_near, t_far = -math.inf, math.inf
    for axis in range(3):
        o, inverse = component(ray.o, axis), 1.0 / component(ray.d, axis)
        t0 = (component(lower, axis) - o) * inverse
        t1 = (component(upper, axis) - o) * inverse
        if inverse < 0.0:
            t0, t1 = t1, t0
        if t0 > t_near:
            t_near = t0
        if t1 < t_far:
            t_far = t1
    t = t_near if t_near > 0.0 else t_far
    return t if t_near <= t_far and t > 0.0 else math.inf


@kernel
def slabs_unrolled(ray: Ray, lower: Vec3, upper: Vec3) -> float:
    """`slabs_ieee` with its loop written out: no axis is looked up, and a ray that misses in x and
    y is not tested in z.

    The bits of `slabs_ieee`: t0 and t1 are in order by the sign of 1 / d, and NaN is replaced.
    Cost: 6 +, 6 *, 3 /; a miss by y needs 4 +, 4 *, 2 /.
    Fails: as `slabs_ieee` does.
    """
    inverse = 1.0 / ray.d.x
    t_near, t_far = (lower.x - ray.o.x) * inverse, (upper.x - ray.o.x) * inverse
    if inverse < 0.0:
        t_near, t_far = t_far, t_near
    if math.isnan(t_near):
        t_near = -math.inf
    if math.isnan(t_far):
        t_far = math.inf
    inverse = 1.0 / ray.d.y
    t0, t1 = (lower.y - ray.o.y) * inverse, (upper.y - ray.o.y) * inverse
    if inverse < 0.0:
        t0, t1 = t1, t0
    if t0 > t_near:
        t_near = t0
    if t1 < t_far:
        t_far = t1
    if t_near > t_far:
        return math.inf
    inverse = 1.0 / ray.d.z
    t0, t1 = (lower.z - ray.o.z) * inverse, (upper.z - ray.o.z) * inverse
    if inverse < 0.0:
        t0, t1 = t1, t0
    if t0 > t_near:
        t_near = t0
    if t1 < t_far:
        t_far = t1
    t = t_near if t_near > 0.0 else t_far
    return t if t_near <= t_far and t > 0.0 else math.inf


@entry_kernel
def _six_planes(box: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = six_planes(ray_of(o, d, i), *box)


@entry_kernel
def _slabs_parallel_test(box: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = slabs_parallel_test(ray_of(o, d, i), *box)


@entry_kernel
def _slabs_ieee(box: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = slabs_ieee(ray_of(o, d, i), *box)


@entry_kernel
def _slabs_unrolled(box: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = slabs_unrolled(ray_of(o, d, i), *box)


_method = family("box", "T8", BoxParameters, prepare)

METHODS = (
    _method("six_planes", "six faces, each a plane and a rectangle", "elementary", _six_planes),
    _method(
        "slabs_parallel_test",
        "three slabs, with a test for parallel rays",
        "Kay & Kajiya 1986, SIGGRAPH; Haines 1989, in Glassner (ed.), ch. 2",
        _slabs_parallel_test,
    ),
    _method(
        "slabs_ieee",
        "three slabs by reciprocals and IEEE infinities",
        "Williams, Barrus, Morley & Shirley 2005, Journal of Graphics Tools 10(1)",
        _slabs_ieee,
    ),
    _method(
        "slabs_unrolled",
        "the same, its loop over the axes written out",
        "Williams, Barrus, Morley & Shirley 2005, Journal of Graphics Tools 10(1)",
        _slabs_unrolled,
    ),
)
