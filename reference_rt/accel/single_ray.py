"""Steps of single-ray traversal: the conservative slab test of a node's boxes (rounding can only
enlarge a box) and the order in which children are visited."""

import math
from typing import Any, NamedTuple

from reference_rt.accel.bvh import CENTER, FAR_SLACK, NODE_SINGLES, Bvh, child_of
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray, surface_error
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel, reciprocal
from reference_rt.jit.simd import VECTOR_WIDTH, larger, lowest, prefetch, simd_kernel, smaller


class SlabRay(NamedTuple):
    """A ray prepared for slab tests.

    near, far: its origin relative to the tree's centre, displaced by the error bound of hits, so
    that near planes come nearer and far planes go further;  inverse: 1 / d;  x, y, z: which of a
    node's six rows of planes is the near one of each axis.
    """

    near: Vec3
    far: Vec3
    inverse: Vec3
    x: int
    y: int
    z: int


@kernel
def slab_ray_of(bvh: Bvh, root: int, ray: Ray) -> SlabRay:
    """Prepares a ray for the tree whose root is node `root`: once per ray and tree."""
    inverse = Vec3(reciprocal(ray.d.x), reciprocal(ray.d.y), reciprocal(ray.d.z))
    frame = bvh.frames
    center = Vec3(frame[root, CENTER], frame[root, CENTER + 1], frame[root, CENTER + 2])
    # Primitives find hits outside of their bounds by as much as their points are uncertain; o - c
    # rounds once, which is less than what `surface_error` allows for.  Most uncertain are
    # triangles: vertices are projected to within 15 u (|o| + size), and barycentrics known to
    # CANCELLED u of a projected triangle, at most 4 size across; `surface_error` allows
    # 27 u (2 |o| + 3 size).
    error = surface_error(ray.o, ray.o, 3.0 * frame[root, CENTER + 3])
    o = ray.o - center
    x, y, z = (
        math.copysign(error, inverse.x),
        math.copysign(error, inverse.y),
        math.copysign(error, inverse.z),
    )
    return SlabRay(
        Vec3(o.x + x, o.y + y, o.z + z),
        Vec3(o.x - x, o.y - y, o.z - z),
        inverse,
        0 if inverse.x > 0.0 else 3,
        1 if inverse.y > 0.0 else 4,
        2 if inverse.z > 0.0 else 5,
    )


def slab_test(boxes: Any, node: Any, slab_ray: Any, t_max: Any) -> Any:
    """The slab test of all children of a node, a generic kernel (see `jit.simd`).  Returns the t at
    which the ray enters each box, and the mask of the boxes that it enters before t_max.

    slab_ray: for x, y and z each the row of the near planes, and near, far and inverse of
    `SlabRay`.  The sign of d chooses the near row, so that the 0 * inf of a ray in a plane of a box
    can only be NaN, which `larger` and `smaller` ignore: such a plane does not limit the ray.
    """
    first = node * NODE_SINGLES
    t_in, t_out = 0.0, t_max
    for axis, (row, near, far, inverse) in enumerate(slab_ray):
        near_plane = boxes.load(first + row * VECTOR_WIDTH)
        far_plane = boxes.load(first + (3 + 2 * axis - row) * VECTOR_WIDTH)
        t_in = larger(t_in, (near_plane - near) * inverse)
        t_out = smaller(t_out, (far_plane - far) * inverse)
    return t_in, t_in <= t_out * FAR_SLACK


@simd_kernel
def _entered(
    boxes: Any,
    node: Any,
    x: Any,
    y: Any,
    z: Any,
    near_x: Any,
    near_y: Any,
    near_z: Any,
    far_x: Any,
    far_y: Any,
    far_z: Any,
    inverse_x: Any,
    inverse_y: Any,
    inverse_z: Any,
    t_max: Any,
    distances: Any,
) -> Any:
    """The mask of the children whose boxes a ray enters before t_max; into distances the t at which
    it does."""
    slab_ray = (
        (x, near_x, far_x, inverse_x),
        (y, near_y, far_y, inverse_y),
        (z, near_z, far_z, inverse_z),
    )
    t_in, met = slab_test(boxes, node, slab_ray, t_max)
    distances.store(0, t_in)
    return met


@kernel
def enter(bvh: Bvh, node: int, slab_ray: SlabRay, t_max: float, distances: FloatArray) -> int:
    """The children of a node whose boxes a ray enters before t_max, as bits; into distances
    (VECTOR_WIDTH,) the t at which it does."""
    return _entered(
        bvh.boxes,
        node,
        slab_ray.x,
        slab_ray.y,
        slab_ray.z,
        slab_ray.near.x,
        slab_ray.near.y,
        slab_ray.near.z,
        slab_ray.far.x,
        slab_ray.far.y,
        slab_ray.far.z,
        slab_ray.inverse.x,
        slab_ray.inverse.y,
        slab_ray.inverse.z,
        t_max,
        distances,
    )


@kernel
def nearest_child(
    bvh: Bvh,
    node: int,
    met: int,
    distances: FloatArray,
    stack: IntArray,
    waiting: FloatArray,
    top: int,
) -> tuple[int, int]:
    """(child, top): the nearest of the children entered, at least one; the others are pushed with
    their distances, sorted, the nearer the higher."""
    lane = lowest(met)
    nearest, t_nearest = child_of(bvh, node, lane), distances[lane]
    met &= met - 1
    bottom = top
    while met != 0:
        lane = lowest(met)
        met &= met - 1
        code, t = child_of(bvh, node, lane), distances[lane]
        if t < t_nearest:
            code, nearest = nearest, code
            t, t_nearest = t_nearest, t
        top = push_sorted(stack, waiting, bottom, top, code, t)
        _prefetch(bvh, code)
    return nearest, top


@kernel
def push_sorted(
    stack: IntArray, waiting: FloatArray, bottom: int, top: int, code: int, t: float
) -> int:
    """Inserts a child into the entries from `bottom` up to `top`, of which the nearest is on top;
    the new top."""
    k = top
    while k > bottom and waiting[k - 1] < t:
        stack[k], waiting[k] = stack[k - 1], waiting[k - 1]
        k -= 1
    stack[k], waiting[k] = code, t
    return top + 1


@kernel
def any_child(bvh: Bvh, node: int, met: int, stack: IntArray, top: int) -> tuple[int, int]:
    """(child, top): one of the children entered, at least one; the others are pushed."""
    lane = lowest(met)
    chosen = child_of(bvh, node, lane)
    met &= met - 1
    while met != 0:
        code = child_of(bvh, node, lowest(met))
        met &= met - 1
        stack[top] = code
        top += 1
        _prefetch(bvh, code)
    return chosen, top


@kernel
def _prefetch(bvh: Bvh, code: int) -> None:
    """Prefetches a node on the stack: random rays at the bunny are 6 % faster (measured)."""
    if code >= 0:
        for line in range(3):
            prefetch(bvh.boxes, code * NODE_SINGLES + 16 * line)


@kernel
def can_be_nearer(t_in: float, t_max: float) -> bool:
    """Whether a box that the ray enters at t_in can hold a hit at t <= t_max."""
    return t_in <= t_max * FAR_SLACK
