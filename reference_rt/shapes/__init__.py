"""All shapes: one file each; here, the choice among them.

To add a shape: its file with description, table and kernels; below, a code, a field of `Shapes`, a
line in `TABLES`, a member of `Primitive` and one `if` in each dispatcher; a translator function in
`comparisons.translate`; a scene; a row in the tests' tuple.

A kernel that a shape lacks (only solids have `spans`, only lights `sample` and `pdf`), and every
kernel of a table that the scene lacks, is replaced by the one that finds nothing, at compile time.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from reference_rt.kernel import ByClass, kernel, local_floats
from reference_rt.ray import Crossing, Hit, Ray, SurfacePoint, miss
from reference_rt.shapes import (
    box,
    disk,
    plane,
    polygon,
    quadric,
    rectangle,
    sphere,
    torus,
    triangle,
)
from reference_rt.shapes.box import Box, Boxes
from reference_rt.shapes.cone import Cone
from reference_rt.shapes.cylinder import Cylinder
from reference_rt.shapes.disk import Disk, Disks
from reference_rt.shapes.mesh import Mesh
from reference_rt.shapes.plane import Plane, Planes
from reference_rt.shapes.polygon import Polygon, Polygons
from reference_rt.shapes.quadric import Quadric, Quadrics
from reference_rt.shapes.rectangle import Rectangle, Rectangles
from reference_rt.shapes.shape import (
    LANES,
    FloatArray,
    IntArray,
    LightPoint,
    Shape,
    Spans,
    nearest_lane,
    no_light_point,
    no_spans,
    solid_angle_pdf,
)
from reference_rt.shapes.sphere import Sphere, Spheres
from reference_rt.shapes.torus import Tori, Torus
from reference_rt.shapes.triangle import Triangle, Triangles
from reference_rt.shapes.watertight import Shear, shear_of
from reference_rt.vec3 import Vec3

# Codes of `Hit.kind`: which table a primitive is a row of.
SPHERE, RECTANGLE, BOX, TRIANGLE, DISK, PLANE, POLYGON, QUADRIC, TORUS = range(9)

Primitive = (
    Sphere
    | Rectangle
    | Triangle
    | Box
    | Mesh
    | Disk
    | Plane
    | Polygon
    | Quadric
    | Cylinder
    | Cone
    | Torus
)
"""The descriptions that are primitives by themselves; `reference_rt.csg` adds what is made of them.
"""


class Shapes(NamedTuple):
    """Every primitive of a scene; None for a table that the scene does not have."""

    spheres: Spheres | None
    rectangles: Rectangles | None
    boxes: Boxes | None
    triangles: Triangles | None
    disks: Disks | None
    planes: Planes | None
    polygons: Polygons | None
    quadrics: Quadrics | None
    tori: Tori | None


TABLES: tuple[tuple[int, str, type, Any], ...] = (
    (SPHERE, "spheres", Spheres, sphere),
    (RECTANGLE, "rectangles", Rectangles, rectangle),
    (BOX, "boxes", Boxes, box),
    (TRIANGLE, "triangles", Triangles, triangle),
    (DISK, "disks", Disks, disk),
    (PLANE, "planes", Planes, plane),
    (POLYGON, "polygons", Polygons, polygon),
    (QUADRIC, "quadrics", Quadrics, quadric),
    (TORUS, "tori", Tori, torus),
)
"""(code, field of Shapes, table, module with its kernels), in the order of the codes."""


def _of_table(name: str, without: Callable[..., Any]) -> Callable[..., Any]:
    """The kernel `name` of the module of the table that is the first argument."""
    choice = ByClass(name)
    choice.register(type(None), without)
    for _, _, table, module in TABLES:
        choice.register(table, getattr(module, name, without))
    return choice.function


@kernel
def _no_crossing(table: Any, i: int, ray: Any) -> Crossing:
    return miss()


@kernel
def _no_surface(table: Any, ray: Ray, hit: Hit) -> SurfacePoint:
    nothing = Vec3(0.0, 0.0, 0.0)
    return SurfacePoint(nothing, nothing, nothing, 0.0, -1, -1)


@kernel
def _no_uv(table: Any, ray: Ray, hit: Hit) -> tuple[float, float]:
    return 0.0, 0.0


@kernel
def _first_face(table: Any, hit: Hit) -> int:
    return 0


@kernel
def _no_sample(table: Any, i: int, area: float, p: Vec3, u0: float, u1: float) -> LightPoint:
    return no_light_point()


@kernel
def _pdf_by_area(table: Any, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    return solid_angle_pdf(p, q.p, q.n, area)


@kernel
def _no_spans(table: Any, i: int, ray: Ray) -> Spans:
    return no_spans()


_intersect = _of_table("intersect", _no_crossing)
_surface = _of_table("surface", _no_surface)
_uv = _of_table("uv", _no_uv)
_face = _of_table("face_of", _first_face)
_sample = _of_table("sample", _no_sample)
_pdf = _of_table("pdf", _pdf_by_area)
_spans = _of_table("spans", _no_spans)


@kernel
def intersect(shapes: Shapes, kind: int, i: int, ray: Ray, shear: Shear) -> Crossing:
    """Where the ray meets one primitive first, beyond t = 0."""
    found: Crossing = miss()
    if kind == TRIANGLE:
        found = _intersect(shapes.triangles, i, shear)
    elif kind == SPHERE:
        found = _intersect(shapes.spheres, i, ray)
    elif kind == RECTANGLE:
        found = _intersect(shapes.rectangles, i, ray)
    elif kind == BOX:
        found = _intersect(shapes.boxes, i, ray)
    elif kind == DISK:
        found = _intersect(shapes.disks, i, ray)
    elif kind == PLANE:
        found = _intersect(shapes.planes, i, ray)
    elif kind == POLYGON:
        found = _intersect(shapes.polygons, i, ray)
    elif kind == QUADRIC:
        found = _intersect(shapes.quadrics, i, ray)
    elif kind == TORUS:
        found = _intersect(shapes.tori, i, ray)
    return found


@kernel
def surface(shapes: Shapes, ray: Ray, hit: Hit) -> SurfacePoint:
    """The surface at a hit of a primitive."""
    if hit.kind == SPHERE:
        point: SurfacePoint = _surface(shapes.spheres, ray, hit)
    elif hit.kind == RECTANGLE:
        point = _surface(shapes.rectangles, ray, hit)
    elif hit.kind == BOX:
        point = _surface(shapes.boxes, ray, hit)
    elif hit.kind == DISK:
        point = _surface(shapes.disks, ray, hit)
    elif hit.kind == PLANE:
        point = _surface(shapes.planes, ray, hit)
    elif hit.kind == POLYGON:
        point = _surface(shapes.polygons, ray, hit)
    elif hit.kind == QUADRIC:
        point = _surface(shapes.quadrics, ray, hit)
    elif hit.kind == TORUS:
        point = _surface(shapes.tori, ray, hit)
    else:
        point = _surface(shapes.triangles, ray, hit)
    return point


@kernel
def uv(shapes: Shapes, ray: Ray, hit: Hit) -> tuple[float, float]:
    """The surface coordinates at a hit."""
    if hit.kind == SPHERE:
        coordinates: tuple[float, float] = _uv(shapes.spheres, ray, hit)
    elif hit.kind == RECTANGLE:
        coordinates = _uv(shapes.rectangles, ray, hit)
    elif hit.kind == BOX:
        coordinates = _uv(shapes.boxes, ray, hit)
    elif hit.kind == DISK:
        coordinates = _uv(shapes.disks, ray, hit)
    elif hit.kind == PLANE:
        coordinates = _uv(shapes.planes, ray, hit)
    elif hit.kind == POLYGON:
        coordinates = _uv(shapes.polygons, ray, hit)
    elif hit.kind == QUADRIC:
        coordinates = _uv(shapes.quadrics, ray, hit)
    elif hit.kind == TORUS:
        coordinates = _uv(shapes.tori, ray, hit)
    else:
        coordinates = _uv(shapes.triangles, ray, hit)
    return coordinates


@kernel
def face(shapes: Shapes, hit: Hit) -> int:
    """The number of the face that was hit, within its shape."""
    number = 0
    if hit.kind == SPHERE:
        number = _face(shapes.spheres, hit)
    elif hit.kind == RECTANGLE:
        number = _face(shapes.rectangles, hit)
    elif hit.kind == BOX:
        number = _face(shapes.boxes, hit)
    elif hit.kind == TRIANGLE:
        number = _face(shapes.triangles, hit)
    elif hit.kind == QUADRIC:
        number = _face(shapes.quadrics, hit)
    return number


@kernel
def _owner_in(table: Any, i: int) -> int:
    if table is None:
        return -1
    return int(table.owner[i])


@kernel
def owner(shapes: Shapes, kind: int, i: int) -> int:
    """Index of the shape, in the scene or in its group, that a primitive belongs to."""
    index = -1
    if kind == SPHERE:
        index = _owner_in(shapes.spheres, i)
    elif kind == RECTANGLE:
        index = _owner_in(shapes.rectangles, i)
    elif kind == BOX:
        index = _owner_in(shapes.boxes, i)
    elif kind == TRIANGLE:
        index = _owner_in(shapes.triangles, i)
    elif kind == DISK:
        index = _owner_in(shapes.disks, i)
    elif kind == PLANE:
        index = _owner_in(shapes.planes, i)
    elif kind == POLYGON:
        index = _owner_in(shapes.polygons, i)
    elif kind == QUADRIC:
        index = _owner_in(shapes.quadrics, i)
    elif kind == TORUS:
        index = _owner_in(shapes.tori, i)
    return index


@kernel
def spans(shapes: Shapes, kind: int, i: int, ray: Ray) -> Spans:
    """Where the line of the ray runs inside one solid."""
    found: Spans = no_spans()
    if kind == SPHERE:
        found = _spans(shapes.spheres, i, ray)
    elif kind == BOX:
        found = _spans(shapes.boxes, i, ray)
    elif kind == PLANE:
        found = _spans(shapes.planes, i, ray)
    elif kind == QUADRIC:
        found = _spans(shapes.quadrics, i, ray)
    elif kind == TORUS:
        found = _spans(shapes.tori, i, ray)
    return found


@kernel
def sample(
    shapes: Shapes, kind: int, i: int, area: float, p: Vec3, u0: float, u1: float
) -> LightPoint:
    """A point of one primitive as a light for `p`; its density is what `pdf` returns."""
    if kind == SPHERE:
        point: LightPoint = _sample(shapes.spheres, i, area, p, u0, u1)
    elif kind == RECTANGLE:
        point = _sample(shapes.rectangles, i, area, p, u0, u1)
    elif kind == BOX:
        point = _sample(shapes.boxes, i, area, p, u0, u1)
    elif kind == DISK:
        point = _sample(shapes.disks, i, area, p, u0, u1)
    else:
        point = _sample(shapes.triangles, i, area, p, u0, u1)
    return point


@kernel
def pdf(shapes: Shapes, kind: int, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle with which `sample` picks, from `p`, the point `q`."""
    if kind == SPHERE:
        return float(_pdf(shapes.spheres, i, area, p, q))
    return solid_angle_pdf(p, q.p, q.n, area)


# ---- a few shapes, without a hierarchy ----------------------------------------------------------


class Packets(NamedTuple):
    """Shapes as `nearest_in_packets` takes them, where no hierarchy leads to them; else None."""

    spheres: FloatArray | None
    rectangles: FloatArray | None
    boxes: FloatArray | None


_lane_distance = _of_table("lane_distance", miss)
_found = _of_table("found", miss)


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
        found: Crossing = _intersect(table, i, ray)
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


__all__ = [
    "BOX",
    "DISK",
    "PLANE",
    "POLYGON",
    "QUADRIC",
    "RECTANGLE",
    "SPHERE",
    "TABLES",
    "TORUS",
    "TRIANGLE",
    "Box",
    "Cone",
    "Cylinder",
    "Disk",
    "IntArray",
    "Mesh",
    "Packets",
    "Plane",
    "Polygon",
    "Primitive",
    "Quadric",
    "Rectangle",
    "Shape",
    "Shapes",
    "Sphere",
    "Torus",
    "Triangle",
    "face",
    "intersect",
    "nearest",
    "owner",
    "pdf",
    "sample",
    "spans",
    "surface",
    "uv",
]
