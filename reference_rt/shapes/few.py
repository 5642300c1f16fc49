"""A few shapes, without a hierarchy: the nearest of all of them."""

from typing import Any, NamedTuple

from reference_rt.kernel import kernel, local_floats
from reference_rt.ray import Crossing, Hit, Ray, miss
from reference_rt.shapes.dispatch import intersect_row
from reference_rt.shapes.shape import LANES, FloatArray, nearest_lane
from reference_rt.shapes.tables import (
    BOX,
    DISK,
    PLANE,
    POLYGON,
    QUADRIC,
    RECTANGLE,
    SPHERE,
    TORUS,
    TRIANGLE,
    Shapes,
    of_table,
)
from reference_rt.shapes.triangle import Triangles
from reference_rt.shapes.watertight import shear_of


class Packets(NamedTuple):
    """Shapes as `nearest_in_packets` takes them, where no hierarchy leads to them; else None."""

    spheres: FloatArray | None
    rectangles: FloatArray | None
    boxes: FloatArray | None


_lane_distance = of_table("lane_distance", miss)
_found = of_table("found", miss)


@kernel
def _nearest_in_packets(
    kind: int, table: Any, packets: FloatArray | None, ray: Ray, closest: Hit
) -> Hit:
    """The nearest of `closest` and all shapes of a table, LANES of them side by side."""
    if table is None:
        return closest
    if packets is None:
        return closest
    distances = local_floats(LANES)
    best, t = -1, closest.t
    for k in range(len(packets)):
        for lane in range(LANES):
            distances[lane] = _lane_distance(table, packets, k, lane, ray)
        best, t = nearest_lane(distances, k, best, t)
    if best < 0:
        return closest
    found: Crossing = _found(table, best, ray, t)
    return Hit(found.t, kind, best, found.u, found.v, -1)


@kernel
def _nearest_in_table(kind: int, table: Any, ray: Any, closest: Hit) -> Hit:
    """The nearest of `closest` and all primitives of a table, one after another."""
    if table is None:
        return closest
    for i in range(len(table.owner)):
        found: Crossing = intersect_row(table, i, ray)
        if found.t < closest.t:
            closest = Hit(found.t, kind, i, found.u, found.v, -1)
    return closest


@kernel
def nearest(shapes: Shapes, packets: Packets, ray: Ray) -> Hit:
    """The nearest primitive of all; of several at the same t, the first in the order of the codes
    and then of the scene."""
    closest = Hit(ray.t_max, -1, -1, 0.0, 0.0, -1)
    closest = _nearest_in_packets(SPHERE, shapes.spheres, packets.spheres, ray, closest)
    closest = _nearest_in_packets(RECTANGLE, shapes.rectangles, packets.rectangles, ray, closest)
    closest = _nearest_in_packets(BOX, shapes.boxes, packets.boxes, ray, closest)
    closest = _nearest_triangle(shapes.triangles, ray, closest)
    closest = _nearest_in_table(DISK, shapes.disks, ray, closest)
    closest = _nearest_in_table(PLANE, shapes.planes, ray, closest)
    closest = _nearest_in_table(POLYGON, shapes.polygons, ray, closest)
    closest = _nearest_in_table(QUADRIC, shapes.quadrics, ray, closest)
    return _nearest_in_table(TORUS, shapes.tori, ray, closest)


@kernel
def _nearest_triangle(triangles: Triangles | None, ray: Ray, closest: Hit) -> Hit:
    if triangles is None:
        return closest
    return _nearest_in_table(TRIANGLE, triangles, shear_of(ray), closest)
