"""Closest hits by brute force through a link to tables of shapes: an operation for each type."""

from collections.abc import Callable
from typing import Annotated, Any

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import BLOCK, Crossing, Hit, Ray, no_hit
from reference_rt.core.ray_block import HitBlock, RayBlock, hit_of, put_hit, ray_of
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes.brute_force_table import (
    KIND,
    found_at,
    nearer_boxes,
    nearer_rectangles,
    nearer_spheres,
    nearest_in_packets,
    nearest_in_table,
)
from reference_rt.shapes.meshes.watertight import shear_of
from reference_rt.shapes.ray_simd import end, resume
from reference_rt.shapes.tables import (
    BOX,
    RECTANGLE,
    SPHERE,
    TABLES,
    TRIANGLE,
    Shapes,
    by_code,
)

Packed = Annotated[FloatArray, 3]
"""The SoA layout of the shapes of one type: packets (k, columns, VECTOR_WIDTH)."""

_NEARER: dict[int, Callable[..., None]] = {
    SPHERE: nearer_spheres,
    RECTANGLE: nearer_rectangles,
    BOX: nearer_boxes,
}
"""The types with SIMD kernels."""

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

    if kind in _NEARER:
        return of_packets
    return of_triangles if kind == TRIANGLE else of_others


@by_code(_nearest_by)
def nearest_of_type(shapes: Shapes, kind: int, packets: Packed, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and a ray's hit with any shape of one type."""
    return closest


@kernel
def nearest(shapes: Any, packets: Any, ray: Ray) -> Hit:
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
    nearer = _NEARER.get(kind, nearer_spheres)

    @kernel
    def of_rays(table: Any, rays: RayBlock, hits: HitBlock, n: int) -> None:
        t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
        for at in range(0, n, VECTOR_WIDTH):
            resume(hits.numbers, hits.codes, at, t, codes)
            nearer(table, rays, at, t, codes)
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
def nearest_of_rays(shapes: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
    """`brute_force.nearest_of_rays` through a link; it completes the hits too."""
    for j in range(min(BLOCK, n + VECTOR_WIDTH - 1)):
        hits.numbers[j], hits.codes[j] = rays.numbers[6 * BLOCK + j], -1
    for kind in (SPHERE, RECTANGLE, BOX):
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)
    if not any_hit:
        for kind in (SPHERE, RECTANGLE, BOX):  # spheres first: their codes are below KIND
            complete_block(shapes, kind, rays, hits, n)
    for kind in range(TRIANGLE, _KINDS):
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)


@kernel
def nearest_of_ray(shapes: Any, ray: Ray, hits: HitBlock, j: int) -> Hit:
    """`brute_force.nearest_of_ray` through a link."""
    return hit_of(hits, j)
