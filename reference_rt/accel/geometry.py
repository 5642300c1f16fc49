"""What a ray can hit: the closest-hit and the any-hit query over all shapes of a scene."""

from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.accel.bvh import (
    NOTHING,
    WIDE_STACK,
    Bvh,
    first_of,
    is_packet,
    kind_of,
    row_of,
    size_of,
)
from reference_rt.accel.leaf import INSTANCE, nearer_primitive, nearest_of_packet
from reference_rt.accel.single_ray import any_child, can_be_nearer, enter, nearest_child, view_of
from reference_rt.core.ray import Hit, Ray, SurfacePoint, no_hit
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.function_pointer import Address
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import LANES
from reference_rt.shapes import TRIANGLE, Packets, Shapes
from reference_rt.shapes.csg.anchor import out_of_solid, ray_near
from reference_rt.shapes.csg.tables import Parts, Solids
from reference_rt.shapes.instances import Instances, out_of, ray_in, tangents_out_of
from reference_rt.shapes.meshes import triangle
from reference_rt.shapes.meshes.watertight import SEEN_FLOATS, shear_of
from reference_rt.shapes.shape import Tangents

STACK = 2 * WIDE_STACK + LANES + 1
"""A hierarchy of instances, one of a group, the instances of a leaf, and what is infinite."""


class Geometry(NamedTuple):
    """All shapes, and the hierarchy over them where they are many enough to need one.

    tracer: where `wavefront.trace_block` stands, compiled for these; None where it is inlined.
    """

    shapes: Shapes
    packets: Packets
    bvh: Bvh | None
    solids: Solids | None
    instances: Instances | None
    parts: Parts | None
    tracer: Address | None = None


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
    """The nearest child first; the others wait on a stack with the distances of their boxes, and
    with the instance in whose coordinates they stand."""
    stack, waiting, space = local_integers(STACK), local_floats(STACK), local_integers(STACK)
    distances, seen = local_floats(LANES), local_floats(SEEN_FLOATS)
    closest = no_hit(ray)
    local, instance = ray, -1
    view, shear = view_of(bvh, 0, local), shear_of(local)
    node, top = 0, 0
    if bvh.unbounded >= 0:
        stack[0], waiting[0], space[0] = bvh.unbounded, 0.0, -1
        top = 1
    while True:
        while node >= 0:
            met = enter(bvh, node, view, closest.t, distances)
            bottom = top
            if met == 0:
                node = NOTHING
            elif any_hit:
                node, top = any_child(bvh, node, met, stack, top)
            else:
                node, top = nearest_child(bvh, node, met, distances, stack, waiting, top)
            if instances is not None:
                for k in range(bottom, top):
                    space[k] = instance
        if is_packet(node):
            closest = nearest_of_packet(
                bvh.corners, bvh, shapes, node, shear, seen, instance, closest
            )
        else:
            first = first_of(node)
            for k in range(first, first + size_of(node)):
                kind, row = kind_of(bvh, k), row_of(bvh, k)
                if instances is not None:
                    if kind == INSTANCE:
                        stack[top], waiting[top], space[top] = instances.root[row], 0.0, row
                        top += 1
                        continue
                closest = nearer_primitive(
                    bvh, shapes, solids, kind, row, local, shear, instance, closest
                )
        # Asked once a leaf: asked for each primitive it costs a quarter of the speed.
        if any_hit and closest.kind >= 0:
            return closest
        while True:
            if top == 0:
                return closest
            top -= 1
            if any_hit or can_be_nearer(waiting[top], closest.t):
                break
        node = stack[top]
        if instances is not None:
            if space[top] != instance:
                instance = space[top]
                local = ray_in(instances, instance, ray)
                shear = shear_of(local)
                view = view_of(bvh, 0 if instance < 0 else instances.root[instance], local)


@kernel
def surface(geometry: Geometry, ray: Ray, hit: Hit) -> SurfacePoint:
    """The surface at a hit (which must be one: `hit.kind >= 0`)."""
    local, seen, solid = _as_primitive(geometry, ray, hit)
    point = any_shape.surface(geometry.shapes, local, seen)
    point = _turned(geometry.parts, geometry.shapes, hit, point)
    point = out_of_solid(geometry.solids, solid, point)
    return out_of(geometry.instances, hit.instance, point)


@kernel
def _as_primitive(geometry: Geometry, ray: Ray, hit: Hit) -> tuple[Ray, Hit, int]:
    """The ray and the hit as the primitive's table has it, and its solid, -1 for none."""
    local = ray_in(geometry.instances, hit.instance, ray)
    solid = _solid_of(geometry.parts, geometry.shapes, hit)
    local, begin = ray_near(geometry.solids, solid, local)
    return local, Hit(hit.t - begin, hit.kind, hit.row, hit.u, hit.v, hit.instance), solid


@kernel
def _solid_of(parts: Parts | None, shapes: Shapes, hit: Hit) -> int:
    if parts is None:
        return -1
    return int(parts.solid[any_shape.owner(shapes, hit.kind, hit.row)])


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
    local, seen, _ = _as_primitive(geometry, ray, hit)
    number = any_shape.owner(geometry.shapes, hit.kind, hit.row)
    shape, part = _whole(geometry.parts, number)
    shape, copy = _in_scene(geometry.instances, hit.instance, shape)
    face = any_shape.face(geometry.shapes, hit)
    u, v = any_shape.uv(geometry.shapes, local, seen)
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
    local, seen, _ = _as_primitive(geometry, ray, hit)
    u, v = any_shape.uv(geometry.shapes, local, seen)
    return Coordinates(u, v, colour(geometry.shapes, hit, Vec3(-1.0, -1.0, -1.0)))


@kernel
def tangents(geometry: Geometry, ray: Ray, hit: Hit) -> Tangents:
    """dp/du and dp/dv at a hit, u and v being those of `coordinates`.  Where an operand's outside
    is the inside of its solid they are the same: only normals turn over."""
    local, seen, _ = _as_primitive(geometry, ray, hit)
    found = any_shape.tangents(geometry.shapes, local, seen)
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
