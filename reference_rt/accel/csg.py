"""Rays against CSG solids, in a leaf of the scene's BVH: the operands' crossings in order, and the
gates that combine them.

The operands' crossings are processed in order of t; after each, the gates tell whether the point is
inside the solid (`shapes.csg.Gates`).  The solid's surface is where this changes.  Crossings that
are closer than their rounding errors are processed as one: coincident faces leave no film of
rounding error between them.

A ray computes the crossings of an operand not before it comes to the operand's box.  What it still
waits for lies in one queue, the nearest first: nodes of the solid's own BVH over its operands, by
the t at which the ray enters their boxes, and the next crossing of each operand that it has come
to.  The other operands are outside so far: their boxes are not around the ray's origin, and the ray
has not come to them.  So the walk to the first visible crossing takes time for the operands whose
boxes are on the way there, and a crossing changes only the gates above its operand, up to the first
one that stays as it is.  The bits are those of a walk that begins with all operands, since boxes
only cull (see `accel/__init__.py`): no crossing comes before its operand's box.  Crossings at the
same t are of one group, whose result does not depend on their order.

An operand that is a closed mesh has a BVH of its own; other operands give their crossings as
`Spans`, see `shapes.dispatch.spans`.  t is that of the ray as given.  Inside, rays start near the
solid's anchor (`ray_near`), so that rounding is relative to the solid's size rather than to its
distance from the origin.
"""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.accel.bvh import FAR_SLACK, Bvh, child_of, first_of, row_of, size_of
from reference_rt.accel.crossing_order import (
    FROM_THE_START,
    OrderedCrossing,
    comes_after,
    nothing_at,
    ordered_crossing,
)
from reference_rt.accel.mesh_crossings import Step, next_mesh_crossing, winding
from reference_rt.accel.nearest_first import push, remove_first, replace_first
from reference_rt.accel.single_ray import SlabRay, enter, slab_ray_of
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Hit, Ray, at, surface_error
from reference_rt.core.vec3 import Vec3, dot, length
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH, lowest
from reference_rt.shapes import Shapes
from reference_rt.shapes.csg import Solids, ray_near

CROSSINGS = 4
"""The most crossings of an operand that is not a mesh: the ends of its `Spans`."""

GRAZING = 2.0**20
"""Crossings further apart than GRAZING times the rounding error of a head-on hit are distinct
without computing their angles: to be one they would have to be met at less than 1e-6 radians."""


class Walk(NamedTuple):
    """What is known during the walk along a ray.

    keys, codes (k,): the queue (`nearest_first`): crossings by t, with the operand as code, and
    nodes by where the ray enters them, with a negative code (`_code_of_node`).  A node holds an
    operand that is not yet in the queue, so that it has room for one entry for each operand.
    run (4,): how many entries there are; the operands that the ray has come to, begin and end in
    the list that is 0 `Solids.asked` or 1 the BVH's references.

    Of operand k, once the ray has come to it: t, u (CROSSINGS k + j): crossing j, a mesh's next one
    at j = 0;  v, row, sign (k,): for a mesh also v, the triangle and +1 where the ray enters;
    passed (k,): crossings processed;  state (k,): 0 outside;  group (k,): the last one of the
    groups of crossings that are processed together with one of the operand's, counted from 1;
    before (k,): the state before that group;  front_t, front_u, front_v, front_row (k,): the last
    crossing in it, which is the one that may be visible.

    members (k,): the operands of the current group;  alone (k,): see `_visible_operand`;  gates
    (j,): of each gate, how many of its inputs are on.
    """

    keys: FloatArray
    codes: IntArray
    run: IntArray
    t: FloatArray
    u: FloatArray
    v: FloatArray
    row: IntArray
    sign: IntArray
    passed: IntArray
    state: IntArray
    group: IntArray
    before: IntArray
    front_t: FloatArray
    front_u: FloatArray
    front_v: FloatArray
    front_row: IntArray
    members: IntArray
    alone: IntArray
    gates: IntArray


@kernel
def _switch(solids: Solids, s: int, gates: IntArray, k: int, on: bool) -> bool:
    """Switches operand k of solid s, which is off or on, to the other, `on`; whether that changes
    the solid."""
    first = solids.gate_first[s]
    to = solids.up[solids.first[s] + k]
    while to >= 0:
        gate = to >> 1
        was = gates[gate]
        now = was + (1 if on != (to & 1 == 1) else -1)
        gates[gate] = now
        if was != 0 and now != 0:
            return False
        on = now != 0
        to = solids.gate_up[first + gate]
    return True


@kernel
def _store_mesh_crossing(walk: Walk, k: int, step: Step) -> None:
    walk.t[CROSSINGS * k], walk.u[CROSSINGS * k] = step.t, step.u
    walk.v[k], walk.row[k], walk.sign[k] = step.v, step.row, step.sign


@kernel
def _begin(solids: Solids, shapes: Shapes, bvh: Bvh, o: int, k: int, ray: Ray, walk: Walk) -> None:
    """The state of operand k of a solid, row o of the operands, at the ray's origin."""
    walk.passed[k] = 0
    if solids.row[o] < 0:
        _store_mesh_crossing(walk, k, next_mesh_crossing(shapes, bvh, solids.root[o], ray, 0.0, -1))
        walk.state[k] = winding(shapes, bvh, solids.root[o], ray)
        return
    spans = any_shape.spans(shapes, solids.kind[o], solids.row[o], ray)
    j = CROSSINGS * k
    walk.t[j], walk.u[j], walk.t[j + 1], walk.u[j + 1] = spans.t0, spans.u0, spans.t1, spans.u1
    walk.t[j + 2], walk.u[j + 2] = spans.t2, spans.u2
    walk.t[j + 3], walk.u[j + 3] = spans.t3, spans.u3
    while walk.passed[k] < CROSSINGS and walk.t[j + walk.passed[k]] <= 0.0:
        walk.passed[k] += 1
    walk.state[k] = walk.passed[k] % 2


@kernel
def _next(solids: Solids, o: int, k: int, walk: Walk) -> Hit:
    """The next crossing of operand k as a hit; at inf for none."""
    j = walk.passed[k]
    if j == CROSSINGS:
        return Hit(math.inf, -1, -1, 0.0, 0.0, -1)
    j += CROSSINGS * k
    row = solids.row[o]
    if row < 0:
        return Hit(walk.t[j], solids.kind[o], walk.row[k], walk.u[j], walk.v[k], -1)
    return Hit(walk.t[j], solids.kind[o], row, walk.u[j], 0.0, -1)


@kernel
def _pass(solids: Solids, shapes: Shapes, bvh: Bvh, o: int, k: int, ray: Ray, walk: Walk) -> None:
    """Advances operand k past its next crossing."""
    if solids.row[o] < 0:
        walk.state[k] += walk.sign[k]
        t, row = walk.t[CROSSINGS * k], walk.row[k]
        step = next_mesh_crossing(shapes, bvh, solids.root[o], ray, t, row)
        _store_mesh_crossing(walk, k, step)
    else:
        walk.passed[k] += 1
        walk.state[k] = walk.passed[k] % 2


@kernel
def head_on(ray: Ray, t: float) -> float:
    """The rounding error, in t, of a crossing at t whose normal is along the ray."""
    return surface_error(ray.o, at(ray, t), 0.0) / length(ray.d)


@kernel
def width(shapes: Shapes, hit: Hit, ray: Ray) -> float:
    """How far rounding may have moved a crossing along the ray, in t: the error of the surface and
    of the ray's own arithmetic, over the cosine."""
    point = any_shape.surface(shapes, ray, hit)
    cosine = abs(dot(point.n, ray.d))
    error = point.error + surface_error(ray.o, point.p, 0.0)
    return error / cosine if cosine > 0.0 else math.inf


COUNT, NEXT, END, LISTED = 0, 1, 2, 3
"""In `Walk.run`."""

_NEARER = 1.0 / (FAR_SLACK * FAR_SLACK)
"""A box that the ray enters at t_in, as computed, holds no crossing before _NEARER t_in: that is
t_in / FAR_SLACK (`can_be_nearer`), and the second factor covers the two roundings."""


@kernel
def _code_of_node(child: int) -> int:
    """The code in the queue of a child in the BVH, a node or a leaf: negative, unlike operands."""
    return -1 - 2 * child if child >= 0 else 2 * child


@kernel
def _node_of_code(code: int) -> int:
    return (-1 - code) >> 1 if code & 1 == 1 else code >> 1


@kernel
def _slab_ray(bvh: Bvh, tree: int, ray: Ray) -> SlabRay:
    """As `slab_ray_of`; nothing of use for a solid without a BVH."""
    if tree < 0:
        nothing = Vec3(0.0, 0.0, 0.0)
        return SlabRay(nothing, nothing, nothing, 0, 0, 0)
    return slab_ray_of(bvh, tree, ray)


@kernel
def _start(solids: Solids, s: int, walk: Walk) -> None:
    """The walk before its first step: all operands are outside."""
    first = solids.gate_first[s]
    for j in range(solids.gates[s]):
        walk.gates[j] = solids.gate_start[first + j]
    walk.run[COUNT], walk.run[LISTED] = 0, 0
    walk.run[NEXT] = solids.asked_first[s]
    walk.run[END] = solids.asked_first[s] + solids.asked_count[s]
    if solids.tree[s] >= 0:
        walk.run[COUNT] = push(walk.keys, walk.codes, 0, 0.0, _code_of_node(solids.tree[s]))


@kernel
def _come_to(
    solids: Solids, shapes: Shapes, bvh: Bvh, s: int, o: int, ray: Ray, at_origin: float, walk: Walk
) -> None:
    """Begins with operand o, of solid s: its state at the ray's origin, and its first crossing."""
    k = o - solids.first[s]
    _begin(solids, shapes, bvh, o, k, ray, walk)
    walk.group[k] = 0
    # A crossing within rounding of the origin is the surface that the ray leaves.
    hit = _next(solids, o, k, walk)
    if hit.t < at_origin and hit.t <= width(shapes, hit, ray):
        _pass(solids, shapes, bvh, o, k, ray, walk)
        hit = _next(solids, o, k, walk)
    if walk.state[k] != 0:
        _switch(solids, s, walk.gates, k, True)
    if hit.t < math.inf:
        walk.run[COUNT] = push(walk.keys, walk.codes, walk.run[COUNT], hit.t, k)


@kernel
def _nearest(
    solids: Solids,
    shapes: Shapes,
    bvh: Bvh,
    s: int,
    ray: Ray,
    slab_ray: SlabRay,
    at_origin: float,
    walk: Walk,
    distances: FloatArray,
    begin: float,
    limit: float,
) -> int:
    """The operand with the first of all next crossings; -1 for none with begin + t up to `limit`.

    What the ray enters within `at_origin` comes first, since the walk begins with the state there:
    a crossing so near may be of the surface that the ray leaves (`_come_to`).
    """
    keys, codes, run = walk.keys, walk.codes, walk.run
    while True:
        while run[NEXT] < run[END]:
            j = run[NEXT]
            run[NEXT] = j + 1
            o = row_of(bvh, j) if run[LISTED] != 0 else solids.asked[j]
            _come_to(solids, shapes, bvh, s, o, ray, at_origin, walk)
        if run[COUNT] == 0 or begin + keys[0] > limit:
            return -1
        code = int(codes[0])
        if code >= 0:
            return code
        run[COUNT] = remove_first(keys, codes, run[COUNT])
        node = _node_of_code(code)
        if node < 0:
            run[NEXT], run[LISTED] = first_of(node), 1
            run[END] = first_of(node) + size_of(node)
            continue
        met = enter(bvh, node, slab_ray, math.inf, distances)
        while met != 0:
            lane = lowest(met)
            met &= met - 1
            key = distances[lane] * _NEARER
            if not key > at_origin:
                key = 0.0
            child = _code_of_node(child_of(bvh, node, lane))
            run[COUNT] = push(keys, codes, run[COUNT], key, child)


@kernel
def _take(
    solids: Solids,
    shapes: Shapes,
    bvh: Bvh,
    s: int,
    ray: Ray,
    walk: Walk,
    k: int,
    hit: Hit,
    group: int,
    members: int,
) -> tuple[int, bool]:
    """Processes the first crossing of the queue, of operand k, in a group with so many members.
    Returns how many members it has now, and whether the solid changes."""
    o = solids.first[s] + k
    if walk.group[k] != group:
        walk.group[k], walk.before[k], walk.members[members] = group, walk.state[k], k
        members += 1
    walk.front_t[k], walk.front_u[k], walk.front_v[k] = hit.t, hit.u, hit.v
    walk.front_row[k] = hit.row
    was = walk.state[k] != 0
    _pass(solids, shapes, bvh, o, k, ray, walk)
    t = _next(solids, o, k, walk).t
    if t < math.inf:
        replace_first(walk.keys, walk.codes, walk.run[COUNT], t, k)
    else:
        walk.run[COUNT] = remove_first(walk.keys, walk.codes, walk.run[COUNT])
    now = walk.state[k] != 0
    return members, was != now and _switch(solids, s, walk.gates, k, now)


@kernel
def _reach_of_group(
    shapes: Shapes, ray: Ray, previous: Hit, hit: Hit, reach: float
) -> tuple[bool, float]:
    """Whether rounding cannot tell a crossing apart from the group that ends with `previous`, and
    how far that reaches now."""
    if hit.t - previous.t > GRAZING * head_on(ray, hit.t):
        return False, reach
    reach = max(reach, previous.t + width(shapes, previous, ray))
    return not hit.t - width(shapes, hit, ray) > reach, reach


@kernel
def surface_along(
    solids: Solids,
    shapes: Shapes,
    bvh: Bvh,
    s: int,
    ray: Ray,
    t_max: float,
    t: FloatArray,
    widths: FloatArray,
    part: IntArray,
    instance: int,
    after: OrderedCrossing,
) -> tuple[int, OrderedCrossing]:
    """Crossings of the ray with the surface of solid s at t in (0, t_max].

    Returns how many there are, and the first that comes after `after`, as a hit of its operand, at
    inf for none.  Into t, widths and part go t, `resolution` and operand of as many as these have
    room for, in order; where that is none, the walk ends at the crossing that is returned.  The ray
    is in the space of `instance`, -1 for none.
    """
    ray, begin = ray_near(solids, s, ray)
    first = solids.first[s]
    count, distances = solids.operands[s], local_floats(VECTOR_WIDTH)
    walk = Walk(
        local_floats(count),
        local_integers(count),
        local_integers(4),
        local_floats(CROSSINGS * count),
        local_floats(CROSSINGS * count),
        local_floats(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_floats(count),
        local_floats(count),
        local_floats(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(solids.gates[s]),
    )
    at_origin, slab_ray = GRAZING * head_on(ray, 0.0), _slab_ray(bvh, solids.tree[s], ray)
    _start(solids, s, walk)
    found, closest = 0, nothing_at(math.inf)
    group, members, changed, reach = 0, 0, False, 0.0
    previous = Hit(0.0, -1, -1, 0.0, 0.0, -1)
    offset, limit = begin, t_max
    while True:
        k = _nearest(
            solids, shapes, bvh, s, ray, slab_ray, at_origin, walk, distances, offset, limit
        )
        hit = previous if k < 0 else _next(solids, first + k, k, walk)
        if members > 0:
            belongs = False
            if k >= 0:
                belongs, reach = _reach_of_group(shapes, ray, previous, hit, reach)
            if not belongs:
                if changed:
                    k = _visible_operand(solids, s, walk, members)
                    kind, at_k = solids.kind[first + k], begin + walk.front_t[k]
                    row, u, v = walk.front_row[k], walk.front_u[k], walk.front_v[k]
                    if closest.hit.kind < 0:
                        hit_k = Hit(at_k, kind, row, u, v, instance)
                        one = ordered_crossing(shapes, hit_k, found)
                        if comes_after(one, after):
                            closest = one
                    if found < len(t):
                        shown = Hit(walk.front_t[k], kind, row, u, v, -1)
                        t[found], widths[found] = at_k, resolution(shapes, shown, ray)
                        part[found] = k
                    found += 1
                    if len(t) == 0 and closest.hit.kind >= 0:
                        break
                members, offset, limit = 0, begin, t_max
                continue
        if k < 0:
            break
        if members == 0:
            group, changed, reach = group + 1, False, hit.t
        members, changes = _take(solids, shapes, bvh, s, ray, walk, k, hit, group, members)
        changed = changed != changes
        # Nothing beyond belongs to the group: `head_on` grows by less than t does.
        previous, offset, limit = hit, 0.0, hit.t + 2.0 * GRAZING * head_on(ray, hit.t)
    return found, closest


@kernel
def resolution(shapes: Shapes, hit: Hit, ray: Ray) -> float:
    """The rounding error of a crossing, in t: two crossings are distinct where they are further
    apart than the sum of theirs."""
    return min(width(shapes, hit, ray), 0.5 * GRAZING * head_on(ray, hit.t))


@kernel
def intersect(solids: Solids, shapes: Shapes, bvh: Bvh, s: int, ray: Ray, t_max: float) -> Hit:
    """The ray's first crossing with the surface of solid s at t in (0, t_max], as a hit of its
    operand; at inf for none."""
    none, no_parts = local_floats(0), local_integers(0)
    _, closest = surface_along(
        solids, shapes, bvh, s, ray, t_max, none, none, no_parts, -1, FROM_THE_START
    )
    return closest.hit


@kernel
def _visible_operand(solids: Solids, s: int, walk: Walk, count: int) -> int:
    """The operand that is visible, of the `count` members of a group that changes the solid: the
    first in the scene's order that changes it by itself, or without which it would not change."""
    members, gates = walk.members, walk.gates
    if count == 1:
        return int(members[0])
    for j in range(1, count):
        k, i = members[j], j
        while i > 0 and members[i - 1] > k:
            members[i] = members[i - 1]
            i -= 1
        members[i] = k
    # From here on `alone` says for each member whether its inside changes, then whether the solid
    # does with it alone.
    for j in range(count):
        k = members[j]
        walk.alone[k] = 0
        if (walk.before[k] != 0) != (walk.state[k] != 0):
            walk.alone[k] = 1
            _switch(solids, s, gates, k, walk.before[k] != 0)
    for j in range(count):
        k = members[j]
        if walk.alone[k] != 0 and not _would_change(solids, s, gates, k, walk.state[k] != 0):
            walk.alone[k] = -1
    for j in range(count):
        if walk.alone[members[j]] != 0:
            _switch(solids, s, gates, members[j], walk.state[members[j]] != 0)
    for j in range(count):
        k = members[j]
        if walk.alone[k] > 0:
            return int(k)
        if walk.alone[k] < 0 and _would_change(solids, s, gates, k, walk.before[k] != 0):
            return int(k)
    return int(members[count - 1])


@kernel
def _would_change(solids: Solids, s: int, gates: IntArray, k: int, on: bool) -> bool:
    """Whether the solid changes with operand k switched to `on`; it stays as it is."""
    changes = _switch(solids, s, gates, k, on)
    _switch(solids, s, gates, k, not on)
    return changes
