"""Flat shapes: a plane with coordinates x, y of its own, p = center + x x_edge + y y_edge.

Their tables have center, unit normal, the covectors x_of and y_of, and the edges, all (n, 3).  The
covectors lie in the plane, x = x_of · (p - center): a point that rounding has moved off the plane
has the same coordinates, also under a map that shears.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Crossing, Hit, Ray, SurfacePoint, miss, surface_error
from reference_rt.core.transform import FLAT, Affine
from reference_rt.core.vec3 import Vec3, dot, max_abs, row
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.placement import owners
from reference_rt.shapes.shape import TabulationContext, lift

Integers = npt.NDArray[np.object_]


def integers(a: FloatArray) -> tuple[Integers, int]:
    """`a` exactly, as Python's integers over a common power of two: (numerators, denominator)."""
    ratios = [x.as_integer_ratio() for x in a.ravel().tolist()]
    denominator = max(d for _, d in ratios)
    numerators = np.array([n * (denominator // d) for n, d in ratios], dtype=object)
    return numerators.reshape(a.shape), denominator


class Flats(NamedTuple):
    """n flat shapes without columns of their own: those that all have, and `placement.owners`."""

    center: FloatArray
    normal: FloatArray
    x_of: FloatArray
    y_of: FloatArray
    x_edge: FloatArray
    y_edge: FloatArray
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


def columns(
    center: FloatArray, x_edge: FloatArray, y_edge: FloatArray, context: TabulationContext
) -> dict[str, Any]:
    """The columns of every flat table, one row; the normal is that of x_edge x y_edge.

    They are computed in integers and rounded once, so that the normal of a thin shape is as exact
    as any other, and squares of extreme scales do not overflow.  Raises ValueError.
    """
    edges = np.array([x_edge, y_edge])
    if not np.isfinite(edges).all():
        raise ValueError("its coordinates overflow; expected finite numbers")
    (x, y), one = integers(edges)
    n = np.cross(x, y)
    n2 = int(n @ n)
    if n2 == 0:
        raise ValueError(FLAT)
    unit = (n / np.abs(n).max()).astype(float)
    try:
        # The basis dual to x, y in the plane; all here is in units of 1 / one.
        x_of = (np.cross(y, n) * one / n2).astype(float)
        y_of = (np.cross(n, x) * one / n2).astype(float)
    except OverflowError:
        raise ValueError("it is too small; expected a size that has a reciprocal") from None
    return {
        "center": center.copy()[None],
        "normal": (unit / math.hypot(*unit))[None],
        "x_of": x_of[None],
        "y_of": y_of[None],
        "x_edge": x_edge.copy()[None],
        "y_edge": y_edge.copy()[None],
        **owners(context),
    }


def facing_z(m: Affine, context: TabulationContext) -> dict[str, Any]:
    """`columns` for the plane z = 0 with normal +z under the map m; also for a map that flips
    orientation the normal is on the side that +z is mapped to."""
    made = columns(m[:, 3], m[:, 0], m[:, 1], context)
    (x, y, z), _ = integers(m[:, :3].T)
    if np.cross(x, y) @ z < 0:
        made["normal"] = -made["normal"]
    return made


def check_area(what: str, area: float) -> None:
    """Raises ValueError for an area that float64 cannot hold."""
    if not 0.0 < area < math.inf:
        raise ValueError(f"the {what}'s area is not a float64; expected an ordinary size")


def unit_normals(table: Any) -> FloatArray:
    """The unit normals (n, 3)."""
    found: FloatArray = table.normal
    return found


@kernel
def signed_distance(table: Any, i: int, p: Vec3) -> float:
    """The distance of `p` from plane i: positive on the normal's side."""
    return dot(p - row(table.center, i), row(table.normal, i))


@kernel
def coordinates(table: Any, i: int, ray: Ray, t: float) -> tuple[float, float]:
    """x, y of the ray's point at t, each off by at most 6 u (|o - center| + t |d|) |covector|."""
    q = (ray.o - row(table.center, i)) + ray.d * t
    return dot(q, row(table.x_of, i)), dot(q, row(table.y_of, i))


@kernel
def arguments(table: Any, i: int) -> tuple[Vec3, Vec3, Vec3, Vec3]:
    """What `met` takes after the ray."""
    return row(table.center, i), row(table.normal, i), row(table.x_of, i), row(table.y_of, i)


@kernel
def met(ray: Ray, center: Vec3, normal: Vec3, x_of: Vec3, y_of: Vec3) -> tuple[float, float, float]:
    """(t, x, y) where a line meets a plane, by the operations of `meet`, for SIMD.

    For a parallel ray all are ±inf or NaN: any comparison with a limit fails.
    """
    from_center = ray.o - center
    t = -dot(from_center, normal) / dot(ray.d, normal)
    q = from_center + ray.d * t
    return t, dot(q, x_of), dot(q, y_of)


@kernel
def found(table: Any, i: int, ray: Ray, t: float) -> Crossing:
    """The crossing of shape i at t; its u, v are the local x, y."""
    x, y = coordinates(table, i, ray, t)
    return Crossing(t, x, y)


@kernel
def meet(table: Any, i: int, ray: Ray) -> Crossing:
    """Where the ray meets plane i, on either side; its u, v are x and y.

    A parallel ray, in the plane or not, has t = ±inf or NaN: it misses.  The two products with the
    normal round by 6 u |o - center| and 5 u |d|.  With r = |o - center| + t |d| and the angle of
    incidence, the error of t |d| is at most 7 u r / cos, of x 13 u r |x_of| / cos, and of y
    likewise: a decision by x or y is right if it has a larger margin.
    """
    t, x, y = met(ray, *arguments(table, i))
    return Crossing(t, x, y) if (t > 0.0) & (t < math.inf) else miss()


@kernel
def surface_at(table: Any, i: int, x: float, y: float) -> SurfacePoint:
    """The point at x, y: in the plane by construction, except for rounding.

    Two sums and two products, of numbers no larger than |center| and `reach`, and the rounding of
    the normal across `reach` are 2 |center| + 5 reach times u for each component; the distance of
    the next ray's origin from the plane has |p| + 4 reach.  That is within `surface_error`, however
    large x and y are.  `reach` is at least the shape's own size: at x = y = 0 of a shape at the
    origin nothing rounds, but the bound must still move a ray off the surface.
    """
    x_edge, y_edge = row(table.x_edge, i), row(table.y_edge, i)
    center, n = row(table.center, i), row(table.normal, i)
    p = center + x_edge * x + y_edge * y
    reach = max_abs(x_edge) * max(1.0, abs(x)) + max_abs(y_edge) * max(1.0, abs(y))
    error = surface_error(p, center, reach)
    return SurfacePoint(p, n, n, error, table.material[i], table.light[i])


@kernel
def surface(table: Any, ray: Ray, hit: Hit) -> SurfacePoint:
    """The point at a hit whose u, v are x and y."""
    return surface_at(table, hit.row, hit.u, hit.v)


@kernel
def lift_of(table: Any, i: int, p: Vec3) -> float:
    """`shape.lift` for a shape whose |x| and |y| are at most 1: its error bound is the largest that
    `surface_at` gives."""
    a, b, center = row(table.x_edge, i), row(table.y_edge, i), row(table.center, i)
    reach = Vec3(abs(a.x) + abs(b.x), abs(a.y) + abs(b.y), abs(a.z) + abs(b.z))
    return lift(p - center, reach, surface_error(p, center, max_abs(a) + max_abs(b)))
