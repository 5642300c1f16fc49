"""A ray, or VECTOR_WIDTH rays, against all shapes of one table.

Spheres, rectangles and boxes are tested with SIMD: VECTOR_WIDTH shapes against one ray
(`nearest_in_packets`), or one shape against VECTOR_WIDTH rays (`nearer_spheres`, ...).
"""

from typing import Any, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Crossing, Hit, Ray, miss
from reference_rt.core.ray_block import RayBlock
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import kernel, local_floats
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes import box
from reference_rt.shapes.box import Boxes
from reference_rt.shapes.curved import sphere
from reference_rt.shapes.curved.sphere import Spheres
from reference_rt.shapes.flat import rectangle
from reference_rt.shapes.flat.rectangle import Rectangles
from reference_rt.shapes.shape import nearest_lane
from reference_rt.shapes.tables import BOX, RECTANGLE, SPHERE, of_table


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
    for i in range(len(table.owner)):
        found: Crossing = intersect_row(table, i, ray)
        if found.t < closest.t:
            closest = Hit(found.t, kind, i, found.u, found.v, -1)
    return closest


KIND = 2**40
"""`HitBlock.codes` are kind * KIND + row while types with SIMD kernels are searched."""


@kernel
def nearer_spheres(
    spheres: Spheres | None, rays: RayBlock, at: int, t: FloatArray, codes: IntArray
) -> None:
    """VECTOR_WIDTH rays, from number `at` on, against all spheres; updates t and codes."""
    if spheres is not None:
        for i in range(len(spheres.owner)):
            shape = (row(spheres.center, i), spheres.radius[i])
            sphere.nearer(rays.numbers, at, shape, SPHERE * KIND + i, t, codes)


@kernel
def nearer_rectangles(
    table: Rectangles | None, rays: RayBlock, at: int, t: FloatArray, codes: IntArray
) -> None:
    """The same for rectangles."""
    if table is not None:
        for i in range(len(table.owner)):
            place = (row(table.center, i), row(table.normal, i))
            shape = (*place, row(table.x_of, i), row(table.y_of, i))
            rectangle.nearer(rays.numbers, at, shape, RECTANGLE * KIND + i, t, codes)


@kernel
def nearer_boxes(
    boxes: Boxes | None, rays: RayBlock, at: int, t: FloatArray, codes: IntArray
) -> None:
    """The same for boxes."""
    if boxes is not None:
        for i in range(len(boxes.owner)):
            box.nearer(rays.numbers, at, box.arguments(boxes, i), BOX * KIND + i, t, codes)
