"""Torus: the points at distance r from a circle of radius R."""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import Bounds, FloatArray, IntArray
from reference_rt.core.model import Examples, Positive
from reference_rt.core.ray import UNIT_ROUNDOFF, Crossing, Hit, Ray, SurfacePoint, at
from reference_rt.core.vec3 import Vec3, dot, length, row
from reference_rt.jit.kernel import kernel, local_floats
from reference_rt.sampling.warp import around
from reference_rt.shapes import placement
from reference_rt.shapes.placement import (
    columns,
    local_point,
    local_ray,
    local_vector,
    world_surface,
    world_vector,
)
from reference_rt.shapes.rounding import along_from
from reference_rt.shapes.shape import Shape, Spans, TabulationContext, Tangents


class Torus(Shape):
    """A ring about the z axis; outward normals."""

    EXAMPLES: ClassVar[Examples] = ({}, {"major_radius": 0.7, "minor_radius": 0.3})
    type: Literal["torus"] = "torus"
    major_radius: Positive = 1.0
    """R, from the axis to the middle of the tube, before the transform, in scene units."""
    minor_radius: Positive = 0.25
    """r, the radius of the tube, less than R, before the transform."""

    def tabulate(self, context: TabulationContext) -> "Tori":
        if not self.minor_radius < self.major_radius:
            raise ValueError(
                f"minor_radius is {self.minor_radius:g}; expected less than major_radius, "
                f"{self.major_radius:g}: the tube would cut itself"
            )
        return Tori(
            major=np.array([self.major_radius]),
            minor=np.array([self.minor_radius]),
            **columns(self.map_in(context), context),
        )


class Tori(NamedTuple):
    """n tori: radii R and r (n,); center, to_local and edges as in `shapes.placement`; the columns
    of `owners`."""

    major: FloatArray
    minor: FloatArray
    center: FloatArray
    to_local: FloatArray
    edges: FloatArray
    owner: IntArray
    material: IntArray
    light: IntArray
    face: IntArray


def bounds(tori: Tori) -> Bounds:
    """Boxes (n, 3), (n, 3) that contain the tori, rounded outwards."""
    wide = tori.major + tori.minor
    upper = np.column_stack([wide, wide, tori.minor])
    return placement.bounds(tori.center, tori.edges, -upper, upper)


@kernel
def excess(p: Vec3, major: float, minor: float) -> float:
    """(rho - R)² + z² - r², with rho the distance from the axis: negative inside.

    The torus's quartic is this times a positive number.  This form cancels far less: an error of a
    few u R in rho moves the surface by as much.
    """
    off = math.sqrt(p.x * p.x + p.y * p.y) - major
    return off * off + p.z * p.z - minor * minor


@kernel
def _slope(p: Vec3, d: Vec3, major: float) -> float:
    """The derivative of `excess` along d."""
    rho = math.sqrt(p.x * p.x + p.y * p.y)
    along = (p.x * d.x + p.y * d.y) / rho if rho > 0.0 else 0.0
    return 2.0 * ((rho - major) * along + p.z * d.z)


STEPS = 80
"""More steps than bisection takes down to two neighbouring floats of ordinary size; Newton's steps,
tried first, take about five."""


@kernel
def _turning_point(a2: float, a1: float, low: float, high: float) -> float:
    """The zero of 4 s³ + 2 a2 s + a1 between `low` and `high`, where its signs differ."""
    rises = (4.0 * high * high + 2.0 * a2) * high + a1 > 0.0
    s = 0.5 * (low + high)
    for _ in range(STEPS):
        value = (4.0 * s * s + 2.0 * a2) * s + a1
        if (value > 0.0) == rises:
            high = s
        else:
            low = s
        slope = 12.0 * s * s + 2.0 * a2
        following = s - value / slope if slope != 0.0 else low
        if not (low < following and following < high):
            following = 0.5 * (low + high)
        if abs(following - s) <= 4.0 * UNIT_ROUNDOFF * (abs(low) + abs(high)):
            return following
        s = following
    return s


@kernel
def _root(
    m: Vec3, d: Vec3, major: float, minor: float, low: float, high: float, out: bool
) -> float:
    """The zero s of `excess` at m + s d between `low` and `high`;  out: whether `excess` is above 0
    at `high` (and below at `low`), or else the other way round."""
    s = 0.5 * (low + high)
    for _ in range(STEPS):
        p = m + d * s
        value = excess(p, major, minor)
        if (value > 0.0) == out:
            high = s
        else:
            low = s
        slope = _slope(p, d, major)
        following = s - value / slope if slope != 0.0 else low
        if not (low < following and following < high):
            following = 0.5 * (low + high)
        # The step is smaller than the rounding of m and s themselves.
        if abs(following - s) <= 0.5 * UNIT_ROUNDOFF * (abs(s) + major):
            return following
        s = following
    return s


@kernel
def _crossings(tori: Tori, i: int, ray: Ray, t: FloatArray) -> int:
    """Writes all t at which the line meets torus i, in order, to t (4,); returns their number: 0, 2
    or 4.

    From the point m closest to the middle, along a unit d, the quartic has no cubic term: s⁴ +
    a2 s² + a1 s + a0.  Between two turning points there is at most one zero, and the signs of
    `excess` at them say whether there is one.  The line begins and ends outside, so that the number
    of zeros is even.
    """
    local = local_ray(tori, i, ray)
    major, minor = tori.major[i], tori.minor[i]
    size = major + minor
    speed = length(local.d)
    d = local.d * (1.0 / speed)
    middle = -dot(local.o, d) / speed
    m = local_vector(tori, i, along_from(ray.o, ray.d, row(tori.center, i), middle))
    # Once more, since rounding leaves a part along d: m is small now, and so is the error.
    rest = -dot(m, d)
    m = m + d * rest
    k = dot(m, m)
    if not k < size * size:
        return 0
    end = math.sqrt(size * size - k)
    big_k = k + (major - minor) * (major + minor)
    a2 = 2.0 * big_k - 4.0 * major * major * (d.x * d.x + d.y * d.y)
    a1 = 8.0 * major * major * m.z * d.z
    turning = local_floats(4)
    found = 0
    bend = math.sqrt(-a2 / 6.0) if a2 < 0.0 else 0.0
    low = -end
    for piece in range(3):
        high = end if piece == 2 else min(max(bend if piece == 1 else -bend, -end), end)
        at_low = (4.0 * low * low + 2.0 * a2) * low + a1
        at_high = (4.0 * high * high + 2.0 * a2) * high + a1
        if low < high and (at_low > 0.0) != (at_high > 0.0):
            turning[found] = _turning_point(a2, a1, low, high)
            found += 1
        low = high
    turning[found] = end
    count, low, was_out = 0, -end, True
    for piece in range(found + 1):
        high = turning[piece]
        is_out = piece == found or excess(m + d * high, major, minor) > 0.0
        if is_out != was_out:
            s = _root(m, d, major, minor, low, high, is_out)
            t[count] = middle + (rest + s) / speed
            count += 1
        low, was_out = high, is_out
    return count


@kernel
def intersect(tori: Tori, i: int, ray: Ray) -> Crossing:
    """Where the ray meets torus i; u and v are not used."""
    t = local_floats(4)
    for k in range(_crossings(tori, i, ray, t)):
        if t[k] > 0.0:
            return Crossing(t[k], 0.0, 0.0)
    return Crossing(math.inf, 0.0, 0.0)


@kernel
def spans(tori: Tori, i: int, ray: Ray) -> Spans:
    t = local_floats(4)
    for k in range(_crossings(tori, i, ray, t), 4):
        t[k] = math.inf
    return Spans(t[0], 0.0, t[1], 0.0, t[2], 0.0, t[3], 0.0)


crossings = spans


@kernel
def surface(tori: Tori, ray: Ray, hit: Hit) -> SurfacePoint:
    """The point, projected onto the tube around the closest point of the circle."""
    i = hit.row
    major, minor = tori.major[i], tori.minor[i]
    q = local_point(tori, i, at(ray, hit.t))
    rho = math.sqrt(q.x * q.x + q.y * q.y)
    c, n = Vec3(major, 0.0, 0.0), Vec3(0.0, 0.0, 1.0)
    if rho > 0.0:  # else q has been rounded to the axis, 1/u sizes from the eye: any point will do
        c = Vec3(major * q.x / rho, major * q.y / rho, 0.0)
    across = q - c
    distance = length(across)
    if 0.0 < distance < math.inf:
        n = across * (1.0 / distance)
    # Some thirty roundings of numbers up to R + r: c, c + r n, and `excess` of the next ray.
    error = 32.0 * UNIT_ROUNDOFF * (major + minor)
    return world_surface(tori, i, c + n * minor, n, error, tori.material[i], tori.light[i])


@kernel
def uv(tori: Tori, ray: Ray, hit: Hit) -> tuple[float, float]:
    """(phi / 2 pi around the axis from local +x, the same around the tube from the outside
    upwards)."""
    i = hit.row
    q = local_point(tori, i, at(ray, hit.t))
    off = math.sqrt(q.x * q.x + q.y * q.y) - tori.major[i]
    return around(q.y, q.x), around(q.z, off)


@kernel
def tangents(tori: Tori, ray: Ray, hit: Hit) -> Tangents:
    """Around the axis, and around the tube."""
    i = hit.row
    q = local_point(tori, i, at(ray, hit.t))
    rho = math.sqrt(q.x * q.x + q.y * q.y)
    up = Vec3(-q.z * q.x / rho, -q.z * q.y / rho, rho - tori.major[i])
    return Tangents(
        world_vector(tori, i, Vec3(-q.y, q.x, 0.0)) * (2.0 * math.pi),
        world_vector(tori, i, up) * (2.0 * math.pi),
    )
