"""The closest hits of neighbouring rays that go through a hierarchy together."""

import math

from reference_rt.accel.bvh import NOTHING, Bvh, child_of
from reference_rt.accel.geometry import STACK, Geometry
from reference_rt.accel.leaf import nearest_of_leaf
from reference_rt.accel.packet.nodes import (
    OWN_FLOATS,
    enter_child,
    enter_together,
    prepare_each,
    shear_in,
)
from reference_rt.accel.packet.packet import BUNDLE, SPAN_FLOATS, Bundle, are_alike, bundle_of
from reference_rt.accel.single_ray import can_be_nearer
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray, no_hit
from reference_rt.core.ray_block import Hits, Rays, put_hit, put_ray
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import LANES
from reference_rt.jit.simd_kernels import lowest
from reference_rt.shapes.instances import Instances
from reference_rt.shapes.meshes.watertight import SEEN_FLOATS

ALONE, MISSED, FOUND = -1, 0, 1


@kernel
def closest_together(
    geometry: Geometry, o: FloatArray, d: FloatArray, begin: int, rays: Rays, hits: Hits
) -> int:
    """`closest_hit` of the BUNDLE rays from origins o (n, 3) into directions d (n, 3) from number
    `begin` on.

    ALONE: they are not coherent, or have no hierarchy to go through;  MISSED: none met anything;
    FOUND: `hits` are those of `rays`, of which they are the first.
    """
    if not are_alike(row(d, begin), row(d, begin + BUNDLE - 1)):
        return ALONE
    return _closest_together(geometry.bvh, geometry.instances, geometry, o, d, begin, rays, hits)


@kernel
def _closest_together(
    bvh: Bvh | None,
    instances: Instances | None,
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    begin: int,
    rays: Rays,
    hits: Hits,
) -> int:
    if bvh is None:
        return ALONE
    if instances is not None:  # where rays have directions and origins of their own in each
        return ALONE
    return _traverse(bvh, geometry, o, d, begin, rays, hits)


@kernel
def _traverse(
    bvh: Bvh, geometry: Geometry, o: FloatArray, d: FloatArray, begin: int, rays: Rays, hits: Hits
) -> int:
    span, own = local_floats(SPAN_FLOATS), local_floats(OWN_FLOATS)
    bundle = bundle_of(bvh, o, d, begin, span)
    if not bundle.together:
        return ALONE
    stack, waiting = local_integers(STACK), local_floats(STACK)
    distances, seen = local_floats(LANES), local_floats(SEEN_FLOATS)
    outcome, t_max = MISSED, math.inf
    # Children are called by their places, node * LANES + lane, by which their boxes are found.
    node, place, top = 0, -1, 0
    unbounded = bvh.unbounded
    while True:
        while node >= 0:
            met = enter_together(bvh, node, bundle, t_max, distances)
            if met == 0:
                node = NOTHING
            else:
                place, top = _nearest_place(node, met, distances, stack, waiting, top)
                node = child_of(bvh, place // LANES, place % LANES)
        if node != NOTHING:
            if outcome == MISSED:
                outcome = FOUND
                for j in range(BUNDLE):
                    ray = Ray(row(o, begin + j), row(d, begin + j), math.inf)
                    put_ray(rays, j, ray)
                    put_hit(hits, j, no_hit(ray))
                prepare_each(bvh, bundle, rays, own)
            if _nearest_of_leaf(bvh, geometry, node, place, bundle, rays, own, seen, hits):
                t_max = 0.0
                for j in range(BUNDLE):
                    t_max = max(t_max, hits.numbers[j])
        node = NOTHING
        while top > 0 and node == NOTHING:
            top -= 1
            if can_be_nearer(waiting[top], t_max):
                place = stack[top]
                node = child_of(bvh, place // LANES, place % LANES)
        if node == NOTHING:
            if unbounded < 0:
                return outcome
            node, unbounded = unbounded, -1


@kernel
def _nearest_of_leaf(
    bvh: Bvh,
    geometry: Geometry,
    leaf: int,
    place: int,
    bundle: Bundle,
    rays: Rays,
    own: FloatArray,
    seen: FloatArray,
    hits: Hits,
) -> bool:
    """Let each ray of a bundle that enters a leaf, the child at a place, find what is nearer there
    than its hit so far; whether any did enter."""
    any_entered = False
    for begin in range(0, BUNDLE, LANES):
        entered = enter_child(bvh, place, bundle, begin, own, hits.numbers)
        while entered != 0:
            j = begin + lowest(entered)
            entered &= entered - 1
            any_entered = True
            shear = shear_in(bundle, rays, j, own)
            nearest_of_leaf(bvh, geometry.shapes, geometry.solids, leaf, rays, j, shear, seen, hits)
    return any_entered


@kernel
def _nearest_place(
    node: int, met: int, distances: FloatArray, stack: IntArray, waiting: FloatArray, top: int
) -> tuple[int, int]:
    """As `traversal.nearest_child`, with children's places."""
    lane = lowest(met)
    nearest, t_nearest = node * LANES + lane, distances[lane]
    met &= met - 1
    bottom = top
    while met != 0:
        lane = lowest(met)
        met &= met - 1
        place, t = node * LANES + lane, distances[lane]
        if t < t_nearest:
            place, nearest = nearest, place
            t, t_nearest = t_nearest, t
        k = top
        while k > bottom and waiting[k - 1] < t:
            stack[k], waiting[k] = stack[k - 1], waiting[k - 1]
            k -= 1
        stack[k], waiting[k] = place, t
        top += 1
    return nearest, top
