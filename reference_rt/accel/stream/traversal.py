"""Stream traversal: closest hits and any hits of a block of rays, each advanced one step at a
time."""

import math
from typing import Any

from reference_rt.accel.bvh import FAR_SLACK, Bvh, child_of, first_of
from reference_rt.accel.leaf import nearest_of_leaf
from reference_rt.accel.single_ray import slab_test
from reference_rt.accel.stream.state import (
    LEVELS,
    SLAB_FLOATS,
    Lengths,
    Naturals,
    StreamState,
    enqueue,
    load_index,
    prepare,
    shear_in,
    slab_ray_in,
    start_at_root,
)
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import BLOCK, no_hit
from reference_rt.core.ray_block import HitBlock, RayBlock, put_hit, ray_of
from reference_rt.jit.kernel import entry_kernel, kernel, local_floats, local_uint32
from reference_rt.jit.simd import VECTOR_WIDTH, least, select
from reference_rt.jit.simd_kernels import lowest, prefetch, simd_kernel
from reference_rt.shapes import Shapes
from reference_rt.shapes.csg.tables import Solids
from reference_rt.shapes.meshes.watertight import PROJECTION_FLOATS

_ALL = (1 << VECTOR_WIDTH) - 1
_LAST = 1 << (VECTOR_WIDTH - 1)


@entry_kernel
def trace_block(
    bvh: Bvh,
    shapes: Shapes,
    solids: Solids | None,
    rays: RayBlock,
    hits: HitBlock,
    n: int,
    any_hit: bool,
) -> None:
    """`any_of_block` or `closest_of_block`, compiled separately: see `Geometry.tracer`."""
    if any_hit:
        any_of_block(bvh, shapes, solids, rays, hits, n)
    else:
        closest_of_block(bvh, shapes, solids, rays, hits, n)


@kernel
def closest_of_block(
    bvh: Bvh, shapes: Shapes, solids: Solids | None, rays: RayBlock, hits: HitBlock, n: int
) -> None:
    """The closest hits of the first n rays, in a BVH without instances."""
    state = StreamState(
        local_floats(SLAB_FLOATS),
        local_uint32(6 * BLOCK),
        local_uint32(BLOCK),
        local_uint32(BLOCK),
        local_uint32(BLOCK),
        local_uint32(LEVELS * BLOCK),
        local_uint32(3 * BLOCK),
    )
    seen = local_floats(PROJECTION_FLOATS)
    # For each child of each stack entry the t at which the ray enters it; inf: not to be visited.
    waiting = local_floats(LEVELS * BLOCK * VECTOR_WIDTH)
    prepare(bvh, state, rays, n)
    for j in range(n):
        put_hit(hits, j, no_hit(ray_of(rays, j)))
    root = 0
    while root >= 0:
        lengths = start_at_root(state, hits, root, n, False)
        while lengths.nodes + lengths.leaves + lengths.pops > 0:
            lengths = _enter_nodes(bvh, state, waiting, hits, lengths)
            lengths = _visit_leaves(bvh, shapes, solids, state, rays, seen, hits, lengths, False)
            lengths = _pop_rays(bvh, state, waiting, hits, lengths)
        root = bvh.unbounded if root == 0 else -1


@kernel
def any_of_block(
    bvh: Bvh, shapes: Shapes, solids: Solids | None, rays: RayBlock, hits: HitBlock, n: int
) -> None:
    """Any-hit query for the first n rays, as `closest_of_block`, but children still to be visited
    are bits, without distances.

    The arrays cannot come from a function shared by both: `local_floats` is memory of the kernel
    that calls it.
    """
    state = StreamState(
        local_floats(SLAB_FLOATS),
        local_uint32(6 * BLOCK),
        local_uint32(BLOCK),
        local_uint32(BLOCK),
        local_uint32(BLOCK),
        local_uint32(LEVELS * BLOCK),
        local_uint32(3 * BLOCK),
    )
    seen, waiting = local_floats(PROJECTION_FLOATS), local_uint32(LEVELS * BLOCK)
    prepare(bvh, state, rays, n)
    for j in range(n):  # of a miss nothing else is read
        hits.numbers[j], hits.codes[j] = rays.numbers[6 * BLOCK + j], -1
    root = 0
    while root >= 0:
        lengths = start_at_root(state, hits, root, n, True)
        while lengths.nodes + lengths.leaves + lengths.pops > 0:
            lengths = _enter_nodes_any(bvh, state, waiting, hits, lengths)
            lengths = _visit_leaves(bvh, shapes, solids, state, rays, seen, hits, lengths, True)
            lengths = _pop_rays_any(bvh, state, waiting, lengths)
        root = bvh.unbounded if root == 0 else -1


@simd_kernel
def _enter(
    boxes: Any, node: Any, slab_rays: Any, axes: Any, j: Any, ends: Any, waiting: Any, place: Any
) -> Any:
    """(mask of the children whose boxes ray j enters before its end, mask of the nearest); into
    waiting[place : place + VECTOR_WIDTH] the t at which it does, inf for the others."""
    t_in, met = slab_test(boxes, node, slab_ray_in(slab_rays, axes, j), ends.everywhere(j))
    # A box entered at infinity holds no hit; inf marks children that are not to be visited.
    met = met & (t_in < math.inf)
    t_in = select(met, t_in, math.inf)
    waiting.store(place, t_in)
    return met, met & (t_in <= least(t_in))


@kernel
def _enter_nodes(
    bvh: Bvh, state: StreamState, waiting: FloatArray, hits: HitBlock, lengths: Lengths
) -> Lengths:
    """One step of each ray at an inner node: to the nearest child that it enters, or to the pop
    queue."""
    count, lengths = lengths.nodes, Lengths(0, lengths.leaves, lengths.pops)
    for i in range(count):
        j = load_index(state.queues, i)
        node, level = load_index(state.node, j), load_index(state.level, j)
        place = j * LEVELS + level
        state.nodes[place] = node
        found = _enter(
            bvh.boxes,
            node,
            state.slab_rays,
            state.axes,
            j,
            hits.numbers,
            waiting,
            place * VECTOR_WIDTH,
        )
        lengths = _go_to_nearest(bvh, state, waiting, j, level, found, lengths)
    return lengths


@simd_kernel
def _still_nearer(waiting: Any, place: Any, limit: Any) -> Any:
    """(mask of the children at t <= limit that are still to be visited, mask of the nearest)."""
    t = waiting.load(place)
    near = (t <= limit) & (t < math.inf)
    return near, near & (t <= least(t))


@kernel
def _pop_rays(
    bvh: Bvh, state: StreamState, waiting: FloatArray, hits: HitBlock, lengths: Lengths
) -> Lengths:
    """One step of each ray in the pop queue: to the nearest child of its stack's top entry, or,
    where all of them are beyond the hit so far, down to the next entry."""
    count, lengths = lengths.pops, Lengths(lengths.nodes, lengths.leaves, 0)
    for i in range(count):
        j = load_index(state.queues, 2 * BLOCK + i)
        level = load_index(state.level, j) - 1
        limit = hits.numbers[j] * FAR_SLACK  # as in `single_ray.can_be_nearer`
        found = _still_nearer(waiting, (j * LEVELS + level) * VECTOR_WIDTH, limit)
        lengths = _go_to_nearest(bvh, state, waiting, j, level, found, lengths)
    return lengths


@kernel
def _go_to_nearest(
    bvh: Bvh,
    state: StreamState,
    waiting: FloatArray,
    j: int,
    level: int,
    found: int,
    lengths: Lengths,
) -> Lengths:
    """Moves ray j from the node at `level` of its stack to the nearest child, if any, that `_enter`
    or `_still_nearer` has found; the others stay on the stack."""
    met, nearest = found & _ALL, found >> VECTOR_WIDTH
    place = j * LEVELS + level
    lane = lowest(nearest | _LAST)
    waiting[place * VECTOR_WIDTH + lane] = math.inf
    level += met & (met - 1) != 0
    state.level[j] = level
    code = child_of(bvh, load_index(state.nodes, place), lane)
    return enqueue(bvh, state, j, code, met, level, lengths)


@simd_kernel
def _enter_any(boxes: Any, node: Any, slab_rays: Any, axes: Any, j: Any, ends: Any) -> Any:
    """The mask of the children whose boxes ray j enters before its end."""
    _, met = slab_test(boxes, node, slab_ray_in(slab_rays, axes, j), ends.everywhere(j))
    return met


@kernel
def _enter_nodes_any(
    bvh: Bvh, state: StreamState, waiting: Naturals, hits: HitBlock, lengths: Lengths
) -> Lengths:
    """One step of each ray at an inner node: to any child that it enters, or to the pop queue."""
    count, lengths = lengths.nodes, Lengths(0, lengths.leaves, lengths.pops)
    for i in range(count):
        j = load_index(state.queues, i)
        node, level = load_index(state.node, j), load_index(state.level, j)
        state.nodes[j * LEVELS + level] = node
        met = _enter_any(bvh.boxes, node, state.slab_rays, state.axes, j, hits.numbers)
        lengths = _go_to_any(bvh, state, waiting, j, level, met, lengths)
    return lengths


@kernel
def _pop_rays_any(bvh: Bvh, state: StreamState, waiting: Naturals, lengths: Lengths) -> Lengths:
    """One step of each ray in the pop queue: to any child left in its stack's top entry."""
    count, lengths = lengths.pops, Lengths(lengths.nodes, lengths.leaves, 0)
    for i in range(count):
        j = load_index(state.queues, 2 * BLOCK + i)
        level = load_index(state.level, j) - 1
        met = load_index(waiting, j * LEVELS + level)
        lengths = _go_to_any(bvh, state, waiting, j, level, met, lengths)
    return lengths


@kernel
def _go_to_any(
    bvh: Bvh, state: StreamState, waiting: Naturals, j: int, level: int, met: int, lengths: Lengths
) -> Lengths:
    """Moves ray j from the node at `level` of its stack to one of the children `met`, if any; the
    others stay on the stack."""
    place = j * LEVELS + level
    others = met & (met - 1)
    waiting[place] = others
    level += others != 0
    state.level[j] = level
    code = child_of(bvh, load_index(state.nodes, place), lowest(met | _LAST))
    return enqueue(bvh, state, j, code, met, level, lengths)


@kernel
def _visit_leaves(
    bvh: Bvh,
    shapes: Shapes,
    solids: Solids | None,
    state: StreamState,
    rays: RayBlock,
    seen: FloatArray,
    hits: HitBlock,
    lengths: Lengths,
    any_hit: bool,
) -> Lengths:
    """One step of each ray at a leaf: updates its hit, and moves it to the pop queue; with any_hit
    and a hit, the ray is done."""
    _fetch_triangles(bvh, bvh.corners, state, lengths.leaves)
    pops = lengths.pops
    for i in range(lengths.leaves):
        j = load_index(state.queues, BLOCK + i)
        leaf, shear = -1 - load_index(state.leaf, j), shear_in(state, rays, j)
        closest = nearest_of_leaf(bvh, shapes, solids, leaf, rays, j, shear, seen, hits)
        state.queues[2 * BLOCK + (pops & (BLOCK - 1))] = j
        pops += (state.level[j] > 0) & (not (any_hit and closest.kind >= 0))
    return Lengths(lengths.nodes, 0, pops)


@kernel
def _fetch_triangles(bvh: Bvh, corners: FloatArray | None, state: StreamState, leaves: int) -> None:
    """Prefetches the triangles of all queued leaves: saves 13 to 19 % of the time (measured)."""
    if corners is None:
        return
    for i in range(leaves):
        leaf = -1 - load_index(state.leaf, load_index(state.queues, BLOCK + i))
        first = first_of(leaf)
        prefetch(bvh.references, 2 * first)
        prefetch(bvh.references, 2 * first + 2 * VECTOR_WIDTH - 1)
        for line in range(VECTOR_WIDTH):
            prefetch(corners, 9 * first + VECTOR_WIDTH * line)
