"""Triangle: three vertices, watertight along shared edges."""

import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from reference_rt import transform
from reference_rt.description import Vector
from reference_rt.kernel import kernel
from reference_rt.ray import Hit, Ray, SurfacePoint, surface_error
from reference_rt.shapes.shape import (
    TRIANGLE,
    Bounds,
    FloatArray,
    IntArray,
    LightPoint,
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

    def tabulate(self, shape: int, material: int, folder: Path) -> "Triangles":
        m = transform.affine(self.transform)
        transform.invert(m)  # refuses singular maps
        vertices = transform.apply_points(m, np.array([self.v0, self.v1, self.v2]))
        triangles = soup(vertices.reshape(1, 9), None, shape, material)
        if areas(triangles)[0] == 0.0:
            raise ValueError("the triangle has no area; expected three points not on a line")
        return triangles


class Triangles(NamedTuple):
    """n triangles: vertices v0 v1 v2 (n, 9); unit vertex normals (n, 9), None where none has any;
    owners (n,); face, the number within its shape."""

    vertices: FloatArray
    normals: FloatArray | None
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


def soup(vertices: FloatArray, normals: FloatArray | None, shape: int, material: int) -> Triangles:
    """Triangles of one shape from their vertices (n, 9) and vertex normals (n, 9)."""
    n = len(vertices)
    return Triangles(
        vertices=vertices,
        normals=normals,
        owner=np.full(n, shape),
        material=np.full(n, material),
        light=np.full(n, -1),
        face=np.arange(n),
    )


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


@kernel
def intersect(triangles: Triangles, i: int, shear: Shear, closest: Hit) -> Hit:
    """The nearer of `closest` and triangle i; the hit's u, v are the barycentrics of v1 and v2.

    Watertight (Woop, Benthin & Wald 2013): each vertex is projected by arithmetic of its own, and
    each edge function of two neighbours differs in sign alone, as rounding is symmetric; a ray
    through an edge is inside one of them, on the edge inside both.
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
    if (e0 < 0.0 or e1 < 0.0 or e2 < 0.0) and (e0 > 0.0 or e1 > 0.0 or e2 > 0.0):
        return closest
    determinant = e0 + e1 + e2
    if determinant == 0.0:
        return closest
    inverse = 1.0 / determinant
    t = (e0 * a_z + e1 * b_z + e2 * c_z) * shear.s_z * inverse
    if t > 0.0 and t < closest.t:
        return Hit(t, TRIANGLE, i, e1 * inverse, e2 * inverse)
    return closest


@kernel
def intersect_all(triangles: Triangles | None, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and all triangles."""
    if triangles is None:
        return closest
    shear = shear_of(ray)
    for i in range(len(triangles.owner)):
        closest = intersect(triangles, i, shear, closest)
    return closest


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
def surface(triangles: Triangles, hit: Hit) -> SurfacePoint:
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
