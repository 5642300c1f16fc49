"""Rays of a block find their hits in a hierarchy, all a step at a time.

A ray by itself waits: for the boxes that tell which node is next, for the memory of that node, for
branches that were guessed wrong.  Here every ray of a block makes a step before any makes the next
one.  Their steps overlap; memory is fetched before it is needed; and whether a ray goes on to a
node, to a leaf or back is a queue that it is put into, not a branch.  Each finds what
`geometry.closest_hit` finds, to the last bit.
"""

import math
from typing import Any

from reference_rt.accel.bvh import FAR_SLACK, Bvh, child_of, first_of
from reference_rt.accel.leaf import nearest_of_leaf
from reference_rt.accel.single_ray import between
from reference_rt.accel.stream.state import (
    LEVELS,
    VIEW_FLOATS,
    Lengths,
    Naturals,
    Wave,
    begin_at,
    natural,
    prepare,
    queued,
    shear_in,
    view_in,
)
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import BLOCK, no_hit
from reference_rt.core.ray_block import Hits, Rays, put_hit, ray_of
from reference_rt.jit.kernel import entry_kernel, kernel, local_floats, local_naturals
from reference_rt.jit.simd import LANES, least, select
from reference_rt.jit.simd_kernels import lane_kernel, lowest, prefetch
from reference_rt.shapes import Shapes
from reference_rt.shapes.csg.tables import Solids
from reference_rt.shapes.meshes.watertight import SEEN_FLOATS

_ALL = (1 << LANES) - 1
_LAST = 1 << (LANES - 1)


@entry_kernel
def trace_block(
    bvh: Bvh,
    shapes: Shapes,
    solids: Solids | None,
    rays: Rays,
    hits: Hits,
    n: int,
    any_hit: bool,
) -> None:
    """`any_of_block` or `closest_of_block`, for callers that are compiled without them."""
    if any_hit:
        any_of_block(bvh, shapes, solids, rays, hits, n)
    else:
        closest_of_block(bvh, shapes, solids, rays, hits, n)


@kernel
def closest_of_block(
    bvh: Bvh, shapes: Shapes, solids: Solids | None, rays: Rays, hits: Hits, n: int
) -> None:
    """The closest hits of the first n rays, in a hierarchy without instances."""
    wave = Wave(
        local_floats(VIEW_FLOATS),
        local_naturals(6 * BLOCK),
        local_naturals(BLOCK),
        local_naturals(BLOCK),
        local_naturals(BLOCK),
        local_naturals(LEVELS * BLOCK),
        local_naturals(3 * BLOCK),
    )
    seen = local_floats(SEEN_FLOATS)
    # Of each child how far away it is, inf where it does not wait.
    waiting = local_floats(LEVELS * BLOCK * LANES)
    prepare(bvh, wave, rays, n)
    for j in range(n):
        put_hit(hits, j, no_hit(ray_of(rays, j)))
    root = 0
    while root >= 0:
        lengths = begin_at(wave, hits, root, n, False)
        while lengths.nodes + lengths.leaves + lengths.back > 0:
            lengths = _enter_nodes(bvh, wave, waiting, hits, lengths)
            lengths = _visit_leaves(bvh, shapes, solids, wave, rays, seen, hits, lengths, False)
            lengths = _go_back(bvh, wave, waiting, hits, lengths)
        root = bvh.unbounded if root == 0 else -1


@kernel
def any_of_block(
    bvh: Bvh, shapes: Shapes, solids: Solids | None, rays: Rays, hits: Hits, n: int
) -> None:
    """Any hits of the first n rays, likewise: children that wait are bits.

    The arrays are made here again, since they live no longer than the kernel that makes them.
    """
    wave = Wave(
        local_floats(VIEW_FLOATS),
        local_naturals(6 * BLOCK),
        local_naturals(BLOCK),
        local_naturals(BLOCK),
        local_naturals(BLOCK),
        local_naturals(LEVELS * BLOCK),
        local_naturals(3 * BLOCK),
    )
    seen, waiting = local_floats(SEEN_FLOATS), local_naturals(LEVELS * BLOCK)
    prepare(bvh, wave, rays, n)
    for j in range(n):  # the rest of a hit that is none is not asked for
        hits.numbers[j], hits.codes[j] = rays.numbers[6 * BLOCK + j], -1
    root = 0
    while root >= 0:
        lengths = begin_at(wave, hits, root, n, True)
        while lengths.nodes + lengths.leaves + lengths.back > 0:
            lengths = _meet_nodes(bvh, wave, waiting, hits, lengths)
            lengths = _visit_leaves(bvh, shapes, solids, wave, rays, seen, hits, lengths, True)
            lengths = _go_back_any(bvh, wave, waiting, lengths)
        root = bvh.unbounded if root == 0 else -1


@lane_kernel
def _enter(
    boxes: Any, node: Any, views: Any, axes: Any, j: Any, ends: Any, waiting: Any, place: Any
) -> Any:
    """The children whose boxes ray j enters before its end, and the nearest of them; into waiting
    from `place` on how far away they are, inf for the others."""
    t_in, met = between(boxes, node, view_in(views, axes, j), ends.everywhere(j))
    # What begins at infinity holds no hit, and inf is for those that do not wait.
    met = met & (t_in < math.inf)
    t_in = select(met, t_in, math.inf)
    waiting.store(place, t_in)
    return met, met & (t_in <= least(t_in))


@kernel
def _enter_nodes(
    bvh: Bvh, wave: Wave, waiting: FloatArray, hits: Hits, lengths: Lengths
) -> Lengths:
    """A step of each ray at a node: to its nearest child that the ray enters, or back."""
    count, lengths = lengths.nodes, Lengths(0, lengths.leaves, lengths.back)
    for i in range(count):
        j = natural(wave.queues, i)
        node, level = natural(wave.node, j), natural(wave.level, j)
        place = j * LEVELS + level
        wave.nodes[place] = node
        found = _enter(
            bvh.boxes, node, wave.views, wave.axes, j, hits.numbers, waiting, place * LANES
        )
        lengths = _send(bvh, wave, waiting, j, level, found, lengths)
    return lengths


@lane_kernel
def _still(waiting: Any, place: Any, limit: Any) -> Any:
    """The children that wait no further away than a limit, and the nearest of them."""
    t = waiting.load(place)
    near = (t <= limit) & (t < math.inf)
    return near, near & (t <= least(t))


@kernel
def _go_back(bvh: Bvh, wave: Wave, waiting: FloatArray, hits: Hits, lengths: Lengths) -> Lengths:
    """A step of each ray on its way back: to the nearest child of the last node of which some wait,
    or to that before, where they are all further away than what was hit."""
    count, lengths = lengths.back, Lengths(lengths.nodes, lengths.leaves, 0)
    for i in range(count):
        j = natural(wave.queues, 2 * BLOCK + i)
        level = natural(wave.level, j) - 1
        limit = hits.numbers[j] * FAR_SLACK  # as in `traversal.can_be_nearer`
        found = _still(waiting, (j * LEVELS + level) * LANES, limit)
        lengths = _send(bvh, wave, waiting, j, level, found, lengths)
    return lengths


@kernel
def _send(
    bvh: Bvh, wave: Wave, waiting: FloatArray, j: int, level: int, found: int, lengths: Lengths
) -> Lengths:
    """Send ray j from the node of a level to the nearest of the children that `_enter` or `_still`
    has found, if any; the others wait."""
    met, nearest = found & _ALL, found >> LANES
    place = j * LEVELS + level
    lane = lowest(nearest | _LAST)
    waiting[place * LANES + lane] = math.inf
    level += met & (met - 1) != 0
    wave.level[j] = level
    code = child_of(bvh, natural(wave.nodes, place), lane)
    return queued(bvh, wave, j, code, met, level, lengths)


@lane_kernel
def _meets(boxes: Any, node: Any, views: Any, axes: Any, j: Any, ends: Any) -> Any:
    """The children whose boxes ray j enters before its end."""
    _, met = between(boxes, node, view_in(views, axes, j), ends.everywhere(j))
    return met


@kernel
def _meet_nodes(bvh: Bvh, wave: Wave, waiting: Naturals, hits: Hits, lengths: Lengths) -> Lengths:
    """A step of each ray at a node: to a child that the ray enters, or back."""
    count, lengths = lengths.nodes, Lengths(0, lengths.leaves, lengths.back)
    for i in range(count):
        j = natural(wave.queues, i)
        node, level = natural(wave.node, j), natural(wave.level, j)
        wave.nodes[j * LEVELS + level] = node
        met = _meets(bvh.boxes, node, wave.views, wave.axes, j, hits.numbers)
        lengths = _send_any(bvh, wave, waiting, j, level, met, lengths)
    return lengths


@kernel
def _go_back_any(bvh: Bvh, wave: Wave, waiting: Naturals, lengths: Lengths) -> Lengths:
    """A step of each ray on its way back: to a child of the last node of which some wait."""
    count, lengths = lengths.back, Lengths(lengths.nodes, lengths.leaves, 0)
    for i in range(count):
        j = natural(wave.queues, 2 * BLOCK + i)
        level = natural(wave.level, j) - 1
        met = natural(waiting, j * LEVELS + level)
        lengths = _send_any(bvh, wave, waiting, j, level, met, lengths)
    return lengths


@kernel
def _send_any(
    bvh: Bvh, wave: Wave, waiting: Naturals, j: int, level: int, met: int, lengths: Lengths
) -> Lengths:
    """Send ray j from the node of a level to one of the children met, if any; the others wait."""
    place = j * LEVELS + level
    others = met & (met - 1)
    waiting[place] = others
    level += others != 0
    wave.level[j] = level
    code = child_of(bvh, natural(wave.nodes, place), lowest(met | _LAST))
    return queued(bvh, wave, j, code, met, level, lengths)


@kernel
def _visit_leaves(
    bvh: Bvh,
    shapes: Shapes,
    solids: Solids | None,
    wave: Wave,
    rays: Rays,
    seen: FloatArray,
    hits: Hits,
    lengths: Lengths,
    any_hit: bool,
) -> Lengths:
    """Each ray at a leaf finds what is nearer there than its hit so far, and goes back."""
    _fetch_triangles(bvh, bvh.corners, wave, lengths.leaves)
    back = lengths.back
    for i in range(lengths.leaves):
        j = natural(wave.queues, BLOCK + i)
        leaf, shear = -1 - natural(wave.leaf, j), shear_in(wave, rays, j)
        closest = nearest_of_leaf(bvh, shapes, solids, leaf, rays, j, shear, seen, hits)
        wave.queues[2 * BLOCK + (back & (BLOCK - 1))] = j
        back += (wave.level[j] > 0) & (not (any_hit and closest.kind >= 0))
    return Lengths(lengths.nodes, 0, back)


@kernel
def _fetch_triangles(bvh: Bvh, corners: FloatArray | None, wave: Wave, leaves: int) -> None:
    """Ask for the memory of leaves before they are visited: 13 to 19 % of the time (measured)."""
    if corners is None:
        return
    for i in range(leaves):
        leaf = -1 - natural(wave.leaf, natural(wave.queues, BLOCK + i))
        first = first_of(leaf)
        prefetch(bvh.references, 2 * first)
        prefetch(bvh.references, 2 * first + 2 * LANES - 1)
        for line in range(LANES):
            prefetch(corners, 9 * first + LANES * line)
