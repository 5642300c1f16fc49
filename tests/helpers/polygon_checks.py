"""Polygons for tests, and which points are inside by definition."""

import math

import numpy as np
from builders import shapes_in_order

import reference_rt as rt
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes.flat import polygon


def regular(n, radius=1.0):
    """The corners of a regular n-gon."""
    phi = 2 * math.pi * np.arange(n) / n
    return tuple(zip((radius * np.cos(phi)).tolist(), (radius * np.sin(phi)).tolist(), strict=True))


def square(low, high, clockwise=False):
    ring = ((low, low), (high, low), (high, high), (low, high))
    return ring[::-1] if clockwise else ring


EIGHT = ((0, 0), (2, 2), (2, 0), (0, 2))


def winding(x, y, edges):
    """The winding number about (x, y) by the crossings right of it; half open at the bottom and on
    the left; exact where the arithmetic of x, y and the edges is."""
    number = 0
    for a_x, a_y, b_x, b_y in edges:
        if (a_y > y) != (b_y > y):
            side = (a_x - x) * (b_y - y) - (a_y - y) * (b_x - x)
            number += int(b_y > y and side > 0) - int(a_y > y and side < 0)
    return number


def edges_of(rings):
    return [(*a, *b) for r in rings for a, b in zip(r, (*r[1:], r[0]), strict=True)]


def seen_from_above(shape, points):
    """Whether rays down -z hit the shape (n,)."""
    o = np.column_stack([np.asarray(points, float), np.ones(len(points))])
    return np.isfinite(rt.Scene(shapes=(shape,)).intersect(o, [[0, 0, -1]] * len(o)).t)


@entry_kernel
def _count(polygons, o, d, out):
    for i in range(len(o)):
        for k in range(len(polygons.owner)):
            if polygon.intersect(polygons, k, Ray(row(o, i), row(d, i), math.inf)).t < math.inf:
                out[i] += 1


def count(shapes, o, d):
    """How many of the polygons each ray hits (n,)."""
    tables, _ = shapes_in_order(shapes)
    out = np.zeros(len(o), np.int64)
    with np.errstate(all="ignore"):
        _count(tables.polygons, np.ascontiguousarray(o), np.ascontiguousarray(d), out)
    return out
