"""Rays against CSG solids, in a leaf of the scene's BVH: the operands' crossings in order, and a
postfix program that combines them.

The operands' crossings are processed in order of t; after each, the postfix program computes from
the operands' states whether the point is inside the solid.  The solid's surface is where this
changes.  Crossings that are closer than their rounding errors are processed as one: coincident
faces leave no film of rounding error between them.

An operand that is a closed mesh has a BVH of its own; other operands give their crossings as
`Spans`, see `shapes.dispatch.spans`.  t is that of the ray as given.  Inside, rays start near the
solid's anchor (`ray_near`), so that rounding is relative to the solid's size rather than to its
distance from the origin.
"""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.accel.bvh import NOTHING, WIDE_STACK, Bvh, first_of, row_of, size_of
from reference_rt.accel.crossing_order import (
    FROM_THE_START,
    OrderedCrossing,
    comes_after,
    nothing_at,
    ordered_crossing,
)
from reference_rt.accel.single_ray import enter, nearest_child, slab_ray_of
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Hit, Ray, at, surface_error
from reference_rt.core.vec3 import dot, length
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes import TRIANGLE, Shapes
from reference_rt.shapes.csg import AND, NOT, OR, Solids, ray_near
from reference_rt.shapes.meshes.watertight import shear_of

# ---- closed meshes: a ray's crossings in order, and its origin's winding number ------------------


class Step(NamedTuple):
    """A crossing: t, inf for none; the triangle and its barycentrics; sign, +1 where the ray goes
    in, -1 where it comes out."""

    t: float
    row: int
    u: float
    v: float
    sign: int


@kernel
def next_mesh_crossing(
    shapes: Shapes, bvh: Bvh, root: int, ray: Ray, after: float, row: int
) -> Step:
    """The first crossing of a mesh that comes after (t = `after`, `row`), ordered by t and then by
    row, so that none is skipped where several have the same t."""
    found, _ = _walk(shapes, bvh, root, ray, after, row, False)
    return found


@kernel
def winding(shapes: Shapes, bvh: Bvh, root: int, ray: Ray) -> int:
    """The winding number of a closed mesh about the ray's origin: 0 outside, 1 inside."""
    _, total = _walk(shapes, bvh, root, ray, 0.0, -1, True)
    return -total


@kernel
def _walk(
    shapes: Shapes, bvh: Bvh, root: int, ray: Ray, after: float, row: int, total: bool
) -> tuple[Step, int]:
    """(the next crossing, with `total` the sum of the signs of all crossings at t > 0)."""
    found, balance = Step(math.inf, -1, 0.0, 0.0, 0), 0
    stack, waiting = local_integers(WIDE_STACK), local_floats(WIDE_STACK)
    distances = local_floats(VECTOR_WIDTH)
    slab_ray, shear = slab_ray_of(bvh, root, ray), shear_of(ray)
    node, top = root, 0
    while True:
        while node >= 0:
            met = enter(bvh, node, slab_ray, math.inf if total else found.t, distances)
            if met == 0:
                node = NOTHING
            else:
                node, top = nearest_child(bvh, node, met, distances, stack, waiting, top)
        begin = first_of(node)
        for k in range(begin, begin + size_of(node)):
            i = row_of(bvh, k)
            t, u, v = any_shape.intersect(shapes, TRIANGLE, i, ray, shear)
            if t < math.inf and (t > after or (t == after and i > row)):
                if t < found.t or (t == found.t and i < found.row):
                    found = Step(t, i, u, v, any_shape.enters(shapes, TRIANGLE, i, shear))
                if total:
                    balance += any_shape.enters(shapes, TRIANGLE, i, shear)
        if top == 0:
            return found, balance
        top -= 1
        node = stack[top]


# ---- solids --------------------------------------------------------------------------------------

CROSSINGS = 4
"""The most crossings of an operand that is not a mesh: the ends of its `Spans`."""

GRAZING = 2.0**20
"""Crossings further apart than GRAZING times the rounding error of a head-on hit are distinct
without computing their angles: to be one they would have to be met at less than 1e-6 radians."""


class Walk(NamedTuple):
    """The states of a solid's operands during the walk along a ray.

    t, u (CROSSINGS k + j): crossing j of operand k, a mesh's next one at j = 0;  v, row, sign (k,):
    for a mesh also v, the triangle and +1 where the ray enters;  passed (k,): crossings processed;
    state (k,): 0 outside;  before, met (k,): the state before the crossings that are processed
    together, and whether one of them is the operand's.
    """

    t: FloatArray
    u: FloatArray
    v: FloatArray
    row: IntArray
    sign: IntArray
    passed: IntArray
    state: IntArray
    before: IntArray
    met: IntArray


@kernel
def is_inside(solids: Solids, s: int, state: IntArray, values: IntArray) -> bool:
    """The program of solid s on its operands' states, 0 for outside; `values` is its stack."""
    top = 0
    first = solids.step_first[s]
    for k in range(first, first + solids.step_count[s]):
        step = solids.steps[k]
        if step >= 0:
            values[top] = 1 if state[step] != 0 else 0
            top += 1
        elif step == NOT:
            values[top - 1] = 1 - values[top - 1]
        else:
            top -= 1
            if step == OR:
                values[top - 1] |= values[top]
            elif step == AND:
                values[top - 1] &= values[top]
    return bool(values[0] != 0)


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
def _nearest(solids: Solids, first: int, count: int, walk: Walk) -> tuple[int, Hit]:
    """(operand, hit): the first of all operands' next crossings; -1 for none."""
    best, closest = -1, Hit(math.inf, -1, -1, 0.0, 0.0, -1)
    for k in range(count):
        hit = _next(solids, first + k, k, walk)
        if hit.t < closest.t:
            best, closest = k, hit
    return best, closest


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


class Front(NamedTuple):
    """Each operand's last one of the crossings that were processed together, which is the one that
    may be visible: t, u, v, row (k,)."""

    t: FloatArray
    u: FloatArray
    v: FloatArray
    row: IntArray


@kernel
def begin_all(
    solids: Solids, shapes: Shapes, bvh: Bvh, s: int, ray: Ray, walk: Walk
) -> tuple[int, Hit]:
    """Sets the state of all operands at the ray's origin; (operand, hit) of the first crossing."""
    first, count = solids.first[s], solids.operands[s]
    at_origin = GRAZING * head_on(ray, 0.0)
    for k in range(count):
        _begin(solids, shapes, bvh, first + k, k, ray, walk)
        # A crossing within rounding of the origin is the surface that the ray leaves.
        hit = _next(solids, first + k, k, walk)
        if hit.t < at_origin and hit.t <= width(shapes, hit, ray):
            _pass(solids, shapes, bvh, first + k, k, ray, walk)
    return _nearest(solids, first, count, walk)


@kernel
def pass_together(
    solids: Solids,
    shapes: Shapes,
    bvh: Bvh,
    s: int,
    ray: Ray,
    walk: Walk,
    front: Front,
    best: int,
    hit: Hit,
) -> tuple[int, Hit]:
    """Processes a crossing and all that rounding cannot tell apart from it; (operand, hit) of the
    next one."""
    first, count = solids.first[s], solids.operands[s]
    for k in range(count):
        walk.before[k], walk.met[k] = walk.state[k], 0
    reach = hit.t
    while best >= 0:
        front.t[best], front.u[best], front.v[best] = hit.t, hit.u, hit.v
        front.row[best] = hit.row
        walk.met[best] = 1
        _pass(solids, shapes, bvh, first + best, best, ray, walk)
        previous = hit
        best, hit = _nearest(solids, first, count, walk)
        if best < 0 or hit.t - previous.t > GRAZING * head_on(ray, hit.t):
            break
        reach = max(reach, previous.t + width(shapes, previous, ray))
        if hit.t - width(shapes, hit, ray) > reach:
            break
    return best, hit


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
    first, count = solids.first[s], solids.operands[s]
    walk = Walk(
        local_floats(CROSSINGS * count),
        local_floats(CROSSINGS * count),
        local_floats(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
        local_integers(count),
    )
    front = Front(
        local_floats(count), local_floats(count), local_floats(count), local_integers(count)
    )
    values = local_integers(solids.depth[s])
    best, hit = begin_all(solids, shapes, bvh, s, ray, walk)
    inside = is_inside(solids, s, walk.state, values)
    found, closest = 0, nothing_at(math.inf)
    while best >= 0 and begin + hit.t <= t_max:
        best, hit = pass_together(solids, shapes, bvh, s, ray, walk, front, best, hit)
        was_inside = inside
        inside = is_inside(solids, s, walk.state, values)
        if inside != was_inside:
            k = visible_operand(solids, s, count, walk, values, was_inside)
            kind, at_k = solids.kind[first + k], begin + front.t[k]
            if closest.hit.kind < 0:
                hit_k = Hit(at_k, kind, front.row[k], front.u[k], front.v[k], instance)
                one = ordered_crossing(shapes, hit_k, found)
                if comes_after(one, after):
                    closest = one
            if found < len(t):
                shown = Hit(front.t[k], kind, front.row[k], front.u[k], front.v[k], -1)
                t[found], widths[found] = at_k, resolution(shapes, shown, ray)
                part[found] = k
            found += 1
            if len(t) == 0 and closest.hit.kind >= 0:
                break
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
def visible_operand(
    solids: Solids, s: int, count: int, walk: Walk, values: IntArray, inside: bool
) -> int:
    """The operand that is visible, of those whose crossings were processed together and changed
    `inside`: the first in the scene's order that changes it by itself, or without which it would
    not change."""
    last = -1
    for k in range(count):
        if walk.met[k] != 0:
            last = k
            was, now = walk.before[k], walk.state[k]
            walk.before[k] = now
            alone = is_inside(solids, s, walk.before, values) != inside
            walk.before[k] = was
            walk.state[k] = was
            needed = is_inside(solids, s, walk.state, values) == inside
            walk.state[k] = now
            if alone or needed:
                return k
    return last
