"""All shapes: one file each; here, the choice among them.

To add a shape: its file with description, table and kernels; a code in `shape.py`; below, a field
of `Shapes`, a line in `TABLES`, `AnyShape`, and one `if` in each dispatcher; a translator function
in `comparisons.translate`; a scene; a row in the tests' tuple.
"""

from typing import Annotated, Any, NamedTuple

from pydantic import Field

from reference_rt.kernel import ByClass, kernel, local_floats
from reference_rt.ray import Hit, Ray, SurfacePoint
from reference_rt.shapes import box, rectangle, sphere, triangle
from reference_rt.shapes.box import Box, Boxes
from reference_rt.shapes.mesh import Mesh
from reference_rt.shapes.rectangle import Rectangle, Rectangles
from reference_rt.shapes.shape import (
    BOX,
    LANES,
    RECTANGLE,
    SPHERE,
    TRIANGLE,
    FloatArray,
    IntArray,
    LightPoint,
    nearest_lane,
    no_light_point,
    solid_angle_pdf,
)
from reference_rt.shapes.sphere import Sphere, Spheres
from reference_rt.shapes.triangle import Shear, Triangle, Triangles
from reference_rt.vec3 import Vec3

AnyShape = Annotated[Sphere | Rectangle | Triangle | Box | Mesh, Field(discriminator="type")]


class Shapes(NamedTuple):
    """Every primitive of a scene; None for a table that the scene does not have."""

    spheres: Spheres | None
    rectangles: Rectangles | None
    boxes: Boxes | None
    triangles: Triangles | None


TABLES: tuple[tuple[int, str, type, Any], ...] = (
    (SPHERE, "spheres", Spheres, sphere),
    (RECTANGLE, "rectangles", Rectangles, rectangle),
    (BOX, "boxes", Boxes, box),
    (TRIANGLE, "triangles", Triangles, triangle),
)
"""(code, field of Shapes, table, module with `bounds` and `areas`), in the order of the codes."""

# Shapes that are tested side by side where there is no hierarchy; triangles come in meshes.
_lane_distance, _found = ByClass("lane_distance"), ByClass("found")
for _table, _module in ((Spheres, sphere), (Rectangles, rectangle), (Boxes, box)):
    _lane_distance.register(_table, _module.lane_distance)
    _found.register(_table, _module.found)
lane_distance, found = _lane_distance.function, _found.function


@kernel
def nearest_of(table: Any, packets: FloatArray | None, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and all shapes of a table, from their packets."""
    if table is None:
        return closest
    if packets is None:
        return closest
    distances = local_floats(LANES)
    best, t = -1, closest.t
    for k in range(len(packets)):
        for lane in range(LANES):
            distances[lane] = lane_distance(table, packets, k, lane, ray)
        best, t = nearest_lane(distances, k, best, t)
    if best < 0:
        return closest
    nearest: Hit = found(table, best, ray, t)
    return nearest


@kernel
def intersect(shapes: Shapes, kind: int, i: int, ray: Ray, shear: Shear, closest: Hit) -> Hit:
    """The nearer of `closest` and one primitive."""
    return _intersect(
        shapes.spheres,
        shapes.rectangles,
        shapes.boxes,
        shapes.triangles,
        kind,
        i,
        ray,
        shear,
        closest,
    )


# Numba removes an absent table's branch only where the table itself is the argument.
@kernel
def _intersect(
    spheres: Spheres | None,
    rectangles: Rectangles | None,
    boxes: Boxes | None,
    triangles: Triangles | None,
    kind: int,
    i: int,
    ray: Ray,
    shear: Shear,
    closest: Hit,
) -> Hit:
    if triangles is not None:
        if kind == TRIANGLE:
            return triangle.intersect(triangles, i, shear, closest)
    if spheres is not None:
        if kind == SPHERE:
            return sphere.intersect(spheres, i, ray, closest)
    if rectangles is not None:
        if kind == RECTANGLE:
            return rectangle.intersect(rectangles, i, ray, closest)
    if boxes is not None:
        if kind == BOX:
            return box.intersect(boxes, i, ray, closest)
    return closest


@kernel
def surface(shapes: Shapes, ray: Ray, hit: Hit) -> SurfacePoint:
    """The surface at a hit (which must be one: `hit.kind >= 0`)."""
    return _surface(shapes.spheres, shapes.rectangles, shapes.boxes, shapes.triangles, ray, hit)


@kernel
def _surface(
    spheres: Spheres | None,
    rectangles: Rectangles | None,
    boxes: Boxes | None,
    triangles: Triangles | None,
    ray: Ray,
    hit: Hit,
) -> SurfacePoint:
    if spheres is not None:
        if hit.kind == SPHERE:
            return sphere.surface(spheres, ray, hit)
    if rectangles is not None:
        if hit.kind == RECTANGLE:
            return rectangle.surface(rectangles, hit)
    if boxes is not None:
        if hit.kind == BOX:
            return box.surface(boxes, ray, hit)
    if triangles is not None:
        if hit.kind == TRIANGLE:
            return triangle.surface(triangles, hit)
    nothing = Vec3(0.0, 0.0, 0.0)
    return SurfacePoint(nothing, nothing, nothing, 0.0, -1, -1)


class Owner(NamedTuple):
    """Whose primitive it is: index of the shape in the scene, number of the face within it, and
    the surface coordinates u, v."""

    shape: int
    face: int
    u: float
    v: float


@kernel
def owner(shapes: Shapes, ray: Ray, hit: Hit) -> Owner:
    """Shape, face and uv of a hit: for pictures and queries, which path tracing does not need."""
    return _owner(shapes.spheres, shapes.rectangles, shapes.boxes, shapes.triangles, ray, hit)


@kernel
def _owner(
    spheres: Spheres | None,
    rectangles: Rectangles | None,
    boxes: Boxes | None,
    triangles: Triangles | None,
    ray: Ray,
    hit: Hit,
) -> Owner:
    if spheres is not None:
        if hit.kind == SPHERE:
            u, v = sphere.uv(spheres, ray, hit)
            return Owner(spheres.owner[hit.row], 0, u, v)
    if rectangles is not None:
        if hit.kind == RECTANGLE:
            u, v = rectangle.uv(hit)
            return Owner(rectangles.owner[hit.row], 0, u, v)
    if boxes is not None:
        if hit.kind == BOX:
            u, v = box.uv(boxes, ray, hit)
            return Owner(boxes.owner[hit.row], int(hit.u), u, v)
    if triangles is not None:
        if hit.kind == TRIANGLE:
            return Owner(triangles.owner[hit.row], triangles.face[hit.row], hit.u, hit.v)
    return Owner(-1, -1, 0.0, 0.0)


@kernel
def sample(
    shapes: Shapes, kind: int, i: int, area: float, p: Vec3, u0: float, u1: float
) -> LightPoint:
    """A point of one primitive as a light for `p`; its density is what `pdf` returns."""
    return _sample(
        shapes.spheres, shapes.rectangles, shapes.boxes, shapes.triangles, kind, i, area, p, u0, u1
    )


@kernel
def _sample(
    spheres: Spheres | None,
    rectangles: Rectangles | None,
    boxes: Boxes | None,
    triangles: Triangles | None,
    kind: int,
    i: int,
    area: float,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightPoint:
    if spheres is not None:
        if kind == SPHERE:
            return sphere.sample(spheres, i, p, u0, u1)
    if rectangles is not None:
        if kind == RECTANGLE:
            return rectangle.sample(rectangles, i, area, p, u0, u1)
    if boxes is not None:
        if kind == BOX:
            return box.sample(boxes, i, area, p, u0, u1)
    if triangles is not None:
        if kind == TRIANGLE:
            return triangle.sample(triangles, i, area, p, u0, u1)
    return no_light_point()


@kernel
def pdf(spheres: Spheres | None, kind: int, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle with which `sample` picks, from `p`, the point `q`."""
    if spheres is not None:
        if kind == SPHERE:
            return sphere.pdf(spheres, i, p)
    return solid_angle_pdf(p, q.p, q.n, area)


__all__ = [
    "BOX",
    "RECTANGLE",
    "SPHERE",
    "TABLES",
    "TRIANGLE",
    "AnyShape",
    "Box",
    "IntArray",
    "Mesh",
    "Owner",
    "Rectangle",
    "Shapes",
    "Sphere",
    "Triangle",
    "intersect",
    "nearest_of",
    "owner",
    "pdf",
    "sample",
    "surface",
]
