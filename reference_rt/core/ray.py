"""Rays, hits and surface points, and the one policy for leaving a surface without self-hits; SoA
buffers for one block of rays and for their hits.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.vec3 import Vec3, dot, is_finite, max_abs
from reference_rt.jit.kernel import kernel

UNIT_ROUNDOFF = 2.0**-53
"""u: a float64 operation returns its exact result times (1 + e) with |e| <= u."""


BLOCK = 64
"""The number of rays, and of paths, that are traced as one block (measured on the Cornell box: with
16 it takes 8 % longer, with 32 3 %; 64 paths need 35 KiB)."""


class Ray(NamedTuple):
    """p(t) = o + t d for 0 < t < t_max.  `d` may have any length: t counts in units of |d|."""

    o: Vec3
    d: Vec3
    t_max: float


class Crossing(NamedTuple):
    """A ray's hit with one primitive.  t: inf for none;  u, v: what the primitive needs to compute
    the surface point, see its `intersect`."""

    t: float
    u: float
    v: float


class Hit(NamedTuple):
    """The closest hit so far; for none, `kind` is -1 and `t` the ray's t_max.

    kind, row: the primitive, as a code of `reference_rt.shapes` and a row of its table;  instance:
    the row of its instance, -1 for none;  u, v: see `Crossing`.
    """

    t: float
    kind: int
    row: int
    u: float
    v: float
    instance: int


class SurfacePoint(NamedTuple):
    """A point on a surface, in world coordinates.

    p: the point;  n: unit geometric normal (outward, or by winding);  ns: unit shading normal (a
    mesh's own may lie on the other side);  error: a bound on the distance of `p` from the surface
    *as the next ray's intersection routine sees it*;  material: row of the material tables;
    light: row of the area lights, -1 where the surface does not emit.
    """

    p: Vec3
    n: Vec3
    ns: Vec3
    error: float
    material: int
    light: int


@kernel
def at(ray: Ray, t: float) -> Vec3:
    """p(t) = o + t d."""
    return ray.o + ray.d * t


@kernel
def miss() -> Crossing:
    return Crossing(math.inf, 0.0, 0.0)


@kernel
def no_hit(ray: Ray) -> Hit:
    """No hit up to the ray's t_max."""
    return Hit(ray.t_max, -1, -1, 0.0, 0.0, -1)


SURFACE_ROUNDING = 16.0 * 1.7320508075688774 * UNIT_ROUNDOFF
"""The relative error bound of `surface_error`: 16 sqrt(3) u."""


@kernel
def surface_error(p: Vec3, anchor: Vec3, size: float) -> float:
    """A bound on |distance to the surface|, for `SurfacePoint.error`.

    `anchor` is the point that the shape's table stores and `size` the shape's extent about it.
    Computing p takes at most 8 roundings of numbers no larger than |anchor| + size; transforming a
    ray's origin to the shape's space (o - anchor, products with unit vectors or object-space rows,
    two sums) takes as many of numbers no larger than |p - anchor| <= size and |p|.  Each rounding
    error is at most u times the number, and a vector's length at most sqrt(3) times its largest
    component.
    """
    return SURFACE_ROUNDING * (max_abs(anchor) + max_abs(p) + size)


@kernel
def leave(point: SurfacePoint, w: Vec3) -> Vec3:
    """The origin of a ray that leaves `point` towards `w`: off the surface, on w's side.

    The point is displaced along the geometric normal by its own error bound, never by a global
    epsilon (the idea is Wächter & Binder 2019 and PBR 4ed 6.8.6).  The bound is many times the
    spacing of floats at p, so that the sum does not round back.
    """
    if dot(w, point.n) < 0.0:
        return point.p - point.n * point.error
    return point.p + point.n * point.error


@kernel
def ray_from(point: SurfacePoint, w: Vec3) -> Ray:
    """The unbounded ray that leaves `point` towards `w`."""
    return Ray(leave(point, w), w, math.inf)


_SHORT = 2.0**-44
"""How far before its target a segment ends, over the coordinates of its ends.  A surface through
the target, such as the ceiling on which a lamp lies, is met up to 4 * 2^-52 of these before it,
over the ray's cosine (measured on every shape under turned maps: 2.4 * 2^-52).  Without this a
quarter of the segments end there by rounding; with it only those within a degree of the surface."""


@kernel
def segment_to(point: SurfacePoint, target: Vec3) -> Ray:
    """The open segment from `point` to `target`, without a surface on which `target` lies."""
    o = leave(point, target - point.p)
    w = target - o
    size = max_abs(w)
    short = _SHORT * (max_abs(o) + max_abs(target))
    return Ray(o, w, 1.0 - short / size if short < size else 0.0)


# Rays from outside, with directions of any length: scaled to a safe range, invalid ones marked.


SHORT = 2.0**-64
"""Directions whose largest component is between SHORT and 1 / SHORT are not scaled: their squares,
also in an instance that is 2^400 times as large, do not underflow."""


class Scaled(NamedTuple):
    """ray: with a direction `unit` times the original one, so that its t times `unit` are those of
    the original;  valid: whether o and d are finite and d is not 0."""

    ray: Ray
    unit: float
    valid: bool


@kernel
def scaled(o: Vec3, d: Vec3, t_max: float) -> Scaled:
    """Scales very long and very short directions, whose squares would leave the range of float64,
    by a power of two, which changes no bit of the results."""
    unit, valid = 1.0, is_finite(o) and is_finite(d) and max_abs(d) > 0.0
    if valid and not SHORT <= max_abs(d) <= 1.0 / SHORT:
        _, exponent = math.frexp(max_abs(d))
        unit = math.ldexp(1.0, -min(max(exponent, -1000), 1000))
        d = d * unit
    return Scaled(Ray(o, d, t_max / unit), unit, valid)


@kernel
def is_representable(t: float, p: Vec3) -> bool:
    """Whether a hit is representable in float64: 0 < t < inf and p finite."""
    return 0.0 < t < math.inf and is_finite(p)


FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

RAY_FLOATS = 7 * BLOCK
HIT_FLOATS, HIT_INTEGERS = 3 * BLOCK, 3 * BLOCK
POINT_FLOATS, POINT_INTEGERS = 10 * BLOCK, 2 * BLOCK


class RayBlock(NamedTuple):
    """Up to BLOCK rays as SoA: numbers (RAY_FLOATS,), o.x of all rays, then o.y, o.z, d.x, d.y, d.z
    and t_max."""

    numbers: FloatArray


class HitBlock(NamedTuple):
    """Up to BLOCK hits as SoA: numbers (HIT_FLOATS,), t of all hits, then u and v;  codes
    (HIT_INTEGERS,), kind of all hits, then row and instance."""

    numbers: FloatArray
    codes: IntArray


class PointBlock(NamedTuple):
    """Up to BLOCK surface points as SoA: numbers (POINT_FLOATS,), p.x of all points, then p.y, p.z,
    n, ns and the error;  codes (POINT_INTEGERS,), material of all points, then light."""

    numbers: FloatArray
    codes: IntArray


@kernel
def vector_of(numbers: FloatArray, column: int, j: int) -> Vec3:
    """Vector j of those stored in three columns, from `column` on, of BLOCK numbers each.

    The index is unsigned, as in `vec3.row` (measured: 2 % of spheres under a sky).
    """
    at, next_column = np.uint64(column * BLOCK + j), np.uint64(BLOCK)
    return Vec3(numbers[at], numbers[at + next_column], numbers[at + next_column + next_column])


@kernel
def put_vector(numbers: FloatArray, column: int, j: int, v: Vec3) -> None:
    at, next_column = np.uint64(column * BLOCK + j), np.uint64(BLOCK)
    numbers[at], numbers[at + next_column], numbers[at + next_column + next_column] = v


@kernel
def add_vector(numbers: FloatArray, column: int, j: int, v: Vec3) -> None:
    put_vector(numbers, column, j, vector_of(numbers, column, j) + v)


@kernel
def ray_of(rays: RayBlock, j: int) -> Ray:
    """Ray j."""
    numbers = rays.numbers
    return Ray(vector_of(numbers, 0, j), vector_of(numbers, 3, j), numbers[6 * BLOCK + j])


@kernel
def put_ray(rays: RayBlock, j: int, ray: Ray) -> None:
    put_vector(rays.numbers, 0, j, ray.o)
    put_vector(rays.numbers, 3, j, ray.d)
    rays.numbers[6 * BLOCK + j] = ray.t_max


@kernel
def hit_of(hits: HitBlock, j: int) -> Hit:
    """Hit j."""
    numbers, codes = hits.numbers, hits.codes
    return Hit(
        numbers[j],
        codes[j],
        codes[BLOCK + j],
        numbers[BLOCK + j],
        numbers[2 * BLOCK + j],
        codes[2 * BLOCK + j],
    )


@kernel
def put_hit(hits: HitBlock, j: int, hit: Hit) -> None:
    numbers, codes = hits.numbers, hits.codes
    numbers[j], numbers[BLOCK + j], numbers[2 * BLOCK + j] = hit.t, hit.u, hit.v
    codes[j], codes[BLOCK + j], codes[2 * BLOCK + j] = hit.kind, hit.row, hit.instance


@kernel
def point_of(points: PointBlock, j: int) -> SurfacePoint:
    """Surface point j."""
    numbers, codes = points.numbers, points.codes
    return SurfacePoint(
        vector_of(numbers, 0, j),
        vector_of(numbers, 3, j),
        vector_of(numbers, 6, j),
        numbers[9 * BLOCK + j],
        codes[j],
        codes[BLOCK + j],
    )


@kernel
def put_point(points: PointBlock, j: int, point: SurfacePoint) -> None:
    numbers, codes = points.numbers, points.codes
    put_vector(numbers, 0, j, point.p)
    put_vector(numbers, 3, j, point.n)
    put_vector(numbers, 6, j, point.ns)
    numbers[9 * BLOCK + j] = point.error
    codes[j], codes[BLOCK + j] = point.material, point.light
