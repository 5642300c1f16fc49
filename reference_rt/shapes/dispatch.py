"""The choice among the shapes: what each kernel of theirs does, by the code of a hit's kind.

A kernel that a shape lacks (only solids have `spans`, only lights `sample` and `pdf`), and every
kernel of a table that the scene lacks, is replaced by the one that finds nothing, at compile time.
"""

from typing import Any

from reference_rt.core.ray import Crossing, Hit, Ray, SurfacePoint, miss
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.meshes.watertight import Shear
from reference_rt.shapes.shape import LightPoint, Spans, Tangents, no_light_point, no_spans
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
def _no_tangents(table: Any, ray: Ray, hit: Hit) -> Tangents:
    nothing = Vec3(0.0, 0.0, 0.0)
    return Tangents(nothing, nothing)


@kernel
def _first_face(table: Any, hit: Hit) -> int:
    return 0


@kernel
def _no_sample(table: Any, i: int, area: float, p: Vec3, u0: float, u1: float) -> LightPoint:
    return no_light_point()


@kernel
def _no_middle(table: Any, i: int, area: float, p: Vec3) -> LightPoint:
    return no_light_point()


@kernel
def _no_pdf(table: Any, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    return 0.0


@kernel
def _no_spans(table: Any, i: int, ray: Ray) -> Spans:
    return no_spans()


intersect_row = of_table("intersect", _no_crossing)
_surface = of_table("surface", _no_surface)
_uv = of_table("uv", _no_uv)
_tangents = of_table("tangents", _no_tangents)
_face = of_table("face_of", _first_face)
_sample = of_table("sample", _no_sample)
_middle = of_table("middle", _no_middle)
_pdf = of_table("pdf", _no_pdf)
_spans = of_table("spans", _no_spans)


@kernel
def intersect(shapes: Shapes, kind: int, i: int, ray: Ray, shear: Shear) -> Crossing:
    """Where the ray meets one primitive first, beyond t = 0."""
    found: Crossing = miss()
    if kind == TRIANGLE:
        found = intersect_row(shapes.triangles, i, shear)
    elif kind == SPHERE:
        found = intersect_row(shapes.spheres, i, ray)
    elif kind == RECTANGLE:
        found = intersect_row(shapes.rectangles, i, ray)
    elif kind == BOX:
        found = intersect_row(shapes.boxes, i, ray)
    elif kind == DISK:
        found = intersect_row(shapes.disks, i, ray)
    elif kind == PLANE:
        found = intersect_row(shapes.planes, i, ray)
    elif kind == POLYGON:
        found = intersect_row(shapes.polygons, i, ray)
    elif kind == QUADRIC:
        found = intersect_row(shapes.quadrics, i, ray)
    elif kind == TORUS:
        found = intersect_row(shapes.tori, i, ray)
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
def tangents(shapes: Shapes, ray: Ray, hit: Hit) -> Tangents:
    """dp/du and dp/dv at a hit."""
    if hit.kind == SPHERE:
        found: Tangents = _tangents(shapes.spheres, ray, hit)
    elif hit.kind == RECTANGLE:
        found = _tangents(shapes.rectangles, ray, hit)
    elif hit.kind == BOX:
        found = _tangents(shapes.boxes, ray, hit)
    elif hit.kind == DISK:
        found = _tangents(shapes.disks, ray, hit)
    elif hit.kind == PLANE:
        found = _tangents(shapes.planes, ray, hit)
    elif hit.kind == POLYGON:
        found = _tangents(shapes.polygons, ray, hit)
    elif hit.kind == QUADRIC:
        found = _tangents(shapes.quadrics, ray, hit)
    elif hit.kind == TORUS:
        found = _tangents(shapes.tori, ray, hit)
    else:
        found = _tangents(shapes.triangles, ray, hit)
    return found


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
def middle(shapes: Shapes, kind: int, i: int, area: float, p: Vec3) -> LightPoint:
    """The one point of a primitive that stands for all of it: that of the middle of `sample`'s
    numbers, but of a rectangle, wherever it is seen from, its own middle."""
    if kind == RECTANGLE:
        point: LightPoint = _middle(shapes.rectangles, i, area, p)
        return point
    return sample(shapes, kind, i, area, p, 0.5, 0.5)


@kernel
def pdf(shapes: Shapes, kind: int, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle with which `sample` picks, from `p`, the point `q`."""
    density = 0.0
    if kind == SPHERE:
        density = _pdf(shapes.spheres, i, area, p, q)
    elif kind == RECTANGLE:
        density = _pdf(shapes.rectangles, i, area, p, q)
    elif kind == BOX:
        density = _pdf(shapes.boxes, i, area, p, q)
    elif kind == DISK:
        density = _pdf(shapes.disks, i, area, p, q)
    elif kind == TRIANGLE:
        density = _pdf(shapes.triangles, i, area, p, q)
    return density
