"""The surfaces of shapes by the equations of their descriptions' numbers, in a shape's own space.

Nothing here knows our tables, our kernels or Mitsuba's.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.shapes import (
    Box,
    Cone,
    Cylinder,
    Disk,
    Plane,
    Quadric,
    Rectangle,
    Sphere,
    Torus,
)
from reference_rt.shapes.shape import Shape


class Surface(NamedTuple):
    """A surface f = 0 in the shape's own space.  f: its values (n,) at points (n, 3), in units of
    length;  gradient: of f, or of the side of it that a point is on, (n, 3);  half: half of the
    size of a box around it."""

    f: Callable[[FloatArray], FloatArray]
    gradient: Callable[[FloatArray], FloatArray]
    middle: tuple[float, float, float]
    half: tuple[float, float, float]


def _sphere(shape: Sphere) -> Surface:
    c, r = np.array(shape.center), shape.radius
    return Surface(
        lambda q: np.linalg.norm(q - c, axis=1) - r, lambda q: q - c, shape.center, (r, r, r)
    )


def _box(shape: Box) -> Surface:
    def gradient(q: FloatArray) -> FloatArray:
        axis = np.abs(q).argmax(axis=1)
        n = np.zeros_like(q)
        rows = np.arange(len(q))
        n[rows, axis] = np.sign(q[rows, axis])
        return n

    return Surface(lambda q: np.abs(q).max(axis=1) - 1.0, gradient, (0, 0, 0), (1, 1, 1))


def _flat(inside: Callable[[FloatArray], FloatArray], half: float) -> Surface:
    """In the plane z = 0.  inside: at most 0 within the outline."""
    return Surface(
        lambda q: np.maximum(np.abs(q[:, 2]), inside(q)),
        lambda q: np.tile([0.0, 0.0, 1.0], (len(q), 1)),
        (0, 0, 0),
        (half, half, 0.0),
    )


def _disk(shape: Disk) -> Surface:
    return _flat(lambda q: np.hypot(q[:, 0], q[:, 1]) - 1.0, 1.0)


def _rectangle(shape: Rectangle) -> Surface:
    return _flat(lambda q: np.abs(q[:, :2]).max(axis=1) - 1.0, 1.0)


def _plane(shape: Plane) -> Surface:
    return _flat(lambda q: np.full(len(q), -np.inf), 1.0)


def _round(
    shape: Cylinder | Cone, radius: Callable[[FloatArray], FloatArray], low: float, high: float
) -> Surface:
    """Of revolution about the z axis.  radius: at each z."""
    most = float(radius(np.array([low, high])).max())
    slope = float(np.diff(radius(np.array([low, high])))[0]) / (high - low)

    def f(q: FloatArray) -> FloatArray:
        r, z = np.hypot(q[:, 0], q[:, 1]), q[:, 2]
        side = np.abs(r - radius(z))
        outside = np.maximum(low - z, z - high)
        side = np.maximum(side, outside)
        if not shape.capped:
            return side
        cap = np.minimum(np.abs(z - low), np.abs(z - high))
        return np.minimum(side, np.maximum(cap, r - radius(np.clip(z, low, high))))

    def gradient(q: FloatArray) -> FloatArray:
        r, z = np.hypot(q[:, 0], q[:, 1]), q[:, 2]
        n = np.column_stack([q[:, 0], q[:, 1], -slope * r])
        ends = np.abs(r - radius(z)) > np.minimum(np.abs(z - low), np.abs(z - high))
        n[ends] = 0.0
        n[ends, 2] = np.where(z[ends] > (low + high) / 2.0, 1.0, -1.0)
        return n

    middle = (0.0, 0.0, (low + high) / 2.0)
    return Surface(f, gradient, middle, (most, most, (high - low) / 2.0))


def _cylinder(shape: Cylinder) -> Surface:
    return _round(shape, lambda z: np.full(len(z), shape.radius), shape.z_min, shape.z_max)


def _cone(shape: Cone) -> Surface:
    def radius(z: FloatArray) -> FloatArray:
        return shape.radius + (shape.top_radius - shape.radius) * z / shape.height

    return _round(shape, radius, 0.0, shape.height)


def _torus(shape: Torus) -> Surface:
    major, minor = shape.major_radius, shape.minor_radius

    def f(q: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(np.hypot(q[:, 0], q[:, 1]) - major, q[:, 2]) - minor)

    def gradient(q: FloatArray) -> FloatArray:
        r = np.hypot(q[:, 0], q[:, 1])
        return np.column_stack([q[:, :2] * (1.0 - major / r)[:, None], q[:, 2]])

    around = major + minor
    return Surface(f, gradient, (0, 0, 0), (around, around, minor))


def _quadric(shape: Quadric) -> Surface:
    a, b, c, d, e, f_, g, h, i, j = shape.coefficients
    low, high = np.array(shape.lower), np.array(shape.upper)

    def gradient(q: FloatArray) -> FloatArray:
        x, y, z = q.T
        return np.column_stack(
            [
                2 * a * x + d * y + f_ * z + g,
                d * x + 2 * b * y + e * z + h,
                f_ * x + e * y + 2 * c * z + i,
            ]
        )

    def f(q: FloatArray) -> FloatArray:
        x, y, z = q.T
        value = x * (a * x + d * y + f_ * z + g) + y * (b * y + e * z + h) + z * (c * z + i) + j
        # Divided by its slope it is a length, next to the surface.
        slope = np.linalg.norm(gradient(q), axis=1)
        side = np.abs(value) / np.where(slope > 0.0, slope, 1.0)
        outside = np.maximum(low - q, q - high).max(axis=1)
        on_face = np.minimum(np.abs(q - low), np.abs(q - high)).min(axis=1)
        surface = np.maximum(side, outside)
        both = np.minimum(surface, np.maximum(on_face, outside)) if shape.capped else surface
        return np.asarray(both)

    middle, half = (low + high) / 2.0, (high - low) / 2.0
    return Surface(f, gradient, tuple(middle.tolist()), tuple(half.tolist()))


EQUATIONS: dict[type[Shape], Callable[[Any], Surface]] = {
    Sphere: _sphere,
    Box: _box,
    Disk: _disk,
    Rectangle: _rectangle,
    Plane: _plane,
    Cylinder: _cylinder,
    Cone: _cone,
    Torus: _torus,
    Quadric: _quadric,
}
