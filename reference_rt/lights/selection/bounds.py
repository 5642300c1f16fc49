"""Bounds of lights and groups of lights: box, cone of directions, intensity.

The normals of a group's lights are within the angle `spread` of the axis, and the lights emit up to
the angle `reach` from their normals (Conty Estevez & Kulla 2018, "Importance Sampling of Many
Lights with Adaptive Tree Splitting", section 4).
"""

import math
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.vec3 import Vec3, cross, dot, length, normalize
from reference_rt.jit.kernel import kernel
from reference_rt.shapes import TABLES, Shapes


class LightBounds(NamedTuple):
    """For n lights: a box, lower and upper (n, 3); unit axis (n, 3); spread and reach (n,),
    radians; the luminance of the radiant intensity (n,) along the normal, `lambertian` for light
    that falls off with the cosine to it and `even` for light that does not."""

    lower: FloatArray
    upper: FloatArray
    axis: FloatArray
    spread: FloatArray
    reach: FloatArray
    lambertian: FloatArray
    even: FloatArray


def of_areas(shapes: Shapes, kind: IntArray, row: IntArray, intensity: FloatArray) -> LightBounds:
    """Emissive primitives, of kind and row (n,) and with intensity (n,): luminance of radiance
    times area.  A shape that is not flat counts as emitting to all sides."""
    n = len(kind)
    lower, upper, axis = np.zeros((n, 3)), np.zeros((n, 3)), np.tile([0.0, 0.0, 1.0], (n, 1))
    spread = np.full(n, math.pi)
    for code, field, _, module in TABLES:
        mine = kind == code
        if not mine.any():
            continue
        table = getattr(shapes, field)
        low, high = module.bounds(table)
        lower[mine], upper[mine] = low[row[mine]], high[row[mine]]
        if hasattr(module, "unit_normals"):
            axis[mine], spread[mine] = module.unit_normals(table)[row[mine]], 0.0
    return LightBounds(
        lower, upper, axis, spread, np.full(n, 0.5 * math.pi), intensity, np.zeros(n)
    )


def of_points(
    position: FloatArray, axis: FloatArray, reach: FloatArray, intensity: FloatArray
) -> LightBounds:
    """Lights at points: position (n, 3), unit axis (n, 3), the angle from it up to which they shine
    (n,), and the largest luminance of their radiant intensity (n,)."""
    none = np.zeros(len(position))
    return LightBounds(position, position, axis, none, reach, none, intensity)


class Bound(NamedTuple):
    """One row of `LightBounds`."""

    lower: Vec3
    upper: Vec3
    axis: Vec3
    spread: float
    reach: float
    lambertian: float
    even: float


COLUMNS = 13
"""Numbers of a `Bound`, in its order."""


def as_rows(bounds: LightBounds) -> FloatArray:
    """(n, COLUMNS)."""
    return np.concatenate([column.reshape(len(column), -1) for column in bounds], axis=1)


@kernel
def load(rows: FloatArray, i: int) -> Bound:
    r = rows[i]
    return Bound(
        Vec3(r[0], r[1], r[2]),
        Vec3(r[3], r[4], r[5]),
        Vec3(r[6], r[7], r[8]),
        r[9],
        r[10],
        r[11],
        r[12],
    )


@kernel
def store(rows: FloatArray, i: int, b: Bound) -> None:
    r = rows[i]
    r[0], r[1], r[2] = b.lower
    r[3], r[4], r[5] = b.upper
    r[6], r[7], r[8] = b.axis
    r[9], r[10], r[11], r[12] = b.spread, b.reach, b.lambertian, b.even


@kernel
def nothing() -> Bound:
    """The neutral element of `union`."""
    inf, zero = math.inf, Vec3(0.0, 0.0, 0.0)
    return Bound(Vec3(inf, inf, inf), Vec3(-inf, -inf, -inf), zero, -1.0, 0.0, 0.0, 0.0)


@kernel
def union(a: Bound, b: Bound) -> Bound:
    """Both groups as one: the smallest cone of normals that holds both (Conty Estevez & Kulla 2018,
    algorithm 1)."""
    if a.spread < b.spread:
        a, b = b, a
    if b.spread < 0.0:
        return a
    axis, spread = a.axis, a.spread
    perpendicular = cross(a.axis, b.axis)
    sine = length(perpendicular)
    between = math.atan2(sine, dot(a.axis, b.axis))
    if between + b.spread > a.spread:
        spread = 0.5 * (a.spread + between + b.spread)
        # Opposite axes have no plane to turn in.
        if spread >= math.pi or sine == 0.0:
            spread = math.pi
        else:
            turn = spread - a.spread
            side = cross(perpendicular * (1.0 / sine), a.axis)
            axis = normalize(a.axis * math.cos(turn) + side * math.sin(turn))
    return Bound(
        Vec3(min(a.lower.x, b.lower.x), min(a.lower.y, b.lower.y), min(a.lower.z, b.lower.z)),
        Vec3(max(a.upper.x, b.upper.x), max(a.upper.y, b.upper.y), max(a.upper.z, b.upper.z)),
        axis,
        spread,
        max(a.reach, b.reach),
        a.lambertian + b.lambertian,
        a.even + b.even,
    )


@kernel
def cost(b: Bound) -> float:
    """The surface area orientation heuristic (Conty Estevez & Kulla 2018, section 4.3), with the
    square of the diagonal in place of the area, which is 0 for lights on a line.

    The measure of directions is the integral over those within `spread` of the axis, and over those
    up to `reach` beyond with a cosine weight.
    """
    if b.spread < 0.0:
        return 0.0
    size = length(b.upper - b.lower)
    o = b.spread
    w = min(o + b.reach, math.pi)
    beyond = 2.0 * w * math.sin(o) - math.cos(o - 2.0 * w) - 2.0 * o * math.sin(o) + math.cos(o)
    directions = 2.0 * math.pi * (1.0 - math.cos(o)) + 0.5 * math.pi * beyond
    return (b.lambertian + b.even) * directions * size * size
