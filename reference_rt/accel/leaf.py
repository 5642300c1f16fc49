"""Rays against the contents of a BVH leaf: primitives, SIMD triangles, solids."""

from reference_rt import shapes as any_shape
from reference_rt.accel import csg
from reference_rt.accel.bvh import Bvh, first_of, is_triangle_leaf, kind_of, row_of, size_of
from reference_rt.accel.crossing_order import precedes
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import Crossing, Hit, HitBlock, Ray, RayBlock, hit_of, put_hit, ray_of
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import lowest
from reference_rt.shapes import TRIANGLE, Shapes
from reference_rt.shapes.csg import Solids
from reference_rt.shapes.meshes import triangle
from reference_rt.shapes.meshes.watertight import Shear, project_leaf

SOLID, INSTANCE, OPERAND = 100, 101, 102
"""Kinds of references to rows of `Solids`, of `Instances` and of the operands of solids, rather
than to rows of a shape's table.  Rays hit the primitives in these: no `Hit` has such a kind."""


@kernel
def nearest_of_leaf(
    bvh: Bvh,
    shapes: Shapes,
    solids: Solids | None,
    leaf: int,
    rays: RayBlock,
    j: int,
    shear: Shear,
    seen: FloatArray,
    hits: HitBlock,
) -> Hit:
    """The closest of hit j and all hits of ray j of a block in a leaf without instances; it becomes
    hit j.  seen (PROJECTION_FLOATS,) is scratch."""
    closest = hit_of(hits, j)
    if is_triangle_leaf(leaf):
        closest = nearest_of_triangle_leaf(bvh.corners, bvh, shapes, leaf, shear, seen, -1, closest)
    else:
        ray, first = ray_of(rays, j), first_of(leaf)
        for k in range(first, first + size_of(leaf)):
            kind, row = kind_of(bvh, k), row_of(bvh, k)
            closest = nearer_primitive(bvh, shapes, solids, kind, row, ray, shear, -1, closest)
    put_hit(hits, j, closest)
    return closest


@kernel
def nearer_primitive(
    bvh: Bvh,
    shapes: Shapes,
    solids: Solids | None,
    kind: int,
    row: int,
    ray: Ray,
    shear: Shear,
    instance: int,
    closest: Hit,
) -> Hit:
    """The nearer of `closest` and the ray's hit with one reference, a primitive or a solid."""
    if solids is not None:
        if kind == SOLID:
            hit = csg.intersect(solids, shapes, bvh, row, ray, closest.t)
            found = Crossing(hit.t, hit.u, hit.v)
            return _nearer(shapes, found, hit.kind, hit.row, instance, closest)
    found = any_shape.intersect(shapes, kind, row, ray, shear)
    return _nearer(shapes, found, kind, row, instance, closest)


@kernel
def nearest_of_triangle_leaf(
    corners: FloatArray | None,
    bvh: Bvh,
    shapes: Shapes,
    node: int,
    shear: Shear,
    seen: FloatArray,
    instance: int,
    closest: Hit,
) -> Hit:
    """The closest of `closest` and the hits with a leaf of triangles, tested VECTOR_WIDTH at once.
    seen (PROJECTION_FLOATS,) is scratch."""
    if corners is None:
        return closest
    first, size = first_of(node), size_of(node)
    met = project_leaf(corners, first, size, shear, seen)
    while met != 0:
        lane = lowest(met)
        met &= met - 1
        found = triangle.intersect_lane(corners, first, size, lane, shear, seen)
        row = row_of(bvh, first + lane)
        closest = _nearer(shapes, found, TRIANGLE, row, instance, closest)
    return closest


@kernel
def _nearer(
    shapes: Shapes, found: Crossing, kind: int, row: int, instance: int, closest: Hit
) -> Hit:
    """The nearer of a crossing with one primitive and the closest hit so far."""
    if found.t <= closest.t:
        hit = Hit(found.t, kind, row, found.u, found.v, instance)
        if found.t < closest.t:
            return hit
        # Without a hit so far, closest.t is t_max, which is no longer on the ray.
        if closest.kind >= 0 and precedes(shapes, hit, closest):
            return hit
    return closest
