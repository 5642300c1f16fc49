"""Triangle: three vertices, watertight along shared edges."""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from reference_rt import transform
from reference_rt.description import Vector
from reference_rt.kernel import kernel
from reference_rt.ray import Crossing, Hit, Ray, SurfacePoint, miss, surface_error
from reference_rt.shapes.shape import (
    Bounds,
    FloatArray,
    IntArray,
    LightPoint,
    Place,
    Shape,
    solid_angle_pdf,
)
from reference_rt.vec3 import Vec3, component, cross, dot, length, max_abs, normalize, triple


class Triangle(Shape):
    """A triangle; its normal is (v1 - v0) x (v2 - v0)."""

    type: Literal["triangle"] = "triangle"
    v0: Vector
    v1: Vector
    v2: Vector

    def tabulate(self, place: Place) -> "Triangles":
        m = self.map_in(place)
        vertices = transform.apply_points(m, np.array([self.v0, self.v1, self.v2]))
        triangles = soup(vertices.reshape(1, 9), place)
        if areas(triangles)[0] == 0.0:
            raise ValueError("the triangle has no area; expected three points not on a line")
        return triangles


class Triangles(NamedTuple):
    """n triangles: vertices v0 v1 v2 (n, 9); unit vertex normals (n, 9), texture coordinates (n, 6)
    and linear sRGB colours (n, 9; -1 for none) of the vertices, each None where no triangle has
    any; owners (n,); face, the number within its shape."""

    vertices: FloatArray
    normals: FloatArray | None
    uvs: FloatArray | None
    colours: FloatArray | None
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


def soup(
    vertices: FloatArray,
    place: Place,
    normals: FloatArray | None = None,
    uvs: FloatArray | None = None,
    colours: FloatArray | None = None,
) -> Triangles:
    """Triangles of one shape: see `Triangles`."""
    n = len(vertices)
    return Triangles(
        vertices=vertices,
        normals=normals,
        uvs=uvs,
        colours=colours,
        owner=np.full(n, place.owner),
        material=np.full(n, place.material),
        light=np.full(n, -1),
        face=np.arange(n),
    )


def align(parts: Sequence[Triangles]) -> list[Triangles]:
    """Tables with the same columns: what one has, the others get."""
    parts = list(parts)
    if any(part.normals is not None for part in parts):
        parts = [
            part._replace(normals=_flat_normals(part)) if part.normals is None else part
            for part in parts
        ]
    if any(part.uvs is not None for part in parts):
        # The barycentrics, which are the coordinates of a triangle without any.
        corners = np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]])
        parts = [
            part._replace(uvs=np.repeat(corners, len(part.face), axis=0))
            if part.uvs is None
            else part
            for part in parts
        ]
    if any(part.colours is not None for part in parts):
        parts = [
            part._replace(colours=np.full((len(part.face), 9), -1.0))
            if part.colours is None
            else part
            for part in parts
        ]
    return parts


def _flat_normals(triangles: Triangles) -> FloatArray:
    """Each triangle's own normal at its vertices."""
    n = geometric_normals(triangles.vertices)
    with np.errstate(invalid="ignore"):
        n = np.nan_to_num(n / np.linalg.norm(n, axis=1, keepdims=True))
    return np.tile(n, 3)


def geometric_normals(vertices: FloatArray) -> FloatArray:
    """Normals (n, 3) of twice the area's length, of vertices (n, 9)."""
    v = vertices.reshape(-1, 3, 3)
    return np.asarray(np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]))


def areas(triangles: Triangles) -> FloatArray:
    return np.asarray(0.5 * np.linalg.norm(geometric_normals(triangles.vertices), axis=1))


def bounds(triangles: Triangles) -> Bounds:
    """Boxes (n, 3), (n, 3): minima and maxima of vertices are exact."""
    v = triangles.vertices.reshape(-1, 3, 3)
    return v.min(axis=1), v.max(axis=1)


class Shear(NamedTuple):
    """A ray turned so that its direction is the unit z axis: the axes permuted to x y z, and the
    shear that remains (Woop, Benthin & Wald 2013, JCGT 2(1))."""

    x: int
    y: int
    z: int
    o_x: float
    o_y: float
    o_z: float
    s_x: float
    s_y: float
    s_z: float


@kernel
def shear_of(ray: Ray) -> Shear:
    """Once per ray: the largest axis of d becomes z; x and y swap to keep the winding."""
    z = 2
    if abs(ray.d.x) >= abs(ray.d.y) and abs(ray.d.x) >= abs(ray.d.z):
        z = 0
    elif abs(ray.d.y) >= abs(ray.d.z):
        z = 1
    x, y = (z + 1) % 3, (z + 2) % 3
    d_z = component(ray.d, z)
    if d_z < 0.0:
        x, y = y, x
    return Shear(
        x,
        y,
        z,
        component(ray.o, x),
        component(ray.o, y),
        component(ray.o, z),
        component(ray.d, x) / d_z,
        component(ray.d, y) / d_z,
        1.0 / d_z,
    )


class Projection(NamedTuple):
    """A triangle as a ray sees it: its edge functions, whose sum is twice its area, and the depths
    of its vertices; side, 0 where the ray passes by, else the sign of the area."""

    side: int
    e0: float
    e1: float
    e2: float
    a_z: float
    b_z: float
    c_z: float


@kernel
def project(triangles: Triangles, i: int, shear: Shear) -> Projection:
    """Triangle i seen along a ray (Woop, Benthin & Wald 2013).

    Each vertex is projected by arithmetic of its own, and two neighbours' edge functions differ in
    sign alone.  Products round monotonically: a difference that is not 0 has the right sign.  Where
    it is 0, `exactly` decides: of the triangles around an edge or a vertex that a ray passes
    through, it passes through exactly those that it would pass through a hair beside it.
    """
    v = triangles.vertices
    a_z = v[i, shear.z] - shear.o_z
    b_z = v[i, 3 + shear.z] - shear.o_z
    c_z = v[i, 6 + shear.z] - shear.o_z
    a_x = v[i, shear.x] - shear.o_x - shear.s_x * a_z
    b_x = v[i, 3 + shear.x] - shear.o_x - shear.s_x * b_z
    c_x = v[i, 6 + shear.x] - shear.o_x - shear.s_x * c_z
    a_y = v[i, shear.y] - shear.o_y - shear.s_y * a_z
    b_y = v[i, 3 + shear.y] - shear.o_y - shear.s_y * b_z
    c_y = v[i, 6 + shear.y] - shear.o_y - shear.s_y * c_z
    e0 = c_x * b_y - c_y * b_x
    e1 = a_x * c_y - a_y * c_x
    e2 = b_x * a_y - b_y * a_x
    side = 0
    if e0 > 0.0 and e1 > 0.0 and e2 > 0.0:
        side = 1
    elif e0 < 0.0 and e1 < 0.0 and e2 < 0.0:
        side = -1
    elif e0 == 0.0 or e1 == 0.0 or e2 == 0.0:
        e0, s0 = exactly(c_x, c_y, b_x, b_y)
        e1, s1 = exactly(a_x, a_y, c_x, c_y)
        e2, s2 = exactly(b_x, b_y, a_x, a_y)
        side = s0 if s0 == s1 and s1 == s2 else 0
    return Projection(side, e0, e1, e2, a_z, b_z, c_z)


@kernel
def product_error(x: float, y: float, product: float) -> float:
    """x y - product, exactly, for product = fl(x y) (Dekker 1971, Veltkamp's splitting)."""
    x_high = x * 134217729.0  # 2^27 + 1
    x_high = x_high - (x_high - x)
    y_high = y * 134217729.0
    y_high = y_high - (y_high - y)
    x_low, y_low = x - x_high, y - y_high
    return ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low


@kernel
def exactly(p_x: float, p_y: float, q_x: float, q_y: float) -> tuple[float, int]:
    """The edge function p_x q_y - p_y q_x to within one rounding, and its sign, which is right.

    On the edge it is that beside the edge, as if the ray were moved by (h, h²) for an h above 0 and
    below everything else: 0 only for an edge without length.
    """
    left, right = p_x * q_y, p_y * q_x
    e = left - right + (product_error(p_x, q_y, left) - product_error(p_y, q_x, right))
    along_x, along_y = p_y - q_y, q_x - p_x
    for decides in (e, along_x, along_y):
        if decides > 0.0:
            return e, 1
        if decides < 0.0:
            return e, -1
    return 0.0, 0


@kernel
def intersect(triangles: Triangles, i: int, shear: Shear) -> Crossing:
    """Where the ray meets triangle i; u, v are the barycentrics of v1 and v2."""
    seen = project(triangles, i, shear)
    if seen.side == 0:
        return miss()
    inverse = 1.0 / (seen.e0 + seen.e1 + seen.e2)
    t = (seen.e0 * seen.a_z + seen.e1 * seen.b_z + seen.e2 * seen.c_z) * shear.s_z * inverse
    if t > 0.0:
        return Crossing(t, seen.e1 * inverse, seen.e2 * inverse)
    return miss()


@kernel
def enters(triangles: Triangles, i: int, shear: Shear) -> int:
    """+1 where the ray comes to the front of triangle i, -1 where it comes from behind."""
    return -project(triangles, i, shear).side


@kernel
def interpolate(array: FloatArray, i: int, u: float, v: float) -> Vec3:
    """(1 - u - v) a0 + u a1 + v a2 of the three vectors in row i."""
    return triple(array, i, 0) * (1.0 - u - v) + triple(array, i, 1) * u + triple(array, i, 2) * v


@kernel
def normal(triangles: Triangles, i: int) -> Vec3:
    v0 = triple(triangles.vertices, i, 0)
    return normalize(
        cross(triple(triangles.vertices, i, 1) - v0, triple(triangles.vertices, i, 2) - v0)
    )


@kernel
def error_at(triangles: Triangles, i: int, p: Vec3) -> float:
    v = triangles.vertices
    v0, v1, v2 = triple(v, i, 0), triple(v, i, 1), triple(v, i, 2)
    a, b, c = v1 - v0, v2 - v0, v2 - v1
    longest2 = max(dot(a, a), max(dot(b, b), dot(c, c)))
    # `intersect` rounds edge functions relative to longest², divides by twice the area and gets t
    # in units of the longest edge: on a sliver that is a large error, and rays hit it again.
    sliver = longest2 * math.sqrt(longest2) / length(cross(a, b))
    return surface_error(p, v0, max(max_abs(v1), max_abs(v2)) + sliver)


@kernel
def shading_normal(normals: FloatArray | None, i: int, u: float, v: float, n: Vec3) -> Vec3:
    """The interpolated vertex normal made unit; `n` where there is none."""
    if normals is None:
        return n
    ns = interpolate(normals, i, u, v)
    if dot(ns, ns) == 0.0:
        return n
    return normalize(ns)


@kernel
def surface(triangles: Triangles, ray: Ray, hit: Hit) -> SurfacePoint:
    i = hit.row
    p = interpolate(triangles.vertices, i, hit.u, hit.v)
    n = normal(triangles, i)
    ns = shading_normal(triangles.normals, i, hit.u, hit.v, n)
    return SurfacePoint(
        p, n, ns, error_at(triangles, i, p), triangles.material[i], triangles.light[i]
    )


@kernel
def sample(triangles: Triangles, i: int, area: float, p: Vec3, u0: float, u1: float) -> LightPoint:
    """A point uniform over the area, as a light for `p` (Turk 1990: the square root warp)."""
    root = math.sqrt(u0)
    q = interpolate(triangles.vertices, i, root * (1.0 - u1), root * u1)
    n = normal(triangles, i)
    return LightPoint(q, n, error_at(triangles, i, q), solid_angle_pdf(p, q, n, area))


@kernel
def uv(triangles: Triangles, ray: Ray, hit: Hit) -> tuple[float, float]:
    """The interpolated texture coordinates; without any, the barycentrics of v1 and v2."""
    return _interpolated_uv(triangles.uvs, hit)


@kernel
def _interpolated_uv(uvs: FloatArray | None, hit: Hit) -> tuple[float, float]:
    if uvs is None:
        return hit.u, hit.v
    w = uvs[hit.row]
    a = 1.0 - hit.u - hit.v
    return a * w[0] + hit.u * w[2] + hit.v * w[4], a * w[1] + hit.u * w[3] + hit.v * w[5]


@kernel
def colour(triangles: Triangles | None, hit: Hit, without: Vec3) -> Vec3:
    """The interpolated colour of the vertices; `without` any, that."""
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
    return int(triangles.face[hit.row])
