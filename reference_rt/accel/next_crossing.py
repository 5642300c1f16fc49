"""All crossings of a ray with the scene's surfaces, one call each, for queries; rendering needs
only the closest hit."""

import math
from typing import Any

from reference_rt.accel import csg
from reference_rt.accel.bvh import NOTHING, Bvh, first_of, kind_of, row_of, size_of
from reference_rt.accel.crossing_order import (
    FROM_THE_START,
    OrderedCrossing,
    comes_after,
    nothing_at,
    ordered_crossing,
)
from reference_rt.accel.geometry import KINDS, STACK, Geometry, geometries, local_ray
from reference_rt.accel.leaf import INSTANCE, SOLID
from reference_rt.accel.single_ray import can_be_nearer, enter, nearest_child
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Hit, Ray
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes import Shapes
from reference_rt.shapes.csg import Solids
from reference_rt.shapes.dispatch import MAX_CROSSINGS, along, primitive_count
from reference_rt.shapes.meshes.watertight import Shear, shear_of


@geometries.operation
def next_crossing(geometry: Geometry, ray: Ray, after: OrderedCrossing) -> OrderedCrossing:
    """The first crossing in (0, t_max) that comes after `after`; `kind` is -1 for none.

    Each call traverses the BVH from the ray's origin.  So no buffer limits the number of crossings,
    and each has the t that `closest_hit` would have found.
    """
    if geometry.bvh is None:
        return _brute_force(geometry.shapes, ray, after)
    return _traverse(geometry, ray, after)


@geometries.operation
def crossings_of_solid(
    geometry: Geometry, s: int, ray: Ray, t: FloatArray, widths: FloatArray, part: IntArray
) -> int:
    """How many crossings a ray has with solid s of a geometry that has solids; t, resolution and
    operand of as many as the arrays have room for, in order: see `csg.surface_along`."""
    solids: Any = geometry.solids
    bvh: Any = geometry.bvh
    count, _ = csg.surface_along(
        solids, geometry.shapes, bvh, s, ray, math.inf, t, widths, part, -1, FROM_THE_START
    )
    return count


@kernel
def _brute_force(shapes: Shapes, ray: Ray, after: OrderedCrossing) -> OrderedCrossing:
    best, shear = nothing_at(ray.t_max), shear_of(ray)
    for kind in range(KINDS):
        for i in range(primitive_count(shapes, kind)):
            best = _of_primitive(shapes, kind, i, ray, shear, -1, after, best)
    return best


@kernel
def _of_primitive(
    shapes: Shapes,
    kind: int,
    i: int,
    ray: Ray,
    shear: Shear,
    instance: int,
    after: OrderedCrossing,
    best: OrderedCrossing,
) -> OrderedCrossing:
    """The earliest of `best` and of the primitive's crossings that come after `after`."""
    spans, v = along(shapes, kind, i, ray, shear)
    for number in range(MAX_CROSSINGS):
        t, u = spans.t0, spans.u0
        if number == 1:
            t, u = spans.t1, spans.u1
        elif number == 2:
            t, u = spans.t2, spans.u2
        elif number == 3:
            t, u = spans.t3, spans.u3
        if 0.0 < t < math.inf:
            one = ordered_crossing(shapes, Hit(t, kind, i, u, v, instance), number)
            best = _first(one, after, best)
    return best


@kernel
def _first(
    found: OrderedCrossing, after: OrderedCrossing, best: OrderedCrossing
) -> OrderedCrossing:
    """The earlier of `best` and of `found`, if that comes after `after`."""
    if not found.hit.t <= best.hit.t or not comes_after(found, after):
        return best
    if found.hit.t < best.hit.t:
        return found
    # Without a crossing so far, best.hit.t is t_max, which is no longer on the ray.
    if best.hit.kind >= 0 and comes_after(best, found):
        return found
    return best


@kernel
def _traverse(geometry: Geometry, ray: Ray, after: OrderedCrossing) -> OrderedCrossing:
    """As `geometry._traverse`."""
    bvh: Any = geometry.bvh
    instances: Any = geometry.instances
    shapes, solids = geometry.shapes, geometry.solids
    stack, waiting, space = local_integers(STACK), local_floats(STACK), local_integers(STACK)
    distances = local_floats(VECTOR_WIDTH)
    best = nothing_at(ray.t_max)
    instance = -1
    local = local_ray(bvh, instances, instance, ray)
    node, top = 0, 0
    if bvh.unbounded >= 0:
        stack[0], waiting[0], space[0] = bvh.unbounded, 0.0, -1
        top = 1
    while True:
        while node >= 0:
            met = enter(bvh, node, local.slab_ray, best.hit.t, distances)
            bottom = top
            if met == 0:
                node = NOTHING
            else:
                node, top = nearest_child(bvh, node, met, distances, stack, waiting, top)
            for k in range(bottom, top):
                space[k] = instance
        first = first_of(node)
        for k in range(first, first + size_of(node)):
            kind, row = kind_of(bvh, k), row_of(bvh, k)
            if geometry.instances is not None:
                if kind == INSTANCE:
                    stack[top], waiting[top], space[top] = instances.root[row], 0.0, row
                    top += 1
                    continue
            best = _of_reference(
                bvh, shapes, solids, kind, row, local.ray, local.shear, instance, after, best
            )
        while True:
            if top == 0:
                return best
            top -= 1
            if can_be_nearer(waiting[top], best.hit.t):
                break
        node = stack[top]
        if geometry.instances is not None:
            if space[top] != instance:
                instance = space[top]
                local = local_ray(bvh, instances, instance, ray)


@kernel
def _of_reference(
    bvh: Bvh,
    shapes: Shapes,
    solids: Solids | None,
    kind: int,
    row: int,
    ray: Ray,
    shear: Shear,
    instance: int,
    after: OrderedCrossing,
    best: OrderedCrossing,
) -> OrderedCrossing:
    """The earliest of `best` and of the crossings with one reference, a primitive or a solid, that
    come after `after`."""
    if solids is not None:
        if kind == SOLID:
            none, no_parts = local_floats(0), local_integers(0)
            _, found = csg.surface_along(
                solids, shapes, bvh, row, ray, best.hit.t, none, none, no_parts, instance, after
            )
            return _first(found, after, best)
    return _of_primitive(shapes, kind, row, ray, shear, instance, after, best)
