"""Plane: z = 0 without end, normal +z, under an affine map."""

import math
from typing import Literal

import numpy as np

from reference_rt.core.arrays import Bounds
from reference_rt.core.ray import Crossing, Hit, Ray, SurfacePoint
from reference_rt.core.vec3 import dot, row
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.flat import base
from reference_rt.shapes.shape import Shape, Spans, TabulationContext, Tangents, no_spans, one_span


class Plane(Shape):
    """The infinite plane z = 0 with normal +z; as a solid, the half-space below it."""

    type: Literal["plane"] = "plane"

    def tabulate(self, context: TabulationContext) -> "Planes":
        return Planes(**base.facing_z(self.map_in(context), context))


class Planes(base.Flats):
    """n planes."""


def bounds(planes: Planes) -> Bounds:
    """Everywhere."""
    return np.full(planes.center.shape, -np.inf), np.full(planes.center.shape, np.inf)


@kernel
def intersect(planes: Planes, i: int, ray: Ray) -> Crossing:
    """Where the ray meets plane i, from the front or from behind; a parallel ray misses, also one
    in the plane."""
    return base.meet(planes, i, ray)


@kernel
def spans(planes: Planes, i: int, ray: Ray) -> Spans:
    """The half space below plane i; a line in the plane stays outside."""
    above = base.signed_distance(planes, i, ray.o)
    slope = dot(ray.d, row(planes.normal, i))
    if slope > 0.0:
        return one_span(-math.inf, 0.0, -above / slope, 0.0)
    if slope < 0.0:
        return one_span(-above / slope, 0.0, math.inf, 0.0)
    if above < 0.0:
        return one_span(-math.inf, 0.0, math.inf, 0.0)
    return no_spans()


@kernel
def surface(planes: Planes, ray: Ray, hit: Hit) -> SurfacePoint:
    x, y = base.coordinates(planes, hit.row, ray, hit.t)  # of a solid, hit.u and hit.v are not set
    return base.surface_at(planes, hit.row, x, y)


@kernel
def uv(planes: Planes, ray: Ray, hit: Hit) -> tuple[float, float]:
    """The local x and y."""
    return base.coordinates(planes, hit.row, ray, hit.t)


@kernel
def tangents(planes: Planes, ray: Ray, hit: Hit) -> Tangents:
    return Tangents(row(planes.x_edge, hit.row), row(planes.y_edge, hit.row))
