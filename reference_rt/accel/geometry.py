"""`Geometry`, all that a ray can hit: closest-hit and any-hit queries for one ray; the surface
point, ids, texture coordinates and tangents of a hit."""

from typing import Any, NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.accel.bvh import (
    NOTHING,
    WIDE_STACK,
    Bvh,
    first_of,
    is_triangle_leaf,
    kind_of,
    row_of,
    size_of,
)
from reference_rt.accel.leaf import INSTANCE, nearer_primitive, nearest_of_triangle_leaf
from reference_rt.accel.single_ray import (
    SlabRay,
    any_child,
    can_be_nearer,
    enter,
    nearest_child,
    slab_ray_of,
)
from reference_rt.core.arrays import IntArray
from reference_rt.core.ray import Hit, Ray, SurfacePoint, no_hit
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.links import Linkable
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes import TABLES, TRIANGLE, Shapes
from reference_rt.shapes.csg import Parts, Solids, out_of_solid, ray_near
from reference_rt.shapes.dispatch import primitive_count
from reference_rt.shapes.instances import Instances, out_of, ray_in, tangents_out_of
from reference_rt.shapes.meshes.watertight import PROJECTION_FLOATS, Shear, shear_of
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import OnTriangle

KINDS = len(TABLES)

STACK = 2 * WIDE_STACK + VECTOR_WIDTH + 1
"""Entries of the traversal stack: for the scene's BVH, for one group's, for the instances of a leaf
and for `Bvh.unbounded`."""


class Geometry(NamedTuple):
    """The tables of all shapes.  bvh: None where brute force is faster;  solids, instances, parts:
    None where there are none."""

    shapes: Shapes
    bvh: Bvh | None
    solids: Solids | None
    instances: Instances | None
    parts: Parts | None


geometries = Linkable()
"""The operations below, on a geometry or on a link to one."""


@geometries.operation
def closest_hit(geometry: Geometry, ray: Ray) -> Hit:
    """The intersection with the smallest t in (0, t_max); `kind` is -1 for none."""
    return _trace(geometry, ray, False)


@geometries.operation
def occluded(geometry: Geometry, ray: Ray) -> bool:
    """Whether anything is hit at t in (0, t_max); the traversal ends at the first hit."""
    return _trace(geometry, ray, True).kind >= 0


@kernel
def _trace(geometry: Geometry, ray: Ray, any_hit: bool) -> Hit:
    if geometry.bvh is None:
        # For a few shapes an early exit of any-hit rays would cost more than it saves.
        found: Hit = any_shape.nearest(geometry.shapes, ray)
        return found
    return _traverse(geometry, ray, any_hit, None)


class Cost(NamedTuple):
    """steps: the nodes whose boxes a ray is tested against;  tests: the primitives, a solid as
    one."""

    steps: int
    tests: int


@geometries.operation
def traversal_cost(geometry: Geometry, ray: Ray) -> Cost:
    """What `closest_hit` takes for a ray."""
    counts = local_integers(2)
    counts[0], counts[1] = 0, 0
    if geometry.bvh is None:
        for kind in range(KINDS):
            counts[1] += primitive_count(geometry.shapes, kind)
    else:
        _traverse(geometry, ray, False, counts)
    return Cost(counts[0], counts[1])


class LocalRay(NamedTuple):
    """A ray in the space of one BVH, with what the tests of boxes and of triangles need of it."""

    ray: Ray
    slab_ray: SlabRay
    shear: Shear


@kernel
def local_ray(bvh: Bvh, instances: Instances | None, instance: int, ray: Ray) -> LocalRay:
    """The ray in the space of an instance's group; in world space for instance -1."""
    local, root = ray_in(instances, instance, ray), 0
    if instances is not None:
        if instance >= 0:
            root = instances.root[instance]
    return LocalRay(local, slab_ray_of(bvh, root, local), shear_of(local))


@kernel
def _traverse(geometry: Geometry, ray: Ray, any_hit: bool, counts: IntArray | None) -> Hit:
    """Depth first, the nearest child first.  The stack holds the other children (`stack`), the t at
    which the ray enters their boxes (`waiting`) and the instance in whose space they are
    (`space`).  counts: see `Cost`; None compiles to nothing."""
    bvh: Any = geometry.bvh
    instances: Any = geometry.instances
    shapes = geometry.shapes
    stack, waiting, space = local_integers(STACK), local_floats(STACK), local_integers(STACK)
    distances, seen = local_floats(VECTOR_WIDTH), local_floats(PROJECTION_FLOATS)
    closest = no_hit(ray)
    instance = -1
    local = local_ray(bvh, instances, instance, ray)
    node, top = 0, 0
    if bvh.unbounded >= 0:
        stack[0], waiting[0], space[0] = bvh.unbounded, 0.0, -1
        top = 1
    while True:
        while node >= 0:
            met = enter(bvh, node, local.slab_ray, closest.t, distances)
            if counts is not None:
                counts[0] += 1
            bottom = top
            if met == 0:
                node = NOTHING
            elif any_hit:
                node, top = any_child(bvh, node, met, stack, top)
            else:
                node, top = nearest_child(bvh, node, met, distances, stack, waiting, top)
            if geometry.instances is not None:
                for k in range(bottom, top):
                    space[k] = instance
        if is_triangle_leaf(node):
            if counts is not None:
                counts[1] += size_of(node)
            closest = nearest_of_triangle_leaf(
                bvh.corners, bvh, shapes, node, local.shear, seen, instance, closest
            )
        else:
            first = first_of(node)
            for k in range(first, first + size_of(node)):
                kind, row = kind_of(bvh, k), row_of(bvh, k)
                if geometry.instances is not None:
                    if kind == INSTANCE:
                        stack[top], waiting[top], space[top] = instances.root[row], 0.0, row
                        top += 1
                        continue
                if counts is not None:
                    counts[1] += 1
                closest = nearer_primitive(
                    bvh,
                    shapes,
                    geometry.solids,
                    kind,
                    row,
                    local.ray,
                    local.shear,
                    instance,
                    closest,
                )
        # Tested once per leaf: a test after each primitive costs a quarter of the speed.
        if any_hit and closest.kind >= 0:
            return closest
        while True:
            if top == 0:
                return closest
            top -= 1
            if any_hit or can_be_nearer(waiting[top], closest.t):
                break
        node = stack[top]
        if geometry.instances is not None:
            if space[top] != instance:
                instance = space[top]
                local = local_ray(bvh, instances, instance, ray)


@geometries.operation
def surface(geometry: Geometry, ray: Ray, hit: Hit) -> SurfacePoint:
    """The surface point, in world space, of a hit with `hit.kind >= 0`."""
    local, seen, solid = _in_primitive_space(geometry, ray, hit)
    point = any_shape.surface(geometry.shapes, local, seen)
    if geometry.parts is not None:
        # The outside of an operand may be the inside of its solid.
        if geometry.parts.turned[any_shape.owner(geometry.shapes, hit.kind, hit.row)] != 0:
            point = SurfacePoint(
                point.p, -point.n, -point.ns, point.error, point.material, point.light
            )
    point = out_of_solid(geometry.solids, solid, point)
    return out_of(geometry.instances, hit.instance, point)


@kernel
def _in_primitive_space(geometry: Geometry, ray: Ray, hit: Hit) -> tuple[Ray, Hit, int]:
    """(ray, hit, solid): the ray and the hit in the space of the primitive's table, that is of its
    instance and relative to the anchor of its solid; solid is -1 for none."""
    local = ray_in(geometry.instances, hit.instance, ray)
    solid = -1
    if geometry.parts is not None:
        solid = int(geometry.parts.solid[any_shape.owner(geometry.shapes, hit.kind, hit.row)])
    local, begin = ray_near(geometry.solids, solid, local)
    return local, Hit(hit.t - begin, hit.kind, hit.row, hit.u, hit.v, hit.instance), solid


class HitIds(NamedTuple):
    """Which shape, instance, part and face a hit belongs to.

    shape: index in the scene;  instance: number of the copy, -1 outside groups;  part: number of
    the operand in its solid, or of the shape in its group, else 0;  face: number of the triangle in
    its mesh, or of the shape's face.
    """

    shape: int
    instance: int
    part: int
    face: int


@geometries.operation
def owner(geometry: Geometry, hit: Hit) -> HitIds:
    """The ids of a hit, for layers and queries; path tracing needs none."""
    shape, part, copy = any_shape.owner(geometry.shapes, hit.kind, hit.row), 0, -1
    if geometry.parts is not None:
        part = int(geometry.parts.part[shape])
        shape = int(geometry.parts.shape[shape])
    if geometry.instances is not None:
        if hit.instance >= 0:
            shape = int(geometry.instances.owner[hit.instance])
            copy = int(geometry.instances.copy[hit.instance])
    face = any_shape.face(geometry.shapes, hit)
    return HitIds(shape, copy, part, face)


class Coordinates(NamedTuple):
    """The inputs of texture lookups: the surface coordinates, and the interpolated vertex colour of
    a mesh, negative where there is none."""

    u: float
    v: float
    colour: Vec3


@geometries.operation
def coordinates(geometry: Geometry, ray: Ray, hit: Hit) -> Coordinates:
    """The surface coordinates and the vertex colour of a hit."""
    local, seen, _ = _in_primitive_space(geometry, ray, hit)
    u, v = any_shape.uv(geometry.shapes, local, seen)
    return Coordinates(u, v, colour(geometry.shapes, hit, Vec3(-1.0, -1.0, -1.0)))


@kernel
def on_triangle(hit: Hit) -> OnTriangle:
    """Where a hit is on its triangle, for other sets of texture coordinates."""
    return OnTriangle(hit.row if hit.kind == TRIANGLE else -1, hit.u, hit.v)


@geometries.operation
def tangents(geometry: Geometry, ray: Ray, hit: Hit) -> Tangents:
    """dp/du and dp/dv at a hit, with u and v as in `coordinates`.  A solid flips the normals of
    some operands, but never their tangents."""
    local, seen, _ = _in_primitive_space(geometry, ray, hit)
    found = any_shape.tangents(geometry.shapes, local, seen)
    return tangents_out_of(geometry.instances, hit.instance, found)


@kernel
def colour(shapes: Shapes, hit: Hit, without: Vec3) -> Vec3:
    """The interpolated vertex colour of a mesh; `without` for hits that have none."""
    found: Vec3 = any_shape.colour(shapes, hit, without)
    return found
