"""Packet traversal (Wald et al. 2001): PACKET_SIZE coherent rays traverse the BVH together.

Only `array_query.py` uses it, for large arrays of rays in scenes with a BVH and without instances.
A box is tested once for all rays, with intervals in place of origins and inverse directions
(`packet.py`).  Intervals can only enlarge the set of boxes that a ray would enter, and leaves test
ray by ray: each closest hit is the one of `geometry.closest_hit`, to the last bit.
"""

import math
from typing import Annotated, Any

from reference_rt.accel.bvh import CENTER, FAR_SLACK, NODE_SINGLES, NOTHING, Bvh, child_of
from reference_rt.accel.geometry import STACK, Geometry, geometries
from reference_rt.accel.leaf import nearest_of_leaf
from reference_rt.accel.packet import (
    PACKET_SIZE,
    SPAN_FLOATS,
    RayPacket,
    packet_of,
    ray_number,
)
from reference_rt.accel.single_ray import can_be_nearer, push_sorted
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import BLOCK, HitBlock, Ray, RayBlock, no_hit, put_hit, put_ray
from reference_rt.core.vec3 import component, row
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH, larger, lowest, simd_kernel, smaller
from reference_rt.shapes.instances import Instances
from reference_rt.shapes.meshes.watertight import PROJECTION_FLOATS, Shear

# ---- slab tests: all rays at once at inner nodes, ray by ray at leaves ---------------------------

PER_RAY_FLOATS = 12 * PACKET_SIZE


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
    least_x: Any,
    least_y: Any,
    least_z: Any,
    most_x: Any,
    most_y: Any,
    most_z: Any,
    t_max: Any,
    distances: Any,
) -> Any:
    """The mask of the children whose boxes any ray may enter before t_max; into distances lower
    bounds of t.

    `single_ray.slab_test` in interval arithmetic: the smaller or the larger of the products with
    `least` and `most`.  0 * inf = NaN comes from `most` alone or from both; the order of arguments
    keeps it where it has to stay, so that it limits nothing.
    """
    first = node * NODE_SINGLES

    def enter(row: Any, near: Any, least: Any, most: Any) -> Any:
        side = boxes.load(first + row * VECTOR_WIDTH) - near
        return smaller(side * least, side * most)

    def leave(row: Any, far: Any, least: Any, most: Any) -> Any:
        side = boxes.load(first + row * VECTOR_WIDTH) - far
        return larger(side * most, side * least)

    t_in = larger(0.0, enter(x, near_x, least_x, most_x))
    t_in = larger(t_in, enter(y, near_y, least_y, most_y))
    t_in = larger(t_in, enter(z, near_z, least_z, most_z))
    t_out = smaller(t_max, leave(3 - x, far_x, least_x, most_x))
    t_out = smaller(t_out, leave(5 - y, far_y, least_y, most_y))
    t_out = smaller(t_out, leave(7 - z, far_z, least_z, most_z))
    distances.store(0, t_in)
    return t_in <= t_out * FAR_SLACK


@kernel
def enter_packet(
    bvh: Bvh, node: int, packet: RayPacket, t_max: float, distances: FloatArray
) -> int:
    """The children of a node whose boxes rays of a packet may enter, as bits; into distances
    (VECTOR_WIDTH,) lower bounds of t."""
    return _entered(
        bvh.boxes,
        node,
        packet.x,
        packet.y,
        packet.z,
        packet.near.x,
        packet.near.y,
        packet.near.z,
        packet.far.x,
        packet.far.y,
        packet.far.z,
        packet.least.x,
        packet.least.y,
        packet.least.z,
        packet.most.x,
        packet.most.y,
        packet.most.z,
        t_max,
        distances,
    )


@simd_kernel
def _prepare_rays(
    rays: Any,
    x: Any,
    y: Any,
    z: Any,
    center_x: Any,
    center_y: Any,
    center_z: Any,
    error_x: Any,
    error_y: Any,
    error_z: Any,
    per_ray: Any,
) -> Any:
    """Fills per_ray (PER_RAY_FLOATS,): near, far and inverse of each ray's `single_ray.SlabRay`,
    and the shear of `watertight.shear_of` for axes x, y, z."""
    place = ((center_x, error_x), (center_y, error_y), (center_z, error_z))
    for j in range(0, PACKET_SIZE, VECTOR_WIDTH):
        for k, (center, error) in enumerate(place):
            o, d = rays.load(k * BLOCK + j), rays.load((3 + k) * BLOCK + j)
            per_ray.store(k * PACKET_SIZE + j, o - center + error)
            per_ray.store((3 + k) * PACKET_SIZE + j, o - center - error)
            per_ray.store(
                (6 + k) * PACKET_SIZE + j, 1.0 / (d + 0.0)
            )  # of -0 inf too, as in `_slab`
        d_x, d_y, d_z = (rays.load(axis * BLOCK + (3 * BLOCK + j)) for axis in (x, y, z))
        per_ray.store(9 * PACKET_SIZE + j, d_x / d_z)
        per_ray.store(10 * PACKET_SIZE + j, d_y / d_z)
        per_ray.store(11 * PACKET_SIZE + j, 1.0 / d_z)
    return rays.load(0) <= float("inf")


@kernel
def shear_axes(packet: RayPacket) -> tuple[int, int, int]:
    """The axes x, y, z of `watertight.shear_of`, the same for all rays of a packet."""
    x, y = (packet.axis + 1) % 3, (packet.axis + 2) % 3
    if component(packet.least, packet.axis) < 0.0:
        x, y = y, x
    return x, y, packet.axis


@kernel
def prepare_rays(bvh: Bvh, packet: RayPacket, rays: RayBlock, per_ray: FloatArray) -> None:
    """Called before the first leaf only: most packets of a picture reach none."""
    x, y, z = shear_axes(packet)
    frame = bvh.frames
    _prepare_rays(
        rays.numbers,
        x,
        y,
        z,
        frame[0, CENTER],
        frame[0, CENTER + 1],
        frame[0, CENTER + 2],
        packet.error.x,
        packet.error.y,
        packet.error.z,
        per_ray,
    )


@kernel
def shear_in(packet: RayPacket, rays: RayBlock, j: int, per_ray: FloatArray) -> Shear:
    """`watertight.shear_of` ray j of a packet."""
    x, y, z = shear_axes(packet)
    o = rays.numbers
    return Shear(
        x,
        y,
        z,
        o[x * BLOCK + j],
        o[y * BLOCK + j],
        o[z * BLOCK + j],
        per_ray[9 * PACKET_SIZE + j],
        per_ray[10 * PACKET_SIZE + j],
        per_ray[11 * PACKET_SIZE + j],
    )


@simd_kernel
def _enter_box(
    per_ray: Any,
    j: Any,
    ends: Any,
    near_x: Any,
    near_y: Any,
    near_z: Any,
    far_x: Any,
    far_y: Any,
    far_z: Any,
) -> Any:
    """The mask of the rays j to j + VECTOR_WIDTH - 1 that enter a box before their ends: the slab
    test of `single_ray`, one box for VECTOR_WIDTH rays."""
    inverse = [per_ray.load(j + k * PACKET_SIZE) for k in (6, 7, 8)]
    t_in = larger(0.0, (near_x - per_ray.load(j)) * inverse[0])
    t_in = larger(t_in, (near_y - per_ray.load(j + PACKET_SIZE)) * inverse[1])
    t_in = larger(t_in, (near_z - per_ray.load(j + 2 * PACKET_SIZE)) * inverse[2])
    t_out = smaller(ends.load(j), (far_x - per_ray.load(j + 3 * PACKET_SIZE)) * inverse[0])
    t_out = smaller(t_out, (far_y - per_ray.load(j + 4 * PACKET_SIZE)) * inverse[1])
    t_out = smaller(t_out, (far_z - per_ray.load(j + 5 * PACKET_SIZE)) * inverse[2])
    return t_in <= t_out * FAR_SLACK


@kernel
def enter_child(
    bvh: Bvh, slot: int, packet: RayPacket, j: int, per_ray: FloatArray, ends: FloatArray
) -> int:
    """The rays j to j + VECTOR_WIDTH - 1 of a packet that enter the child in a slot (node *
    VECTOR_WIDTH + lane) before ends[j + lane], as bits."""
    node, lane = slot // VECTOR_WIDTH, slot % VECTOR_WIDTH
    box = bvh.boxes[node]
    return _enter_box(
        per_ray,
        j,
        ends,
        float(box[packet.x * VECTOR_WIDTH + lane]),
        float(box[packet.y * VECTOR_WIDTH + lane]),
        float(box[packet.z * VECTOR_WIDTH + lane]),
        float(box[(3 - packet.x) * VECTOR_WIDTH + lane]),
        float(box[(5 - packet.y) * VECTOR_WIDTH + lane]),
        float(box[(7 - packet.z) * VECTOR_WIDTH + lane]),
    )


# ---- traversal -----------------------------------------------------------------------------------

INCOHERENT, MISSED, FOUND = -1, 0, 1

Vectors = Annotated[FloatArray, 2]


@geometries.operation
def closest_of_packet(
    geometry: Geometry,
    o: Vectors,
    d: Vectors,
    begin: int,
    width: int,
    rays: RayBlock,
    hits: HitBlock,
) -> int:
    """`closest_hit` of PACKET_SIZE of the rays with origins o (n, 3) and directions d (n, 3): those
    of `ray_number`.

    Returns INCOHERENT: nothing is done (they are not coherent, or the scene has no BVH or has
    instances);  MISSED: no ray hits anything;  FOUND: the rays and their hits, some of them misses,
    are the first ones of `rays` and `hits`.
    """
    return _closest_of_packet(
        geometry.bvh, geometry.instances, geometry, o, d, begin, width, rays, hits
    )


@kernel
def _closest_of_packet(
    bvh: Bvh | None,
    instances: Instances | None,
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    begin: int,
    width: int,
    rays: RayBlock,
    hits: HitBlock,
) -> int:
    if bvh is None:
        return INCOHERENT
    if instances is not None:  # each of which changes the rays' origins and directions
        return INCOHERENT
    return _traverse(bvh, geometry, o, d, begin, width, rays, hits)


@kernel
def _traverse(
    bvh: Bvh,
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    begin: int,
    width: int,
    rays: RayBlock,
    hits: HitBlock,
) -> int:
    span, per_ray = local_floats(SPAN_FLOATS), local_floats(PER_RAY_FLOATS)
    packet = packet_of(bvh, o, d, begin, width, span)
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
                    i = ray_number(begin, width, j)
                    ray = Ray(row(o, i), row(d, i), math.inf)
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
