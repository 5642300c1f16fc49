"""Triangle: three vertices, watertight along shared edges."""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Examples, Vector
from reference_rt.core.ray import (
    UNIT_ROUNDOFF,
    Crossing,
    Hit,
    Ray,
    SurfacePoint,
    miss,
    surface_error,
)
from reference_rt.core.vec3 import Vec3, cross, dot, max_abs, normalize, row, triple
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.meshes.triangle_table import (
    RAGGED,
    Triangles,
    align,
    areas,
    bounds,
    extent,
    facing,
    table_of,
    unit_normals,
)
from reference_rt.shapes.meshes.watertight import (
    Projection,
    Shear,
    exact_edge_function,
    load_projection,
    project,
)
from reference_rt.shapes.shape import (
    LightPoint,
    Shape,
    TabulationContext,
    Tangents,
    any_tangents,
    in_column,
    lift,
    solid_angle_pdf,
)


class Triangle(Shape):
    """A triangle; its normal is (v1 - v0) x (v2 - v0).  Under a transform that mirrors space its
    front stays its front."""

    EXAMPLES: ClassVar[Examples] = ({"v0": (0, 0, 0), "v1": (1, 0, 0), "v2": (0, 1, 0)},)
    type: Literal["triangle"] = "triangle"
    v0: Vector
    """The first vertex [x, y, z], before the transform, in scene units."""
    v1: Vector
    """The second vertex, counter-clockwise seen from the front."""
    v2: Vector
    """The third vertex."""

    def tabulate(self, context: TabulationContext) -> "Triangles":
        m = self.map_in(context)
        vertices = transform.apply_points(m, np.array([self.v0, self.v1, self.v2]))
        triangles = facing(m, table_of(vertices, np.arange(3)[None], context))
        if areas(triangles)[0] == 0.0:
            raise ValueError("the triangle has no area; expected three points not on a line")
        return triangles


@kernel
def intersect(triangles: Triangles, i: int, shear: Shear) -> Crossing:
    """Where the ray meets triangle i; u, v are the barycentrics of v1 and v2."""
    return _crossing(project(triangles.points, triangles.corners, i, shear), shear)


@kernel
def intersect_lane(
    corners: FloatArray, first: int, size: int, lane: int, shear: Shear, seen: FloatArray
) -> Crossing:
    """`intersect` for a triangle of a BVH leaf, see `watertight.project_leaf`."""
    return _crossing(load_projection(corners, first, size, lane, shear, seen), shear)


@kernel
def _crossing(seen: Projection, shear: Shear) -> Crossing:
    found = on_line(seen, shear)
    return found if found.t > 0.0 else miss()


@kernel
def on_line(seen: Projection, shear: Shear) -> Crossing:
    """Where the line of the ray crosses a triangle, at t of any sign."""
    if seen.side == 0:
        return miss()
    inverse = 1.0 / (seen.e0 + seen.e1 + seen.e2)
    u, v = seen.e1 * inverse, seen.e2 * inverse
    # From sizes of 1e102 on edge functions times depths would overflow; barycentrics do not.
    t = (seen.e0 * inverse * seen.a_z + u * seen.b_z + v * seen.c_z) * shear.s_z
    return Crossing(t, u, v)


@kernel
def enters(triangles: Triangles, i: int, shear: Shear) -> int:
    """+1 if the ray comes to triangle i from the front, -1 if it comes from behind, 0 for a
    miss."""
    return project(triangles.points, triangles.corners, i, shear).side


class Vertices(NamedTuple):
    """The vertices of a triangle."""

    v0: Vec3
    v1: Vec3
    v2: Vec3


@kernel
def vertices_of(triangles: Triangles, i: int) -> Vertices:
    points, corners, r = triangles.points, triangles.corners, np.uint64(i)
    return Vertices(
        row(points, corners[r, 0]), row(points, corners[r, 1]), row(points, corners[r, 2])
    )


@kernel
def _between(of: Vertices, u: float, v: float) -> Vec3:
    """(1 - u - v) v0 + u v1 + v v2."""
    return of.v0 * (1.0 - u - v) + of.v1 * u + of.v2 * v


@kernel
def interpolate(array: FloatArray, i: int, u: float, v: float) -> Vec3:
    """(1 - u - v) a0 + u a1 + v a2 of the three vectors in row i."""
    return _between(Vertices(triple(array, i, 0), triple(array, i, 1), triple(array, i, 2)), u, v)


@kernel
def normal(triangles: Triangles, i: int) -> Vec3:
    """Perpendicular to the edges, on slivers too.

    Products of edges a and b round by u |a| |b|, and so n's direction by some 6 u over the sine of
    their angle: for sines below 1/4 the products are made exact.  Otherwise a ray along a sliver
    that starts off it by `SurfacePoint.error` could meet it again.
    """
    v0, v1, v2 = vertices_of(triangles, i)
    a, b = v1 - v0, v2 - v0
    n = cross(a, b)
    if dot(n, n) < 0.0625 * (dot(a, a) * dot(b, b)):
        x, _ = exact_edge_function(a.y, a.z, b.y, b.z)
        y, _ = exact_edge_function(a.z, a.x, b.z, b.x)
        z, _ = exact_edge_function(a.x, a.y, b.x, b.y)
        n = Vec3(x, y, z)
    return normalize(n)


@kernel
def error_at(triangles: Triangles, i: int, p: Vec3) -> float:
    """`SurfacePoint.error`, valid however thin the triangle is.

    A ray that begins next to the triangle projects its vertices to within 7 u of their distances,
    at most the longest edge, and the error of the point that it meets is `CANCELLED` u + 4 u times
    that: twice the edge in `surface_error`, which adds the rounding of p itself.
    """
    v0, v1, v2 = vertices_of(triangles, i)
    longest = max(max_abs(v1 - v0), max(max_abs(v2 - v0), max_abs(v2 - v1)))
    return surface_error(p, v0, 2.0 * longest)


@kernel
def lift_of(triangles: Triangles, i: int, p: Vec3) -> float:
    """See `shape.lift`."""
    a, b, c = vertices_of(triangles, i)
    lower = Vec3(min(a.x, b.x, c.x), min(a.y, b.y, c.y), min(a.z, b.z, c.z))
    upper = Vec3(max(a.x, b.x, c.x), max(a.y, b.y, c.y), max(a.z, b.z, c.z))
    middle = lower * 0.5 + upper * 0.5
    return lift(p - middle, upper * 0.5 - lower * 0.5, error_at(triangles, i, p))


@kernel
def shading_normal(normals: FloatArray | None, i: int, u: float, v: float, n: Vec3) -> Vec3:
    """The interpolated vertex normal, normalised; `n` if there is none."""
    if normals is None:
        return n
    ns = interpolate(normals, i, u, v)
    if dot(ns, ns) == 0.0:
        return n
    return normalize(ns)


@kernel
def surface(triangles: Triangles, ray: Ray, hit: Hit) -> SurfacePoint:
    i = hit.row
    p = _between(vertices_of(triangles, i), hit.u, hit.v)
    n = normal(triangles, i)
    ns = shading_normal(triangles.normals, i, hit.u, hit.v, n)
    material, light = in_column(triangles.material, i), in_column(triangles.light, i)
    return SurfacePoint(p, n, ns, error_at(triangles, i, p), material, light)


@kernel
def sample(triangles: Triangles, i: int, area: float, p: Vec3, u0: float, u1: float) -> LightPoint:
    """A point uniform over the area, as a light for `p` (Turk 1990: the square root warp)."""
    root = math.sqrt(u0)
    u, v = root * (1.0 - u1), root * u1
    q = _between(vertices_of(triangles, i), u, v)
    n = normal(triangles, i)
    density = solid_angle_pdf(p, q, n, area, lift_of(triangles, i, p))
    return LightPoint(q, n, error_at(triangles, i, q), density, u, v)


@kernel
def pdf(triangles: Triangles, i: int, area: float, p: Vec3, q: SurfacePoint) -> float:
    """The density of `sample` per solid angle, at the point `q` of the triangle."""
    return solid_angle_pdf(p, q.p, q.n, area, lift_of(triangles, i, p))


@kernel
def uv(triangles: Triangles, ray: Ray, hit: Hit) -> tuple[float, float]:
    """The interpolated texture coordinates; if there are none, the barycentrics of v1 and v2."""
    return _interpolated_uv(triangles.uvs, hit)


@kernel
def _interpolated_uv(uvs: FloatArray | None, hit: Hit) -> tuple[float, float]:
    if uvs is None:
        return hit.u, hit.v
    w = uvs[hit.row]
    a = 1.0 - hit.u - hit.v
    return a * w[0] + hit.u * w[2] + hit.v * w[4], a * w[1] + hit.u * w[3] + hit.v * w[5]


@kernel
def tangents(triangles: Triangles, ray: Ray, hit: Hit) -> Tangents:
    """Any tangents if the triangle has no area in texture coordinates."""
    i = hit.row
    v0, v1, v2 = vertices_of(triangles, i)
    a, b = v1 - v0, v2 - v0
    return _tangents_of_uv(triangles.uvs, i, a, b, normal(triangles, i))


@kernel
def _tangents_of_uv(uvs: FloatArray | None, i: int, a: Vec3, b: Vec3, n: Vec3) -> Tangents:
    """From the edges a = v1 - v0 and b = v2 - v0: a = du_a dp/du + dv_a dp/dv, and b likewise."""
    if uvs is None:
        return Tangents(a, b)
    w = uvs[i]
    du_a, dv_a, du_b, dv_b = w[2] - w[0], w[3] - w[1], w[4] - w[0], w[5] - w[1]
    x, y = du_a * dv_b, dv_a * du_b
    # Differences and products round x and y by 3 u each, and their difference rounds by u.
    if abs(x - y) <= 4.0 * UNIT_ROUNDOFF * (abs(x) + abs(y)):
        return any_tangents(n)
    inverse = 1.0 / (x - y)
    dpdu, dpdv = (a * dv_b - b * dv_a) * inverse, (b * du_a - a * du_b) * inverse
    if max(max_abs(dpdu), max_abs(dpdv)) < math.inf:
        return Tangents(dpdu, dpdv)
    return any_tangents(n)


@kernel
def colour(triangles: Triangles | None, hit: Hit, without: Vec3) -> Vec3:
    """The interpolated colour of the vertices; `without` if there are none."""
    if triangles is None:
        return without
    return _interpolated_colour(triangles.colours, hit, without)


@kernel
def _interpolated_colour(colours: FloatArray | None, hit: Hit, without: Vec3) -> Vec3:
    if colours is None:
        return without
    if colours[hit.row, 0] < 0.0:
        return without
    return interpolate(colours, hit.row, hit.u, hit.v)


@kernel
def face_of(triangles: Triangles, hit: Hit) -> int:
    """The number of the triangle in its mesh."""
    return in_column(triangles.face, hit.row)


__all__ = [
    "RAGGED",
    "Triangle",
    "Triangles",
    "align",
    "areas",
    "bounds",
    "colour",
    "enters",
    "error_at",
    "extent",
    "face_of",
    "interpolate",
    "intersect",
    "intersect_lane",
    "lift_of",
    "normal",
    "on_line",
    "pdf",
    "sample",
    "shading_normal",
    "surface",
    "tangents",
    "unit_normals",
    "uv",
]
