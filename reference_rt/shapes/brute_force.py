"""Closest hits by brute force, without a BVH: faster for scenes of a few shapes.

Given tables (`Shapes`), all of them are searched in one kernel; given a link to tables, by
operations, one for each type (`brute_force_linked.py`).  `brute_force_table.py` has what both do
with one table.
"""

from typing import Any

from reference_rt.core.ray import Crossing, Hit, Ray, no_hit
from reference_rt.core.ray_block import HitBlock, RayBlock, ray_of
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import ByClass, kernel, local_floats, local_integers
from reference_rt.jit.links import Link
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes import brute_force_linked as linked
from reference_rt.shapes.brute_force_table import (
    KIND,
    Packets,
    found_at,
    nearer_boxes,
    nearer_rectangles,
    nearer_spheres,
    nearest_in_packets,
    nearest_in_table,
)
from reference_rt.shapes.meshes.triangle import Triangles
from reference_rt.shapes.meshes.watertight import shear_of
from reference_rt.shapes.ray_simd import begin, end
from reference_rt.shapes.tables import (
    BOX,
    RECTANGLE,
    SPHERE,
    TABLES,
    TRIANGLE,
    Shapes,
)


@kernel
def _nearest(shapes: Shapes, packets: Packets, ray: Ray) -> Hit:
    """The closest hit of one ray.  Of several at the same t, the first in the order of the codes,
    then of the scene."""
    closest = Hit(ray.t_max, -1, -1, 0.0, 0.0, -1)
    closest = nearest_in_packets(SPHERE, shapes.spheres, packets.spheres, ray, closest)
    closest = nearest_in_packets(RECTANGLE, shapes.rectangles, packets.rectangles, ray, closest)
    closest = nearest_in_packets(BOX, shapes.boxes, packets.boxes, ray, closest)
    return _nearest_of_others(shapes, ray, closest)


_without_packets = ByCode(
    (code, field, module)
    for code, field, _, module in TABLES
    if code != TRIANGLE and not hasattr(module, "lane_distance")
)
_nearest_in_tables = _without_packets.in_turn(nearest_in_table)


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
    return nearest_in_table(TRIANGLE, triangles, shear_of(ray), closest)


@kernel
def _nearest_of_rays(shapes: Shapes, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
    """Test the first n of `rays`, VECTOR_WIDTH at a time, against the types with SIMD kernels;
    writes `hits`, which `nearest_of_ray` completes.  any_hit: against all types, and the result is
    only whether a ray hits anything, which is the sign of its code."""
    t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
    for at in range(0, n, VECTOR_WIDTH):
        begin(rays.numbers, at, t, codes)
        nearer_spheres(shapes.spheres, rays, at, t, codes)
        nearer_rectangles(shapes.rectangles, rays, at, t, codes)
        nearer_boxes(shapes.boxes, rays, at, t, codes)
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
    if shapes.rectangles is None and shapes.boxes is None:
        kind = SPHERE  # a constant, so that the branches below vanish
    found = Crossing(t, 0.0, 0.0)
    if kind == RECTANGLE:
        found = found_at(shapes.rectangles, i, ray, t)
    elif kind == BOX:
        found = found_at(shapes.boxes, i, ray, t)
    return Hit(found.t, kind, i, found.u, found.v, -1)


def _for(name: str, of_tables: Any, of_link: Any) -> Any:
    choice = ByClass(name)
    choice.register(Shapes, of_tables)
    choice.register(Link, of_link)
    return choice.function


nearest = _for("nearest", _nearest, linked.nearest)
nearest_of_rays = _for("nearest_of_rays", _nearest_of_rays, linked.nearest_of_rays)
nearest_of_ray = _for("nearest_of_ray", _nearest_of_ray, linked.nearest_of_ray)
