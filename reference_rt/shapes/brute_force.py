"""Closest hits by brute force, without a BVH: faster for scenes of a few shapes.

Given tables (`Shapes`), all of them are searched in one kernel; given a link to tables, by
operations, one for each type.  SIMD tests VECTOR_WIDTH spheres, rectangles or boxes against one ray
(`nearest_in_packets`), or one shape of a type with the kernel `nearer` against VECTOR_WIDTH rays.
"""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import (
    BLOCK,
    Crossing,
    Hit,
    HitBlock,
    Ray,
    RayBlock,
    hit_of,
    miss,
    no_hit,
    put_hit,
    ray_of,
)
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import ByClass, kernel, local_floats, local_integers
from reference_rt.jit.links import Link
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes.meshes.triangle import Triangles
from reference_rt.shapes.meshes.watertight import shear_of
from reference_rt.shapes.ray_simd import begin, end, resume
from reference_rt.shapes.shape import nearest_lane
from reference_rt.shapes.tables import (
    BOX,
    DISK,
    QUADRIC,
    RECTANGLE,
    SPHERE,
    TABLES,
    TRIANGLE,
    Shapes,
    by_code,
    of_table,
)


class Packets(NamedTuple):
    """The shapes in the SoA layout of `nearest_in_packets`; None for those that are in a BVH."""

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

found_at = of_table("found", _not_found)
"""found_at(table, i, ray, t): the crossing of row i that a SIMD test has found at t."""

_lane_distance = of_table("lane_distance", miss)


@kernel
def nearest_in_packets(
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
    found: Crossing = found_at(table, best, ray, t)
    return Hit(found.t, kind, best, found.u, found.v, -1)


@kernel
def nearest_in_table(kind: int, table: Any, ray: Any, closest: Hit) -> Hit:
    """The nearest of `closest` and all primitives of a table, one at a time."""
    if table is None:
        return closest
    for i in range(len(table.face)):
        found: Crossing = intersect_row(table, i, ray)
        # Of a block's ray, types with SIMD kernels and greater codes are already in `closest`.
        if found.t < closest.t or (found.t == closest.t and kind < closest.kind):
            closest = Hit(found.t, kind, i, found.u, found.v, -1)
    return closest


KIND = 2**40
"""`HitBlock.codes` are kind * KIND + row while types with SIMD kernels are searched."""


def _nearer_by(code: int, module: Any) -> Callable[..., None]:
    """The kernel that tests VECTOR_WIDTH rays, from number `at` on, against all shapes of a type;
    it updates t and codes."""
    nearer, arguments = module.nearer, module.arguments

    @kernel
    def of_table(table: Any, rays: RayBlock, at: int, t: FloatArray, codes: IntArray) -> None:
        for i in range(len(table.face)):
            nearer(rays.numbers, at, arguments(table, i), code * KIND + i, t, codes)

    return of_table


_NEARER = {
    code: _nearer_by(code, module) for code, _, _, module in TABLES if hasattr(module, "nearer")
}
"""The types with SIMD kernels for VECTOR_WIDTH rays."""

_nearer_in_table = ByClass("nearer_in_table")
for _code, _, _table, _ in TABLES:
    if _code in _NEARER:
        _nearer_in_table.register(_table, _NEARER[_code])
_nearer = _nearer_in_table.function

SIDE_BY_SIDE = tuple(_NEARER)
ONE_BY_ONE = tuple(code for code, _, _, _ in TABLES if code not in _NEARER)

Packed = Annotated[FloatArray, 3]
"""The SoA layout of the shapes of one type: packets (k, columns, VECTOR_WIDTH)."""

_CODES = {module: code for code, _, _, module in TABLES}
_KINDS = len(TABLES)


def _nearest_by(module: Any) -> Callable[..., Hit]:
    """The kernel of `nearest_of_type` for a type of shape."""
    kind = _CODES[module]

    @kernel
    def of_packets(table: Any, packets: Packed, ray: Ray, closest: Hit) -> Hit:
        return nearest_in_packets(kind, table, packets, ray, closest)

    @kernel
    def of_triangles(table: Any, ray: Ray, closest: Hit) -> Hit:
        return nearest_in_table(kind, table, shear_of(ray), closest)

    @kernel
    def of_others(table: Any, ray: Ray, closest: Hit) -> Hit:
        return nearest_in_table(kind, table, ray, closest)

    if hasattr(module, "lane_distance"):
        return of_packets
    return of_triangles if kind == TRIANGLE else of_others


@by_code(_nearest_by)
def nearest_of_type(shapes: Shapes, kind: int, packets: Packed, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and a ray's hit with any shape of one type."""
    return closest


@kernel
def _linked_nearest(shapes: Any, packets: Any, ray: Ray) -> Hit:
    """`brute_force.nearest` through a link.  packets: `Packets` without None."""
    closest = no_hit(ray)
    closest = nearest_of_type(shapes, SPHERE, packets.spheres, ray, closest)
    closest = nearest_of_type(shapes, RECTANGLE, packets.rectangles, ray, closest)
    closest = nearest_of_type(shapes, BOX, packets.boxes, ray, closest)
    for kind in range(TRIANGLE, _KINDS):
        closest = nearest_of_type(shapes, kind, packets.boxes, ray, closest)  # packets: not used
    return closest


def _of_block_by(module: Any) -> Callable[..., None]:
    """The kernel of `nearest_of_block` for a type of shape."""
    kind = _CODES[module]

    @kernel
    def of_rays(table: Any, rays: RayBlock, hits: HitBlock, n: int) -> None:
        t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
        for at in range(0, n, VECTOR_WIDTH):
            resume(hits.numbers, hits.codes, at, t, codes)
            _nearer(table, rays, at, t, codes)
            end(t, codes, at, hits.numbers, hits.codes)

    @kernel
    def of_triangles(table: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
        for j in range(n):
            if not (any_hit and hits.codes[j] >= 0):
                shear = shear_of(ray_of(rays, j))
                put_hit(hits, j, nearest_in_table(kind, table, shear, hit_of(hits, j)))

    @kernel
    def of_others(table: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
        for j in range(n):
            if not (any_hit and hits.codes[j] >= 0):
                ray = ray_of(rays, j)
                put_hit(hits, j, nearest_in_table(kind, table, ray, hit_of(hits, j)))

    if kind in _NEARER:
        return of_rays
    return of_triangles if kind == TRIANGLE else of_others


@by_code(_of_block_by)
def nearest_of_block(
    shapes: Shapes, kind: int, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool
) -> None:
    """Updates the hits of the first n of `rays` with the shapes of one type.  Hits with types that
    have SIMD kernels are codes (see `KIND`), which `complete_block` completes."""


def _complete_by(module: Any) -> Callable[..., None] | None:
    """The kernel of `complete_block` for a type of shape with SIMD kernels."""
    kind = _CODES[module]

    @kernel
    def of_spheres(table: Any, hits: HitBlock, n: int) -> None:
        for j in range(n):
            if hits.codes[j] >= 0 and hits.codes[j] < KIND:
                put_hit(hits, j, Hit(hits.numbers[j], kind, hits.codes[j], 0.0, 0.0, -1))

    @kernel
    def of_others(table: Any, rays: RayBlock, hits: HitBlock, n: int) -> None:
        for j in range(n):
            code = hits.codes[j]
            if code >= 0 and code // KIND == kind:
                found: Crossing = found_at(table, code % KIND, ray_of(rays, j), hits.numbers[j])
                put_hit(hits, j, Hit(found.t, kind, code % KIND, found.u, found.v, -1))

    if kind not in _NEARER:
        return None
    return of_spheres if kind == SPHERE else of_others


@by_code(_complete_by)
def complete_block(shapes: Shapes, kind: int, rays: RayBlock, hits: HitBlock, n: int) -> None:
    """Completes the hits with the shapes of one type."""


@kernel
def _linked_nearest_of_rays(
    shapes: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool
) -> None:
    """`brute_force.nearest_of_rays` through a link; it completes the hits too."""
    for j in range(min(BLOCK, n + VECTOR_WIDTH - 1)):
        hits.numbers[j], hits.codes[j] = rays.numbers[6 * BLOCK + j], -1
    for kind in SIDE_BY_SIDE:
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)
    if not any_hit:
        for kind in SIDE_BY_SIDE:  # spheres first: their codes are below KIND
            complete_block(shapes, kind, rays, hits, n)
    for kind in ONE_BY_ONE:
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)


@kernel
def _linked_nearest_of_ray(shapes: Any, ray: Ray, hits: HitBlock, j: int) -> Hit:
    """`brute_force.nearest_of_ray` through a link."""
    return hit_of(hits, j)


@kernel
def _nearest(shapes: Shapes, packets: Packets, ray: Ray) -> Hit:
    """The closest hit of one ray.  Of several at the same t, the first in the order of the codes,
    then of the scene."""
    closest = Hit(ray.t_max, -1, -1, 0.0, 0.0, -1)
    closest = nearest_in_packets(SPHERE, shapes.spheres, packets.spheres, ray, closest)
    closest = nearest_in_packets(RECTANGLE, shapes.rectangles, packets.rectangles, ray, closest)
    closest = nearest_in_packets(BOX, shapes.boxes, packets.boxes, ray, closest)
    closest = _nearest_triangle(shapes.triangles, ray, closest)
    found: Hit = _nearest_without_packets(shapes, ray, closest)
    return found


def _tables_without(*names: str) -> ByCode:
    """The types, without triangles, whose modules have none of these kernels."""
    return ByCode(
        (code, field, module)
        for code, field, _, module in TABLES
        if code != TRIANGLE and not any(hasattr(module, name) for name in names)
    )


_nearest_without_packets = _tables_without("lane_distance").in_turn(nearest_in_table)
_one_by_one = _tables_without("nearer")
_nearest_one_by_one = _one_by_one.in_turn(nearest_in_table)


@kernel
def _nearest_of_others(shapes: Shapes, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and all shapes of types without SIMD kernels."""
    found: Hit = _nearest_one_by_one(shapes, ray, _nearest_triangle(shapes.triangles, ray, closest))
    return found


@kernel
def _yes(kind: int, table: Any, found: bool) -> bool:
    return True


_any_one_by_one = _one_by_one.in_turn(_yes)


@kernel
def _has_others(shapes: Shapes) -> bool:
    """Whether the scene has types of shapes without SIMD kernels: a constant."""
    return bool(_any_one_by_one(shapes, shapes.triangles is not None))


@kernel
def _nearest_triangle(triangles: Triangles | None, ray: Ray, closest: Hit) -> Hit:
    if triangles is None:
        return closest
    return nearest_in_table(TRIANGLE, triangles, shear_of(ray), closest)


@kernel
def _step(
    kind: int, table: Any, rays: RayBlock, at: int, t: FloatArray, codes: IntArray, done: bool
) -> bool:
    _nearer(table, rays, at, t, codes)
    return done


_nearer_in_tables = ByCode(
    (code, field, module) for code, field, _, module in TABLES if code in _NEARER
).in_turn(_step)


@kernel
def _nearest_of_rays(shapes: Shapes, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
    """Test the first n of `rays`, VECTOR_WIDTH at a time, against the types with SIMD kernels;
    writes `hits`, which `nearest_of_ray` completes.  any_hit: against all types, and the result is
    only whether a ray hits anything, which is the sign of its code."""
    t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
    for at in range(0, n, VECTOR_WIDTH):
        begin(rays.numbers, at, t, codes)
        _nearer_in_tables(shapes, rays, at, t, codes, True)
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
    kind, i = code // KIND, code % KIND
    if (
        shapes.rectangles is None
        and shapes.boxes is None
        and shapes.disks is None
        and shapes.quadrics is None
    ):
        kind = SPHERE  # a constant, so that the branches below vanish
    found = Crossing(t, 0.0, 0.0)
    if kind == RECTANGLE:
        found = found_at(shapes.rectangles, i, ray, t)
    elif kind == BOX:
        found = found_at(shapes.boxes, i, ray, t)
    elif kind == DISK:
        found = found_at(shapes.disks, i, ray, t)
    elif kind == QUADRIC:
        found = found_at(shapes.quadrics, i, ray, t)
    return Hit(found.t, kind, i, found.u, found.v, -1)


def _for(name: str, of_tables: Any, of_link: Any) -> Any:
    choice = ByClass(name)
    choice.register(Shapes, of_tables)
    choice.register(Link, of_link)
    return choice.function


nearest = _for("nearest", _nearest, _linked_nearest)
nearest_of_rays = _for("nearest_of_rays", _nearest_of_rays, _linked_nearest_of_rays)
nearest_of_ray = _for("nearest_of_ray", _nearest_of_ray, _linked_nearest_of_ray)
