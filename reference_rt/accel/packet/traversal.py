"""Packet traversal: the closest hits of PACKET_SIZE coherent rays."""

import math
from typing import Annotated

from reference_rt.accel.bvh import NOTHING, Bvh, child_of
from reference_rt.accel.geometry import STACK, Geometry, geometries
from reference_rt.accel.leaf import nearest_of_leaf
from reference_rt.accel.packet.nodes import (
    PER_RAY_FLOATS,
    enter_child,
    enter_packet,
    prepare_rays,
    shear_in,
)
from reference_rt.accel.packet.packet import (
    PACKET_SIZE,
    SPAN_FLOATS,
    RayPacket,
    may_be_coherent,
    packet_of,
)
from reference_rt.accel.single_ray import can_be_nearer, push_sorted
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray, no_hit
from reference_rt.core.ray_block import HitBlock, RayBlock, put_hit, put_ray
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.jit.simd_kernels import lowest
from reference_rt.shapes.instances import Instances
from reference_rt.shapes.meshes.watertight import PROJECTION_FLOATS

INCOHERENT, MISSED, FOUND = -1, 0, 1

Vectors = Annotated[FloatArray, 2]


@geometries.operation
def closest_of_packet(
    geometry: Geometry, o: Vectors, d: Vectors, begin: int, rays: RayBlock, hits: HitBlock
) -> int:
    """`closest_hit` of the PACKET_SIZE rays begin, begin + 1, ... with origins o (n, 3) and
    directions d (n, 3).

    Returns INCOHERENT: nothing is done (they are not coherent, or the scene has no BVH or has
    instances);  MISSED: no ray hits anything;  FOUND: the rays and their hits, some of them misses,
    are the first ones of `rays` and `hits`.
    """
    if not may_be_coherent(row(d, begin), row(d, begin + PACKET_SIZE - 1)):
        return INCOHERENT
    return _closest_of_packet(geometry.bvh, geometry.instances, geometry, o, d, begin, rays, hits)


@kernel
def _closest_of_packet(
    bvh: Bvh | None,
    instances: Instances | None,
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    begin: int,
    rays: RayBlock,
    hits: HitBlock,
) -> int:
    if bvh is None:
        return INCOHERENT
    if instances is not None:  # each of which changes the rays' origins and directions
        return INCOHERENT
    return _traverse(bvh, geometry, o, d, begin, rays, hits)


@kernel
def _traverse(
    bvh: Bvh,
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    begin: int,
    rays: RayBlock,
    hits: HitBlock,
) -> int:
    span, per_ray = local_floats(SPAN_FLOATS), local_floats(PER_RAY_FLOATS)
    packet = packet_of(bvh, o, d, begin, span)
    if not packet.is_coherent:
        return INCOHERENT
    stack, waiting = local_integers(STACK), local_floats(STACK)
    distances, seen = local_floats(VECTOR_WIDTH), local_floats(PROJECTION_FLOATS)
    outcome, t_max = MISSED, math.inf
    # A child is identified by its slot, node * VECTOR_WIDTH + lane, which locates its box.
    node, slot, top = 0, -1, 0
    unbounded = bvh.unbounded
    while True:
        while node >= 0:
            met = enter_packet(bvh, node, packet, t_max, distances)
            if met == 0:
                node = NOTHING
            else:
                slot, top = _nearest_slot(node, met, distances, stack, waiting, top)
                node = child_of(bvh, slot // VECTOR_WIDTH, slot % VECTOR_WIDTH)
        if node != NOTHING:
            if outcome == MISSED:
                outcome = FOUND
                for j in range(PACKET_SIZE):
                    ray = Ray(row(o, begin + j), row(d, begin + j), math.inf)
                    put_ray(rays, j, ray)
                    put_hit(hits, j, no_hit(ray))
                prepare_rays(bvh, packet, rays, per_ray)
            if _nearest_of_leaf(bvh, geometry, node, slot, packet, rays, per_ray, seen, hits):
                t_max = 0.0
                for j in range(PACKET_SIZE):
                    t_max = max(t_max, hits.numbers[j])
        node = NOTHING
        while top > 0 and node == NOTHING:
            top -= 1
            if can_be_nearer(waiting[top], t_max):
                slot = stack[top]
                node = child_of(bvh, slot // VECTOR_WIDTH, slot % VECTOR_WIDTH)
        if node == NOTHING:
            if unbounded < 0:
                return outcome
            node, unbounded = unbounded, -1


@kernel
def _nearest_of_leaf(
    bvh: Bvh,
    geometry: Geometry,
    leaf: int,
    slot: int,
    packet: RayPacket,
    rays: RayBlock,
    per_ray: FloatArray,
    seen: FloatArray,
    hits: HitBlock,
) -> bool:
    """Updates the hits of the rays that enter a leaf, the child in `slot`; whether any enters."""
    any_entered = False
    for begin in range(0, PACKET_SIZE, VECTOR_WIDTH):
        entered = enter_child(bvh, slot, packet, begin, per_ray, hits.numbers)
        while entered != 0:
            j = begin + lowest(entered)
            entered &= entered - 1
            any_entered = True
            shear = shear_in(packet, rays, j, per_ray)
            nearest_of_leaf(bvh, geometry.shapes, geometry.solids, leaf, rays, j, shear, seen, hits)
    return any_entered


@kernel
def _nearest_slot(
    node: int, met: int, distances: FloatArray, stack: IntArray, waiting: FloatArray, top: int
) -> tuple[int, int]:
    """As `single_ray.nearest_child`, with slots in place of codes."""
    lane = lowest(met)
    nearest, t_nearest = node * VECTOR_WIDTH + lane, distances[lane]
    met &= met - 1
    bottom = top
    while met != 0:
        lane = lowest(met)
        met &= met - 1
        slot, t = node * VECTOR_WIDTH + lane, distances[lane]
        if t < t_nearest:
            slot, nearest = nearest, slot
            t, t_nearest = t_nearest, t
        top = push_sorted(stack, waiting, bottom, top, slot, t)
    return nearest, top
