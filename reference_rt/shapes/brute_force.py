"""Closest hits by brute force, without a BVH: faster for scenes of a few shapes.

Spheres, rectangles and boxes are tested with SIMD: VECTOR_WIDTH shapes against one ray (`nearest`),
or one shape against VECTOR_WIDTH rays (`nearest_of_rays`).
"""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import BLOCK, Crossing, Hit, Ray, miss, no_hit
from reference_rt.core.ray_block import HitBlock, RayBlock, hit_of, put_hit, ray_of
from reference_rt.core.vec3 import row
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import ByClass, kernel, local_floats, local_integers
from reference_rt.jit.links import Link
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes import box
from reference_rt.shapes.box import Boxes
from reference_rt.shapes.curved import sphere
from reference_rt.shapes.curved.sphere import Spheres
from reference_rt.shapes.flat import rectangle
from reference_rt.shapes.flat.rectangle import Rectangles
from reference_rt.shapes.meshes.triangle import Triangles
from reference_rt.shapes.meshes.watertight import shear_of
from reference_rt.shapes.ray_simd import begin, end, resume
from reference_rt.shapes.shape import nearest_lane
from reference_rt.shapes.tables import (
    BOX,
    RECTANGLE,
    SPHERE,
    TABLES,
    TRIANGLE,
    Shapes,
    by_code,
    of_table,
)

Packed = Annotated[FloatArray, 3]
"""The SoA layout of the shapes of one type: packets (k, columns, VECTOR_WIDTH)."""


class Packets(NamedTuple):
    """The shapes in the SoA layout of `_nearest_in_packets`; None for those that are in a BVH."""

    spheres: FloatArray | None
    rectangles: FloatArray | None
    boxes: FloatArray | None


@kernel
def _no_crossing(table: Any, i: int, ray: Any) -> Crossing:
    return miss()


@kernel
def _not_found(table: Any, i: int, ray: Ray, t: float) -> Crossing:
    return miss()


intersect_row = of_table("intersect", _no_crossing)
"""intersect_row(table, i, ray): `intersect` of one table's row i; triangles take a `Shear`."""

_lane_distance = of_table("lane_distance", miss)
_found = of_table("found", _not_found)


@kernel
def _nearest_in_packets(
    kind: int, table: Any, packets: FloatArray | None, ray: Ray, closest: Hit
) -> Hit:
    """The nearest of `closest` and all shapes of a table, VECTOR_WIDTH shapes at a time."""
    if table is None:
        return closest
    if packets is None:
        return closest
    distances = local_floats(VECTOR_WIDTH)
    best, t = -1, closest.t
    for k in range(len(packets)):
        for lane in range(VECTOR_WIDTH):
            distances[lane] = _lane_distance(table, packets, k, lane, ray)
        best, t = nearest_lane(distances, k, best, t)
    if best < 0:
        return closest
    found: Crossing = _found(table, best, ray, t)
    return Hit(found.t, kind, best, found.u, found.v, -1)


@kernel
def _nearest_in_table(kind: int, table: Any, ray: Any, closest: Hit) -> Hit:
    """The nearest of `closest` and all primitives of a table, one at a time."""
    if table is None:
        return closest
    for i in range(len(table.owner)):
        found: Crossing = intersect_row(table, i, ray)
        if found.t < closest.t:
            closest = Hit(found.t, kind, i, found.u, found.v, -1)
    return closest


@kernel
def _nearest(shapes: Shapes, packets: Packets, ray: Ray) -> Hit:
    """The closest hit of one ray.  Of several at the same t, the first in the order of the codes,
    then of the scene."""
    closest = Hit(ray.t_max, -1, -1, 0.0, 0.0, -1)
    closest = _nearest_in_packets(SPHERE, shapes.spheres, packets.spheres, ray, closest)
    closest = _nearest_in_packets(RECTANGLE, shapes.rectangles, packets.rectangles, ray, closest)
    closest = _nearest_in_packets(BOX, shapes.boxes, packets.boxes, ray, closest)
    return _nearest_of_others(shapes, ray, closest)


_without_packets = ByCode(
    (code, field, module)
    for code, field, _, module in TABLES
    if code != TRIANGLE and not hasattr(module, "lane_distance")
)
_nearest_in_tables = _without_packets.in_turn(_nearest_in_table)


@kernel
def _nearest_of_others(shapes: Shapes, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and all shapes of types without SIMD kernels."""
    found: Hit = _nearest_in_tables(shapes, ray, _nearest_triangle(shapes.triangles, ray, closest))
    return found


@kernel
def _yes(kind: int, table: Any, found: bool) -> bool:
    return True


_any_in_tables = _without_packets.in_turn(_yes)


@kernel
def _has_others(shapes: Shapes) -> bool:
    """Whether the scene has types of shapes without SIMD kernels: a constant."""
    return bool(_any_in_tables(shapes, shapes.triangles is not None))


@kernel
def _nearest_triangle(triangles: Triangles | None, ray: Ray, closest: Hit) -> Hit:
    if triangles is None:
        return closest
    return _nearest_in_table(TRIANGLE, triangles, shear_of(ray), closest)


_KIND = 2**40
"""`HitBlock.codes` are kind * _KIND + row."""


@kernel
def _nearest_of_rays(shapes: Shapes, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
    """Test the first n of `rays`, VECTOR_WIDTH at a time, against the types with SIMD kernels;
    writes `hits`, which `nearest_of_ray` completes.  any_hit: against all types, and the result is
    only whether a ray hits anything, which is the sign of its code."""
    t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
    for at in range(0, n, VECTOR_WIDTH):
        begin(rays.numbers, at, t, codes)
        _nearer_spheres(shapes.spheres, rays, at, t, codes)
        _nearer_rectangles(shapes.rectangles, rays, at, t, codes)
        _nearer_boxes(shapes.boxes, rays, at, t, codes)
        end(t, codes, at, hits.numbers, hits.codes)
    if any_hit and _has_others(shapes):
        for j in range(n):
            if hits.codes[j] < 0:
                ray = ray_of(rays, j)
                hits.codes[j] = _nearest_of_others(shapes, ray, no_hit(ray)).kind


@kernel
def _nearest_of_ray(shapes: Shapes, ray: Ray, hits: HitBlock, j: int) -> Hit:
    """`nearest` for ray number j, after `nearest_of_rays`."""
    closest = _hit_of_code(shapes, ray, hits.codes[j], hits.numbers[j])
    return _nearest_of_others(shapes, ray, closest)


@kernel
def _hit_of_code(shapes: Shapes, ray: Ray, code: int, t: float) -> Hit:
    if code < 0:
        return no_hit(ray)
    kind, i = code // _KIND, code % _KIND
    if shapes.rectangles is None and shapes.boxes is None:
        kind = SPHERE  # a constant, so that the branches below vanish
    found = Crossing(t, 0.0, 0.0)
    if kind == RECTANGLE:
        found = _found(shapes.rectangles, i, ray, t)
    elif kind == BOX:
        found = _found(shapes.boxes, i, ray, t)
    return Hit(found.t, kind, i, found.u, found.v, -1)


@kernel
def _nearer_spheres(
    spheres: Spheres | None, rays: RayBlock, at: int, t: FloatArray, codes: IntArray
) -> None:
    if spheres is not None:
        for i in range(len(spheres.owner)):
            shape = (row(spheres.center, i), spheres.radius[i])
            sphere.nearer(rays.numbers, at, shape, SPHERE * _KIND + i, t, codes)


@kernel
def _nearer_rectangles(
    table: Rectangles | None, rays: RayBlock, at: int, t: FloatArray, codes: IntArray
) -> None:
    if table is not None:
        for i in range(len(table.owner)):
            place = (row(table.center, i), row(table.normal, i))
            shape = (*place, row(table.x_of, i), row(table.y_of, i))
            rectangle.nearer(rays.numbers, at, shape, RECTANGLE * _KIND + i, t, codes)


@kernel
def _nearer_boxes(
    boxes: Boxes | None, rays: RayBlock, at: int, t: FloatArray, codes: IntArray
) -> None:
    if boxes is not None:
        for i in range(len(boxes.owner)):
            box.nearer(rays.numbers, at, box.arguments(boxes, i), BOX * _KIND + i, t, codes)


# The same for shapes behind a link, one operation for each type.


def _nearest_by(kind: int) -> Callable[..., Hit]:
    """The kernel of `nearest_of_type` for a type of shape."""
    is_packed = kind in (SPHERE, RECTANGLE, BOX)

    @kernel
    def of_packets(table: Any, packets: Packed, ray: Ray, closest: Hit) -> Hit:
        return _nearest_in_packets(kind, table, packets, ray, closest)

    @kernel
    def of_triangles(table: Any, packets: Packed, ray: Ray, closest: Hit) -> Hit:
        return _nearest_in_table(kind, table, shear_of(ray), closest)

    @kernel
    def of_rows(table: Any, packets: Packed, ray: Ray, closest: Hit) -> Hit:
        return _nearest_in_table(kind, table, ray, closest)

    if is_packed:
        return of_packets
    return of_triangles if kind == TRIANGLE else of_rows


_KINDS = len(TABLES)
_CODES = {module: code for code, _, _, module in TABLES}


@by_code(lambda module: _nearest_by(_CODES[module]))
def nearest_of_type(shapes: Shapes, kind: int, packets: Packed, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and a ray's hit with any shape of one type."""
    return closest


@kernel
def _nearest_linked(shapes: Link, packets: Packets, ray: Ray) -> Hit:
    closest = no_hit(ray)
    closest = nearest_of_type(shapes, SPHERE, packets.spheres, ray, closest)
    closest = nearest_of_type(shapes, RECTANGLE, packets.rectangles, ray, closest)
    closest = nearest_of_type(shapes, BOX, packets.boxes, ray, closest)
    for kind in range(TRIANGLE, _KINDS):
        closest = nearest_of_type(shapes, kind, packets.boxes, ray, closest)
    return closest


def _of_block_by(kind: int) -> Callable[..., None]:
    """The kernel of `nearest_of_block` for a type of shape."""

    @kernel
    def of_spheres(spheres: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
        t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
        for at in range(0, n, VECTOR_WIDTH):
            resume(hits.numbers, hits.codes, at, t, codes)
            _nearer_spheres(spheres, rays, at, t, codes)
            end(t, codes, at, hits.numbers, hits.codes)

    @kernel
    def of_rectangles(table: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
        t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
        for at in range(0, n, VECTOR_WIDTH):
            resume(hits.numbers, hits.codes, at, t, codes)
            _nearer_rectangles(table, rays, at, t, codes)
            end(t, codes, at, hits.numbers, hits.codes)

    @kernel
    def of_boxes(boxes: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
        t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
        for at in range(0, n, VECTOR_WIDTH):
            resume(hits.numbers, hits.codes, at, t, codes)
            _nearer_boxes(boxes, rays, at, t, codes)
            end(t, codes, at, hits.numbers, hits.codes)

    @kernel
    def of_triangles(table: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
        for j in range(n):
            if not (any_hit and hits.codes[j] >= 0):
                shear = shear_of(ray_of(rays, j))
                put_hit(hits, j, _nearest_in_table(kind, table, shear, hit_of(hits, j)))

    @kernel
    def of_others(table: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
        for j in range(n):
            if not (any_hit and hits.codes[j] >= 0):
                ray = ray_of(rays, j)
                put_hit(hits, j, _nearest_in_table(kind, table, ray, hit_of(hits, j)))

    by_kind = {
        SPHERE: of_spheres,
        RECTANGLE: of_rectangles,
        BOX: of_boxes,
        TRIANGLE: of_triangles,
    }
    return by_kind.get(kind, of_others)


@by_code(lambda module: _of_block_by(_CODES[module]))
def nearest_of_block(
    shapes: Shapes, kind: int, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool
) -> None:
    """Updates the hits of the first n of `rays` with the shapes of one type.  Hits with types that
    have SIMD kernels are codes (see `_KIND`), which `complete_block` completes."""


def _complete_by(kind: int) -> Callable[..., None] | None:
    """The kernel of `complete_block` for a type of shape with SIMD kernels."""

    @kernel
    def complete(table: Any, rays: RayBlock, hits: HitBlock, n: int) -> None:
        for j in range(n):
            code = hits.codes[j]
            if code >= 0 and code // _KIND == kind:
                i = code % _KIND
                found: Crossing = _found(table, i, ray_of(rays, j), hits.numbers[j])
                put_hit(hits, j, Hit(found.t, kind, i, found.u, found.v, -1))

    @kernel
    def of_spheres(table: Any, rays: RayBlock, hits: HitBlock, n: int) -> None:
        for j in range(n):
            if hits.codes[j] >= 0 and hits.codes[j] < _KIND:
                put_hit(hits, j, Hit(hits.numbers[j], kind, hits.codes[j], 0.0, 0.0, -1))

    if kind == SPHERE:
        return of_spheres
    return complete if kind in (RECTANGLE, BOX) else None


@by_code(lambda module: _complete_by(_CODES[module]))
def complete_block(shapes: Shapes, kind: int, rays: RayBlock, hits: HitBlock, n: int) -> None:
    """Completes the hits with the shapes of one type."""


@kernel
def _nearest_of_rays_linked(
    shapes: Link, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool
) -> None:
    for j in range(min(BLOCK, n + VECTOR_WIDTH - 1)):
        hits.numbers[j], hits.codes[j] = rays.numbers[6 * BLOCK + j], -1
    for kind in (SPHERE, RECTANGLE, BOX):
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)
    if not any_hit:
        for kind in (SPHERE, RECTANGLE, BOX):  # spheres first: their codes are below _KIND
            complete_block(shapes, kind, rays, hits, n)
    for kind in range(TRIANGLE, _KINDS):
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)


@kernel
def _nearest_of_ray_linked(shapes: Link, ray: Ray, hits: HitBlock, j: int) -> Hit:
    return hit_of(hits, j)


def _for(name: str, of_tables: Any, of_link: Any) -> Any:
    choice = ByClass(name)
    choice.register(Shapes, of_tables)
    choice.register(Link, of_link)
    return choice.function


nearest = _for("nearest", _nearest, _nearest_linked)
nearest_of_rays = _for("nearest_of_rays", _nearest_of_rays, _nearest_of_rays_linked)
nearest_of_ray = _for("nearest_of_ray", _nearest_of_ray, _nearest_of_ray_linked)
