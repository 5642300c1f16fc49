"""CSG solids by interval lists, and by inside tests between all crossings (row T12).

Both begin with the crossings of the ray's line with each operand, computed by the renderer's own
kernels.  The interval method then uses only the intervals in which the line is inside an operand;
the other uses only point-in-operand tests, which `inside` computes from the description.  The
renderer does neither: `accel.csg` walks through the crossings in order, and merges those
that rounding cannot separate."""

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import IntArray
from reference_rt.core.transform import apply_points
from reference_rt.core.vec3 import cross, dot, length, row, triple
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.textbook.method import FloatArray, family
from reference_rt.textbook.operands import (
    INTERSECTION,
    UNION,
    Combination,
    CsgParameters,
    Operand,
    Tree,
    boundaries,
    leaves,
    prepare,
    trimmed,
    type_of,
)

# ---- point-in-solid tests of each shape, from its description alone, in its own coordinates ------


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


# ---- intervals ----------------------------------------------------------------------------------


@kernel
def holds(operation: int, in_a: bool, in_b: bool) -> bool:
    """Whether a point is inside the combination of a and b."""
    if operation == UNION:
        return in_a or in_b
    if operation == INTERSECTION:
        return in_a and in_b
    return in_a and not in_b


@entry_kernel
def _combine(operation: int, a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    """Merge boundaries (n, j) and (n, k) into (n, j + k): sweep both in order, those at the same t
    together, and keep the ones where the combination changes."""
    for r in range(len(out)):
        i, j, n = 0, 0, 0
        in_a, in_b, inside = False, False, False
        while True:
            t = math.inf
            if i < a.shape[1]:
                t = a[r, i]
            if j < b.shape[1]:
                t = min(t, b[r, j])
            if t == math.inf:
                break
            while i < a.shape[1] and a[r, i] == t:
                in_a = not in_a
                i += 1
            while j < b.shape[1] and b[r, j] == t:
                in_b = not in_b
                j += 1
            if holds(operation, in_a, in_b) != inside:
                inside = not inside
                out[r, n] = t
                n += 1


def interval_list(tree: Tree, o: FloatArray, d: FloatArray) -> FloatArray:
    """The boundaries of a tree: see `boundaries`."""
    if isinstance(tree, Operand):
        return boundaries(tree, o, d)

    def combined(a: FloatArray, b: FloatArray) -> FloatArray:
        out = np.full((len(o), a.shape[1] + b.shape[1]), math.inf)
        _combine(tree.operation, a, b, out)
        return trimmed(out)

    return functools.reduce(combined, (interval_list(part, o, d) for part in tree.of))


def intervals(tree: Tree, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    """Combine the operands' inside intervals pairwise up the tree; the first end at t > 0.

    Cost: of k crossings in all, one compare each at every level of the tree above them.
    Fails: where faces coincide.  Crossings that should be equal differ by rounding, and a film or a
    gap of that thickness remains between them: for a rotated box minus one side of it, measured, up
    to half of the rays through the removed part hit a film.  A ray that leaves a surface may hit it
    again at once.
    """
    ends = interval_list(tree, o, d)
    np.min(np.where(ends > 0.0, ends, math.inf), axis=1, initial=math.inf, out=t)


# ---- inside tests -------------------------------------------------------------------------------


def contains(tree: Tree, p: FloatArray) -> BoolArray:
    """Whether points (n, 3) are inside."""
    if isinstance(tree, Combination):
        first, *others = (contains(part, p) for part in tree.of)
        if tree.operation == INTERSECTION:
            return np.asarray(np.logical_and.reduce([first, *others]))
        if tree.operation == UNION:
            return np.asarray(np.logical_or.reduce([first, *others]))
        return np.asarray(first & ~np.logical_or.reduce([np.zeros_like(first), *others]))
    if tree.shapes.triangles is not None:
        return in_closed_mesh(tree.shapes.triangles.vertices, p)
    if type_of(tree.shape) not in INSIDE:
        raise ValueError(
            f"no inside test for a {type_of(tree.shape)}; expected one of "
            f"{', '.join(INSIDE)} or a closed mesh"
        )
    return INSIDE[type_of(tree.shape)](tree.shape, apply_points(tree.to_own, p))


def inside_tests(tree: Tree, o: FloatArray, d: FloatArray, t: FloatArray) -> None:
    """Sort all crossings of all operands: one is on the solid's surface if exactly one of the
    points before and after it is inside the solid.

    These points are the midpoints between consecutive crossings.
    Cost: for each of k crossings up to the visible one, the inside tests of all operands.
    Fails: as `intervals` does, though less: the inside tests round differently from the crossings,
    and often no point is inside a film.  For the same box, one ray in ten hits one.
    """
    every = np.concatenate([boundaries(operand, o, d) for operand in leaves(tree)], axis=1)
    ahead = np.sort(np.where(every > 0.0, every, math.inf), axis=1)
    again = np.pad(ahead[:, 1:] == ahead[:, :-1], ((0, 0), (1, 0)))
    ahead = trimmed(np.where(again, math.inf, ahead))
    ahead = np.pad(ahead, ((0, 0), (0, 1)), constant_values=math.inf)
    t[:] = math.inf
    searching = np.flatnonzero(ahead[:, 0] < math.inf)
    before = _contains_at(tree, o, d, searching, 0.5 * ahead[searching, 0])
    for k in range(ahead.shape[1] - 1):
        here, following = ahead[searching, k], ahead[searching, k + 1]
        # Beyond the last crossing, any point will do.
        end = np.where(following < math.inf, following, 2.0 * here)
        after = _contains_at(tree, o, d, searching, here + 0.5 * (end - here))
        shows = before != after
        t[searching[shows]] = here[shows]
        on = ~shows & (following < math.inf)
        searching, before = searching[on], after[on]


def _contains_at(
    tree: Tree, o: FloatArray, d: FloatArray, rays: IntArray, t: FloatArray
) -> BoolArray:
    """`contains` at the points of these rays at t."""
    return contains(tree, o[rays] + t[:, None] * d[rays])


_method = family("csg", "T12", CsgParameters, prepare)

METHODS = (
    _method(
        "intervals",
        "lists of intervals, combined pairwise along the tree",
        "Roth 1982, Computer Graphics and Image Processing 18(2)",
        intervals,
    ),
    _method(
        "inside_tests",
        "all crossings; those where points before and after differ",
        "Tilove 1980, IEEE Transactions on Computers 29(10)",
        inside_tests,
    ),
)
