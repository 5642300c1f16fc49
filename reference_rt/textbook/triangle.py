"""Triangle v0 v1 v2, hit from both sides, edges included: seven methods (row T7).

`cramer`, `lu` and `moller_trumbore` solve

    u (v1 - v0) + v (v2 - v0) - t d = o - v0

for t and the barycentrics u, v.  `areas` and `projected_areas` first intersect the plane, as
`two_step` does; u and v are then ratios of areas.  Kernels of barycentrics return a `Crossing`.
Costs are for a hit, without comparisons.
"""

import math
from typing import NamedTuple

import numpy.typing as npt

from reference_rt.core.ray import Crossing, Ray, at
from reference_rt.core.vec3 import Vec3, component, cross, dot
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.textbook.method import FloatArray, family, ray_of, vector


class TriangleParameters(NamedTuple):
    """Three vertices (3,) in world coordinates."""

    v0: npt.ArrayLike
    v1: npt.ArrayLike
    v2: npt.ArrayLike


Prepared = tuple[Vec3, Vec3, Vec3]


def prepare(triangle: TriangleParameters) -> Prepared:
    """The three vertices, checked."""
    return vector(triangle.v0, "v0"), vector(triangle.v1, "v1"), vector(triangle.v2, "v2")


@kernel
def plane_distance(ray: Ray, n: Vec3, v0: Vec3) -> float:
    """t > 0 at which the ray hits the plane through `v0` across `n`; inf if it is parallel or
    points away."""
    slope = dot(n, ray.d)
    if slope == 0.0:
        return math.inf
    t = dot(n, v0 - ray.o) / slope
    return t if t > 0.0 else math.inf


@kernel
def accepted(t: float, u: float, v: float) -> Crossing:
    """The crossing, or none outside of the triangle or behind the origin."""
    inside = u >= 0.0 and v >= 0.0 and u + v <= 1.0 and t > 0.0
    return Crossing(t if inside else math.inf, u, v)


NONE = Crossing(math.inf, math.nan, math.nan)


@kernel
def two_step(ray: Ray, v0: Vec3, v1: Vec3, v2: Vec3) -> float:
    """First the plane, t = n·(v0 - o) / n·d, then the point: on the inner side of all edges?

    With n = (v1 - v0) x (v2 - v0), `p` is inside where n·((b - a) x (p - a)) >= 0 for every edge.
    Cost: 52 +, 42 *, 1 /.
    Fails: at edges.  Two neighbours compute two points p, each rounded off its plane: of rays aimed
    at the shared edges of a solid, measured, one in five passes between them.
    """
    n = cross(v1 - v0, v2 - v0)
    t = plane_distance(ray, n, v0)
    if t == math.inf:
        return math.inf
    p = at(ray, t)
    if dot(n, cross(v1 - v0, p - v0)) < 0.0:
        return math.inf
    if dot(n, cross(v2 - v1, p - v1)) < 0.0:
        return math.inf
    if dot(n, cross(v0 - v2, p - v2)) < 0.0:
        return math.inf
    return t


@kernel
def areas(ray: Ray, v0: Vec3, v1: Vec3, v2: Vec3) -> Crossing:
    """First the plane, then u and v: areas of the triangles that the point makes with two sides,
    over the whole area, all in space.

    n·((v0 - v2) x (p - v2)) / n·n has the sign of the side of p, which the length of the cross
    product, an area without a sign, has lost.
    Cost: 42 +, 39 *, 3 /.
    Fails: at edges, as `two_step` does; with slivers, by the square of length over height L / h:
    t is off by some (L / h) u, and the point with it, which h divides once more.  Measured, u and v
    are off by 0.01 (L / h)^2 u in the median, in place of (L / h) u by `cramer` or `lu`.
    """
    n = cross(v1 - v0, v2 - v0)
    t = plane_distance(ray, n, v0)
    if t == math.inf:
        return NONE
    p, whole = at(ray, t), dot(n, n)
    u = dot(n, cross(v0 - v2, p - v2)) / whole
    v = dot(n, cross(v1 - v0, p - v0)) / whole
    return accepted(t, u, v)


@kernel
def projected_areas(ray: Ray, v0: Vec3, v1: Vec3, v2: Vec3) -> Crossing:
    """As `areas`, of the triangle and the point without the largest axis of n: a projection
    multiplies all areas by the same number.

    The whole is the component of n along that axis, known already.
    Cost: 25 +, 22 *, 3 /.
    Fails: as `areas` does.
    """
    n = cross(v1 - v0, v2 - v0)
    t = plane_distance(ray, n, v0)
    if t == math.inf:
        return NONE
    axis = 2
    if abs(n.x) >= abs(n.y) and abs(n.x) >= abs(n.z):
        axis = 0
    elif abs(n.y) >= abs(n.z):
        axis = 1
    p, whole = at(ray, t), component(n, axis)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    x, y = component(p, i) - component(v0, i), component(p, j) - component(v0, j)
    x1, y1 = component(v1, i) - component(v0, i), component(v1, j) - component(v0, j)
    x2, y2 = component(v2, i) - component(v0, i), component(v2, j) - component(v0, j)
    return accepted(t, (x * y2 - y * x2) / whole, (x1 * y - y1 * x) / whole)


@kernel
def determinant(a: Vec3, b: Vec3, c: Vec3) -> float:
    """The determinant of the matrix with these columns: a·(b x c)."""
    return dot(a, cross(b, c))


@kernel
def cramer(ray: Ray, v0: Vec3, v1: Vec3, v2: Vec3) -> Crossing:
    """Cramer's rule with all four determinants: u = |s e2 -d| / |e1 e2 -d|, ...

    Cost: 30 +, 36 *, 3 /.
    Fails: with slivers and grazing rays, as each determinant has an error of u |e1| |e2| |s|,
    however small it is: on triangles 1e-6 high, measured, t is off by 4e5 u in the median.  At
    edges, where neighbours round 1 - u - v differently: one ray in 20 aimed there passes through.
    """
    e1, e2, s, back = v1 - v0, v2 - v0, ray.o - v0, -ray.d
    whole = determinant(e1, e2, back)
    if whole == 0.0:
        return NONE
    u = determinant(s, e2, back) / whole
    v = determinant(e1, s, back) / whole
    t = determinant(e1, e2, s) / whole
    return accepted(t, u, v)


@kernel
def lu(ray: Ray, v0: Vec3, v1: Vec3, v2: Vec3) -> Crossing:
    """LU factorisation of the 3x3 matrix with partial pivoting.

    Rows are x, y, z; columns u, v, t.  P A = L U; then L y = P s forwards, U (u, v, t) = y back.
    Cost: 21 +, 11 *, 6 /.
    Fails: at edges, where one ray in 25 passes through.  Not with slivers: elimination is backward
    stable (exact for a matrix whose entries differ by a few roundings), and t, unlike u and v, is
    well-conditioned for thin triangles.  On those 1e-6 high t is off by 1 u in the median.
    """
    e1, e2, s = v1 - v0, v2 - v0, ray.o - v0
    row0, b0 = Vec3(e1.x, e2.x, -ray.d.x), s.x
    row1, b1 = Vec3(e1.y, e2.y, -ray.d.y), s.y
    row2, b2 = Vec3(e1.z, e2.z, -ray.d.z), s.z
    if abs(row1.x) > abs(row0.x):
        row0, b0, row1, b1 = row1, b1, row0, b0
    if abs(row2.x) > abs(row0.x):
        row0, b0, row2, b2 = row2, b2, row0, b0
    if row0.x == 0.0:
        return NONE
    l10, l20 = row1.x / row0.x, row2.x / row0.x
    u11, u12 = row1.y - l10 * row0.y, row1.z - l10 * row0.z
    u21, u22 = row2.y - l20 * row0.y, row2.z - l20 * row0.z
    if abs(u21) > abs(u11):
        u11, u12, l10, b1, u21, u22, l20, b2 = u21, u22, l20, b2, u11, u12, l10, b1
    if u11 == 0.0:
        return NONE
    l21 = u21 / u11
    u22 = u22 - l21 * u12
    if u22 == 0.0:
        return NONE
    y1 = b1 - l10 * b0
    y2 = b2 - l20 * b0 - l21 * y1
    t = y2 / u22
    v = (y1 - u12 * t) / u11
    u = (b0 - row0.y * v - row0.z * t) / row0.x
    return accepted(t, u, v)


@kernel
def moller_trumbore(ray: Ray, v0: Vec3, v1: Vec3, v2: Vec3) -> Crossing:
    """Cramer's rule with two cross products for all four determinants, and early rejection.

    d x e2 and s x e1 are shared; the published epsilon for the determinant is omitted.
    Cost: 24 +, 27 *, 1 /; a miss by u needs 16 +, 13 *, 1 /.
    Fails: as `cramer` does.
    """
    e1, e2 = v1 - v0, v2 - v0
    h = cross(ray.d, e2)
    whole = dot(e1, h)
    if whole == 0.0:
        return NONE
    inverse = 1.0 / whole
    s = ray.o - v0
    u = dot(s, h) * inverse
    if u < 0.0 or u > 1.0:
        return NONE
    q = cross(s, e1)
    v = dot(ray.d, q) * inverse
    if v < 0.0 or u + v > 1.0:
        return NONE
    return accepted(dot(e2, q) * inverse, u, v)


@kernel
def watertight(ray: Ray, v0: Vec3, v1: Vec3, v2: Vec3) -> Crossing:
    """Shear space so that the ray is the z axis; the signs of three 2-D edge functions decide.

    The largest axis of d becomes z.  Each vertex is projected independently of its triangle, and
    the edge function of a reversed edge is the exact negative: neighbours cannot both reject a ray
    through their edge.  The renderer's method, except for edge functions that round to 0: the
    renderer computes those exactly, and assigns a hit on an edge to exactly one neighbour, as if
    the ray were moved infinitesimally (`shapes.meshes.watertight.project`).
    Cost: 22 +, 16 *, 4 /.
    Fails: never at edges, but a ray whose edge function rounds to 0 hits both neighbours; with
    slivers, where t is off by 3e3 u in the median, and with grazing rays, as all do.  (It was
    published for float32, with zero edge functions computed again in float64.)
    """
    z = 2
    if abs(ray.d.x) >= abs(ray.d.y) and abs(ray.d.x) >= abs(ray.d.z):
        z = 0
    elif abs(ray.d.y) >= abs(ray.d.z):
        z = 1
    x, y = (z + 1) % 3, (z + 2) % 3
    d_z = component(ray.d, z)
    s_x, s_y, s_z = component(ray.d, x) / d_z, component(ray.d, y) / d_z, 1.0 / d_z
    a, b, c = v0 - ray.o, v1 - ray.o, v2 - ray.o
    a_z, b_z, c_z = component(a, z), component(b, z), component(c, z)
    a_x, a_y = component(a, x) - s_x * a_z, component(a, y) - s_y * a_z
    b_x, b_y = component(b, x) - s_x * b_z, component(b, y) - s_y * b_z
    c_x, c_y = component(c, x) - s_x * c_z, component(c, y) - s_y * c_z
    e0 = c_x * b_y - c_y * b_x
    e1 = a_x * c_y - a_y * c_x
    e2 = b_x * a_y - b_y * a_x
    if (e0 < 0.0 or e1 < 0.0 or e2 < 0.0) and (e0 > 0.0 or e1 > 0.0 or e2 > 0.0):
        return NONE
    whole = e0 + e1 + e2
    if whole == 0.0:
        return NONE
    t = s_z * (e0 * a_z + e1 * b_z + e2 * c_z) / whole
    return Crossing(t if t > 0.0 else math.inf, e1 / whole, e2 / whole)


@entry_kernel
def _two_step(triangle: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = two_step(ray_of(o, d, i), *triangle)


@entry_kernel
def _areas(triangle: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = areas(ray_of(o, d, i), *triangle).t


@entry_kernel
def _projected_areas(triangle: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = projected_areas(ray_of(o, d, i), *triangle).t


@entry_kernel
def _cramer(triangle: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = cramer(ray_of(o, d, i), *triangle).t


@entry_kernel
def _lu(triangle: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = lu(ray_of(o, d, i), *triangle).t


@entry_kernel
def _moller_trumbore(triangle: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = moller_trumbore(ray_of(o, d, i), *triangle).t


@entry_kernel
def _watertight(triangle: Prepared, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    for i in range(len(o)):
        t[i] = watertight(ray_of(o, d, i), *triangle).t


_method = family("triangle", "T7", TriangleParameters, prepare)

METHODS = (
    _method(
        "two_step",
        "the plane, then three inside tests",
        "Haines 1989, in Glassner (ed.), An Introduction to Ray Tracing, ch. 2",
        _two_step,
    ),
    _method(
        "areas",
        "the plane, then barycentrics as ratios of areas in space",
        "Shirley & Marschner 2009, Fundamentals of Computer Graphics, 2.7.2",
        _areas,
    ),
    _method(
        "projected_areas",
        "the plane, then ratios of areas without the normal's largest axis",
        "Snyder & Barr 1987, SIGGRAPH",
        _projected_areas,
    ),
    _method(
        "cramer",
        "barycentrics by Cramer's rule",
        "Shirley & Marschner 2009, Fundamentals of Computer Graphics, 4.4.2",
        _cramer,
    ),
    _method(
        "lu",
        "barycentrics by LU with partial pivoting",
        "Golub & Van Loan 2013, Matrix Computations, 3.4",
        _lu,
    ),
    _method(
        "moller_trumbore",
        "Cramer's rule with shared cross products",
        "Möller & Trumbore 1997, Journal of Graphics Tools 2(1)",
        _moller_trumbore,
    ),
    _method(
        "watertight",
        "sheared space and edge functions: no gap between neighbours",
        "Woop, Benthin & Wald 2013, JCGT 2(1)",
        _watertight,
    ),
)
