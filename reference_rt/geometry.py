"""What a ray can hit: the closest-hit and the any-hit query over all shapes of a scene."""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.bvh import STACK_SIZE, Bvh, first_of, size_of
from reference_rt.csg import evaluate
from reference_rt.csg.tables import Parts, Solids
from reference_rt.groups import Instances, out_of, ray_in, tangents_out_of
from reference_rt.kernel import kernel, local_floats, local_integers
from reference_rt.ray import Hit, Ray, SurfacePoint, no_hit
from reference_rt.shapes import TRIANGLE, Packets, Shapes, triangle
from reference_rt.shapes.shape import Tangents
from reference_rt.shapes.watertight import shear_of
from reference_rt.traversal import can_be_nearer, entry, view_of
from reference_rt.vec3 import Vec3

SOLID, INSTANCE = 100, 101
"""Codes of references that are not rows of a shape's table, but of `Solids` or `Instances`.  Rays
hit the primitives in these: no `Hit` has such a kind."""

STACK = 2 * STACK_SIZE + 2
"""A hierarchy of instances, one of a group, a leaf that waits, and what is infinite."""


class Geometry(NamedTuple):
    """All shapes, and the hierarchy over them where they are many enough to need one."""

    shapes: Shapes
    packets: Packets
    bvh: Bvh | None
    solids: Solids | None
    instances: Instances | None
    parts: Parts | None


@kernel
def closest_hit(geometry: Geometry, ray: Ray) -> Hit:
    """The intersection with the smallest t in (0, t_max); `kind` is -1 for none."""
    return _trace(geometry.bvh, geometry, ray, False)


@kernel
def occluded(geometry: Geometry, ray: Ray) -> bool:
    """Whether anything lies in (0, t_max): a hierarchy is left at the first thing found."""
    return _trace(geometry.bvh, geometry, ray, True).kind >= 0


@kernel
def _trace(bvh: Bvh | None, geometry: Geometry, ray: Ray, any_hit: bool) -> Hit:
    if bvh is None:
        # For a few shapes, asking after each whether the ray is done costs more than the rest.
        return any_shape.nearest(geometry.shapes, geometry.packets, ray)
    return _traverse(bvh, geometry.shapes, geometry.solids, geometry.instances, ray, any_hit)


@kernel
def _traverse(
    bvh: Bvh,
    shapes: Shapes,
    solids: Solids | None,
    instances: Instances | None,
    ray: Ray,
    any_hit: bool,
) -> Hit:
    """Nearer child first; the other waits on a stack with the distance of its box, and with the
    instance in whose coordinates it stands."""
    stack, distance = local_integers(STACK), local_floats(STACK)
    space = local_integers(STACK)
    closest = no_hit(ray)
    local, instance = ray, -1
    view, shear = view_of(bvh, 0, local), shear_of(local)
    node, top = 0, 0
    # A leaf that waits for the instance in it, and where it goes on.
    held, held_at = -1, 0
    if bvh.unbounded >= 0:
        stack[0], distance[0], space[0] = bvh.unbounded, 0.0, -1
        top = 1
    while True:
        begin, size = first_of(bvh, node), size_of(bvh, node)
        if size > 0:
            end = begin + size
            if instances is not None:
                if node == held:
                    begin, held = held_at, -1
            for k in range(begin, end):
                kind, row = bvh.references[k, 0], bvh.references[k, 1]
                if instances is not None:
                    if kind == INSTANCE:
                        held, held_at = node, k + 1
                        stack[top], distance[top], space[top] = node, 0.0, instance
                        top += 1
                        stack[top], distance[top], space[top] = instances.root[row], 0.0, row
                        top += 1
                        break
                if solids is not None:
                    if kind == SOLID:
                        hit = evaluate.intersect(solids, shapes, bvh, row, local, closest.t)
                        kind, row, t, u, v = hit.kind, hit.row, hit.t, hit.u, hit.v
                    else:
                        t, u, v = any_shape.intersect(shapes, kind, row, local, shear)
                else:
                    t, u, v = any_shape.intersect(shapes, kind, row, local, shear)
                if t <= closest.t:
                    hit = Hit(t, kind, row, u, v, instance)
                    if t < closest.t or _precedes(shapes, hit, closest):
                        closest = hit
            # Asked once a leaf: asked for each primitive it costs a quarter of the speed.
            if any_hit and closest.kind >= 0:
                return closest
        else:
            left = begin
            t_left = entry(bvh, left, view, closest.t)
            t_right = entry(bvh, left + 1, view, closest.t)
            if t_left < math.inf or t_right < math.inf:
                node = left if t_left <= t_right else left + 1
                if t_left < math.inf and t_right < math.inf:
                    stack[top] = left + 1 if t_left <= t_right else left
                    distance[top], space[top] = max(t_left, t_right), instance
                    top += 1
                continue
        while True:
            if top == 0:
                return closest
            top -= 1
            if can_be_nearer(distance[top], closest.t):
                node = stack[top]
                if instances is None:
                    break
                if space[top] == instance:
                    break
                instance = space[top]
                local = ray_in(instances, instance, ray)
                shear = shear_of(local)
                if instance < 0:
                    view = view_of(bvh, 0, local)
                    break
                view = view_of(bvh, instances.root[instance], local)
                if entry(bvh, node, view, closest.t) < math.inf:
                    break


@kernel
def _precedes(shapes: Shapes, hit: Hit, closest: Hit) -> bool:
    """Which of two hits at the same t counts: by kind, then in the order of the scene, so that no
    order of traversal can change a picture."""
    if closest.kind < 0:
        return hit.t < closest.t  # t_max itself lies beyond the ray's end
    if hit.instance != closest.instance:
        return hit.instance < closest.instance
    if hit.kind != closest.kind:
        return hit.kind < closest.kind
    owners = (
        any_shape.owner(shapes, hit.kind, hit.row),
        any_shape.owner(shapes, closest.kind, closest.row),
    )
    if owners[0] != owners[1]:
        return owners[0] < owners[1]
    return any_shape.face(shapes, hit) < any_shape.face(shapes, closest)


@kernel
def surface(geometry: Geometry, ray: Ray, hit: Hit) -> SurfacePoint:
    """The surface at a hit (which must be one: `hit.kind >= 0`)."""
    local = ray_in(geometry.instances, hit.instance, ray)
    point = any_shape.surface(geometry.shapes, local, hit)
    point = _turned(geometry.parts, geometry.shapes, hit, point)
    return out_of(geometry.instances, hit.instance, point)


@kernel
def _turned(parts: Parts | None, shapes: Shapes, hit: Hit, point: SurfacePoint) -> SurfacePoint:
    """The point of an operand with the normals of the solid."""
    if parts is None:
        return point
    if parts.turned[any_shape.owner(shapes, hit.kind, hit.row)] == 0:
        return point
    return SurfacePoint(point.p, -point.n, -point.ns, point.error, point.material, point.light)


class Owner(NamedTuple):
    """Whose surface it is.

    shape: index in the scene;  instance: number of the copy, -1 outside groups;  part: number of
    the operand in its solid, or of the shape in its group, else 0;  face: number of the triangle in
    its mesh, or of the face that was hit;  u, v: the surface coordinates.
    """

    shape: int
    instance: int
    part: int
    face: int
    u: float
    v: float


@kernel
def owner(geometry: Geometry, ray: Ray, hit: Hit) -> Owner:
    """Whose a hit is: for pictures and queries, which path tracing does not need."""
    local = ray_in(geometry.instances, hit.instance, ray)
    number = any_shape.owner(geometry.shapes, hit.kind, hit.row)
    shape, part = _whole(geometry.parts, number)
    shape, copy = _in_scene(geometry.instances, hit.instance, shape)
    face = any_shape.face(geometry.shapes, hit)
    u, v = any_shape.uv(geometry.shapes, local, hit)
    return Owner(shape, copy, part, face, u, v)


class Coordinates(NamedTuple):
    """What textures are asked with: the surface coordinates, and the interpolated colour of a
    mesh's vertices, negative where there is none."""

    u: float
    v: float
    colour: Vec3


@kernel
def coordinates(geometry: Geometry, ray: Ray, hit: Hit) -> Coordinates:
    """Where on its surface a hit lies."""
    local = ray_in(geometry.instances, hit.instance, ray)
    u, v = any_shape.uv(geometry.shapes, local, hit)
    return Coordinates(u, v, colour(geometry.shapes, hit, Vec3(-1.0, -1.0, -1.0)))


@kernel
def tangents(geometry: Geometry, ray: Ray, hit: Hit) -> Tangents:
    """dp/du and dp/dv at a hit, u and v being those of `coordinates`.  Where an operand's outside
    is the inside of its solid they are the same: only normals turn over."""
    local = ray_in(geometry.instances, hit.instance, ray)
    found = any_shape.tangents(geometry.shapes, local, hit)
    return tangents_out_of(geometry.instances, hit.instance, found)


@kernel
def _whole(parts: Parts | None, number: int) -> tuple[int, int]:
    """(shape, part) of a primitive's owner."""
    if parts is None:
        return number, 0
    return int(parts.shape[number]), int(parts.part[number])


@kernel
def _in_scene(instances: Instances | None, i: int, shape: int) -> tuple[int, int]:
    """(shape, copy) in the scene."""
    if instances is None:
        return shape, -1
    if i < 0:
        return shape, -1
    return int(instances.owner[i]), int(instances.copy[i])


@kernel
def colour(shapes: Shapes, hit: Hit, without: Vec3) -> Vec3:
    """The colour that a mesh brings for its vertices, interpolated; `without` one, that."""
    if hit.kind == TRIANGLE:
        return triangle.colour(shapes.triangles, hit, without)
    return without
