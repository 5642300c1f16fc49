"""Stream traversal: a block of up to BLOCK rays traverses the BVH, each ray one step per round.

A single ray spends its time waiting: for the boxes that decide which node is next, for that node's
memory, for mispredicted branches.  Here every ray of the block makes one step before any makes the
next.  Steps overlap, memory is prefetched, and each ray is pushed to one of three queues (inner
node, leaf, pop), which replaces the unpredictable branch.  Each hit is the one of
`geometry.closest_hit`, to the last bit.

`block_query.py` calls it, for scenes with a BVH and without instances.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.accel.bvh import (
    CENTER,
    FAR_SLACK,
    NODE_SINGLES,
    STACK_SIZE,
    Bvh,
    child_of,
    first_of,
)
from reference_rt.accel.leaf import nearest_of_leaf
from reference_rt.accel.single_ray import slab_test
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import (
    BLOCK,
    SURFACE_ROUNDING,
    HitBlock,
    RayBlock,
    no_hit,
    put_hit,
    ray_of,
)
from reference_rt.jit.kernel import kernel, local_floats, local_uint32
from reference_rt.jit.simd import (
    VECTOR_WIDTH,
    larger,
    least,
    lowest,
    prefetch,
    select,
    simd_kernel,
    with_sign,
)
from reference_rt.shapes import Shapes
from reference_rt.shapes.csg import Solids
from reference_rt.shapes.meshes.watertight import PROJECTION_FLOATS, Shear

# ---- the state of a stream -----------------------------------------------------------------------

Naturals = npt.NDArray[np.uint32]

SLAB_FLOATS = 9 * BLOCK
LEVELS = STACK_SIZE
"""Entries of each ray's stack: nodes some of whose children are still to be visited."""


@kernel
def load_index(numbers: Naturals, i: int) -> int:
    """Element i, converted to the integers that kernels compute with."""
    number: int = np.int64(numbers[i])  # type: ignore[assignment]
    return number


class StreamState(NamedTuple):
    """A stream of up to BLOCK rays, as SoA.

    slab_rays (SLAB_FLOATS,): near, far and inverse of `single_ray.SlabRay`;  axes (6 BLOCK,): its
    rows x, y, z, and the axes x, y, z of `watertight.Shear`;  node, leaf (BLOCK,): the inner node
    or the leaf that a ray is at, a leaf as -1 - code;  nodes (LEVELS BLOCK,): each ray's stack of
    nodes with children still to be visited;  level (BLOCK,): how many these are;  queues
    (3 BLOCK,): the rays at an inner node, at a leaf, and about to pop their stack.

    Integers are unsigned: for signed indices Numba tests whether they are negative, 6 % of the time
    (measured, with children's codes in one row).
    """

    slab_rays: FloatArray
    axes: Naturals
    node: Naturals
    leaf: Naturals
    level: Naturals
    nodes: Naturals
    queues: Naturals


class Lengths(NamedTuple):
    """The lengths of the three queues."""

    nodes: int
    leaves: int
    pops: int


@kernel
def prepare(bvh: Bvh, state: StreamState, rays: RayBlock, n: int) -> None:
    """Computes what stays the same during the traversal of the first n rays: slab_rays and axes."""
    frame = bvh.frames
    for j in range(0, n, VECTOR_WIDTH):
        _prepare_slab_rays(
            rays.numbers,
            j,
            frame[0, CENTER],
            frame[0, CENTER + 1],
            frame[0, CENTER + 2],
            3.0 * frame[0, CENTER + 3],
            state.slab_rays,
        )
    for j in range(n):
        for axis in range(3):
            is_forward = state.slab_rays[(6 + axis) * BLOCK + j] > 0.0
            state.axes[axis * BLOCK + j] = axis + 3 - 3 * is_forward
        # As `watertight.shear_of`, without branches.
        d = ray_of(rays, j).d
        x_is = (abs(d.x) >= abs(d.y)) & (abs(d.x) >= abs(d.z))
        z = (1 - x_is) * (2 - (abs(d.y) >= abs(d.z)))
        first = z + 1 - 3 * (z == 2)
        second = 3 - z - first
        swap = (second - first) * (rays.numbers[(3 + z) * BLOCK + j] < 0.0)
        state.axes[3 * BLOCK + j] = first + swap
        state.axes[4 * BLOCK + j] = second - swap
        state.axes[5 * BLOCK + j] = z


@simd_kernel
def _prepare_slab_rays(
    rays: Any, j: Any, center_x: Any, center_y: Any, center_z: Any, extent: Any, slab_rays: Any
) -> Any:
    """`single_ray.slab_ray_of` the rays j to j + VECTOR_WIDTH - 1, without the rows;  extent: 3
    times the tree's size."""
    o = [rays.load(j + axis * BLOCK) for axis in range(3)]
    far_out = larger(larger(abs(o[0]), abs(o[1])), abs(o[2]))
    error = (far_out + far_out + extent) * SURFACE_ROUNDING
    for axis, center in enumerate((center_x, center_y, center_z)):
        inverse = 1.0 / rays.load(j + (3 + axis) * BLOCK)
        moved = with_sign(error, inverse)
        slab_rays.store(j + axis * BLOCK, o[axis] - center + moved)
        slab_rays.store(j + (3 + axis) * BLOCK, o[axis] - center - moved)
        slab_rays.store(j + (6 + axis) * BLOCK, inverse)
    return error >= 0.0


@kernel
def start_at_root(state: StreamState, hits: HitBlock, root: int, n: int, any_hit: bool) -> Lengths:
    """Queues all rays at a root; with `any_hit` only those without a hit so far."""
    count = 0
    for j in range(n):
        state.node[j], state.level[j] = root, 0
        state.queues[count & (BLOCK - 1)] = j
        count += not (any_hit and hits.codes[j] >= 0)
    return Lengths(count, 0, 0)


@kernel
def shear_in(state: StreamState, rays: RayBlock, j: int) -> Shear:
    """`watertight.shear_of` ray j."""
    numbers, axes = rays.numbers, state.axes
    x, y = load_index(axes, 3 * BLOCK + j), load_index(axes, 4 * BLOCK + j)
    z = load_index(axes, 5 * BLOCK + j)
    d_z = numbers[(3 + z) * BLOCK + j]
    return Shear(
        x,
        y,
        z,
        numbers[x * BLOCK + j],
        numbers[y * BLOCK + j],
        numbers[z * BLOCK + j],
        numbers[(3 + x) * BLOCK + j] / d_z,
        numbers[(3 + y) * BLOCK + j] / d_z,
        1.0 / d_z,
    )


def slab_ray_in(slab_rays: Any, axes: Any, j: Any) -> Any:
    """Ray j as `single_ray.slab_test` takes it."""
    return [
        (
            axes.load_index(j + axis * BLOCK),
            slab_rays.everywhere(j + axis * BLOCK),
            slab_rays.everywhere(j + (3 + axis) * BLOCK),
            slab_rays.everywhere(j + (6 + axis) * BLOCK),
        )
        for axis in range(3)
    ]


@kernel
def enqueue(
    bvh: Bvh, state: StreamState, j: int, code: int, met: int, level: int, lengths: Lengths
) -> Lengths:
    """Moves ray j to the child `code`, an inner node or a leaf; where no child was entered (met is
    0), to the pop queue if its stack is not empty; else the ray is done."""
    node, nodes, leaves, pops = max(code, 0), lengths.nodes, lengths.leaves, lengths.pops
    state.node[j], state.leaf[j] = node, max(-1 - code, 0)
    for line in range(4):
        prefetch(bvh.boxes, node * NODE_SINGLES + 16 * line)
    # Written to all three queues, of which at most one grows: no branch.  The masks show Numba that
    # no index is negative.
    state.queues[nodes & (BLOCK - 1)] = j
    state.queues[BLOCK + (leaves & (BLOCK - 1))] = j
    state.queues[2 * BLOCK + (pops & (BLOCK - 1))] = j
    is_met = met != 0
    return Lengths(
        nodes + (is_met & (code >= 0)),
        leaves + (is_met & (code < 0)),
        pops + ((met == 0) & (level > 0)),
    )


# ---- closest hits and any hits -------------------------------------------------------------------

_ALL = (1 << VECTOR_WIDTH) - 1
_LAST = 1 << (VECTOR_WIDTH - 1)


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
