"""Point-in-solid tests of each shape, from its description alone, in its own coordinates."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.vec3 import cross, dot, length, row, triple
from reference_rt.jit.kernel import entry_kernel
from reference_rt.textbook.method import FloatArray

BoolArray = npt.NDArray[np.bool_]


def _in_sphere(shape: Any, q: FloatArray) -> BoolArray:
    """|q - c| < r"""
    return np.asarray(np.sum(np.square(q - shape.center), axis=1) < shape.radius**2)


def _in_box(shape: Any, q: FloatArray) -> BoolArray:
    """max(|x|, |y|, |z|) < 1"""
    return np.asarray(np.abs(q).max(axis=1) < 1.0)


def _below_plane(shape: Any, q: FloatArray) -> BoolArray:
    """z < 0"""
    return np.asarray(q[:, 2] < 0.0)


def _in_torus(shape: Any, q: FloatArray) -> BoolArray:
    """(rho - R)² + z² < r², rho the distance from the axis"""
    off = np.hypot(q[:, 0], q[:, 1]) - shape.major_radius
    return np.asarray(off * off + np.square(q[:, 2]) < shape.minor_radius**2)


def _in_quadric(shape: Any, q: FloatArray) -> BoolArray:
    """f <= 0 in the clip box"""
    x, y, z = q.T
    terms = (x * x, y * y, z * z, x * y, y * z, x * z, x, y, z, np.ones_like(x))
    f = sum(k * term for k, term in zip(shape.coefficients, terms, strict=True))
    return np.asarray((f <= 0.0) & np.all((shape.lower < q) & (q < shape.upper), axis=1))


def _in_cylinder(shape: Any, q: FloatArray) -> BoolArray:
    """rho < r, z_min < z < z_max"""
    rho, z = np.hypot(q[:, 0], q[:, 1]), q[:, 2]
    return np.asarray((rho < shape.radius) & (shape.z_min < z) & (z < shape.z_max))


def _in_cone(shape: Any, q: FloatArray) -> BoolArray:
    """rho < r(z), 0 < z < height"""
    rho, z = np.hypot(q[:, 0], q[:, 1]), q[:, 2]
    width = shape.radius + (shape.top_radius - shape.radius) * (z / shape.height)
    return np.asarray((rho < width) & (z > 0.0) & (z < shape.height))


INSIDE: dict[str, Callable[[Any, FloatArray], BoolArray]] = {
    "sphere": _in_sphere,
    "box": _in_box,
    "plane": _below_plane,
    "torus": _in_torus,
    "quadric": _in_quadric,
    "cylinder": _in_cylinder,
    "cone": _in_cone,
}
"""By a shape's type: (description, points (n, 3) in the shape's own coordinates) -> (n,)."""


@entry_kernel
def _solid_angles(triangles: FloatArray, p: FloatArray, total: FloatArray) -> None:
    for i in range(len(p)):
        total[i] = 0.0
        for k in range(len(triangles)):
            a = triple(triangles, k, 0) - row(p, i)
            b = triple(triangles, k, 1) - row(p, i)
            c = triple(triangles, k, 2) - row(p, i)
            la, lb, lc = length(a), length(b), length(c)
            below = la * lb * lc + dot(a, b) * lc + dot(a, c) * lb + dot(b, c) * la
            total[i] += 2.0 * math.atan2(dot(a, cross(b, c)), below)


def in_closed_mesh(triangles: FloatArray, p: FloatArray) -> BoolArray:
    """Whether points (n, 3) are inside a closed mesh of triangles (m, 9).

    The signed solid angles of the triangles sum to 4 pi times the winding number, which is compared
    with 1/2.  tan(angle / 2) is the quotient in `_solid_angles` (Van Oosterom & Strackee 1983, IEEE
    Trans. Biomed. Eng. 30(2)).
    """
    total = np.empty(len(p))
    _solid_angles(triangles, np.ascontiguousarray(p), total)
    return np.asarray(np.abs(total) > 2.0 * math.pi)
