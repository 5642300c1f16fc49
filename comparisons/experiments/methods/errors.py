"""How far off the barycentrics of the textbook's triangle methods are, by rational arithmetic."""

import math
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.ray import UNIT_ROUNDOFF, Crossing, Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.textbook import TriangleParameters, triangle

RAYS = 16
"""Of each triangle, those aimed at its inside: the median of 8 triangles is known within half."""

Rational = list[Fraction]


def exact(corners: Any, o: npt.ArrayLike, d: npt.ArrayLike) -> Rational:
    """t, u and v of the ray and the triangle's plane: u e1 + v e2 - t d = o - v0 by Cramer's
    rule."""
    v0, v1, v2 = map(_rational, np.asarray(corners))
    e1, e2, s = _minus(v1, v0), _minus(v2, v0), _minus(_rational(o), v0)
    back = [-x for x in _rational(d)]
    whole = _determinant(e1, e2, back)
    columns = (e1, e2, s), (s, e2, back), (e1, s, back)
    return [_determinant(*three) / whole for three in columns]


def _rational(numbers: npt.ArrayLike) -> Rational:
    return [Fraction(float(x)) for x in np.asarray(numbers)]


def _minus(a: Rational, b: Rational) -> Rational:
    return [x - y for x, y in zip(a, b, strict=True)]


def _determinant(a: Rational, b: Rational, c: Rational) -> Fraction:
    cyclic = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    return sum((a[i] * (b[j] * c[k] - b[k] * c[j]) for i, j, k in cyclic), Fraction())


def barycentric_error(
    method: str, trials: Iterable[tuple[TriangleParameters, npt.ArrayLike, npt.ArrayLike]]
) -> float | None:
    """The median, over rays that hit, of the larger error of u and v, in roundings u = 2^-53; inf
    for a ray that is lost.  trials: triangles with origins and directions (n, 3).  None for a
    method without barycentrics."""
    kernel = getattr(triangle, method.partition(".")[2])
    errors = []
    for corners, origins, directions in trials:
        prepared = triangle.prepare(corners)
        rays = zip(np.asarray(origins), np.asarray(directions), strict=True)
        inside = 0
        for o, d in rays:
            right = exact(corners, o, d)[1:]
            if min(*right, 1 - sum(right)) <= 0:
                continue
            with np.errstate(all="ignore"):
                found = kernel(Ray(Vec3(*o), Vec3(*d), math.inf), *prepared)
            if not isinstance(found, Crossing):
                return None
            both = zip((found.u, found.v), right, strict=True)
            hit = math.isfinite(found.t)
            errors.append(max(abs(Fraction(float(x)) - y) for x, y in both) if hit else math.inf)
            inside += 1
            if inside == RAYS:
                break
    return float(np.median(np.array(errors, float))) / UNIT_ROUNDOFF
