"""Instances: copies of a group of shapes, which is stored once, each under its own map."""

from typing import Literal, NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray, SurfacePoint
from reference_rt.core.vec3 import length, normalize
from reference_rt.jit.kernel import kernel
from reference_rt.shapes.placement import (
    local_ray,
    world_covector,
    world_error,
    world_point,
    world_vector,
)
from reference_rt.shapes.shape import Shape, Tangents


class Instance(Shape):
    """A copy of a group's shapes, which are stored once, under a transform."""

    type: Literal["instance"] = "instance"
    group: str
    """Name of the group in the scene's `groups`."""


class Instances(NamedTuple):
    """n instances: center (n, 3), to_local (n, 9) and edges (n, 9), see `shapes.placement`; root
    (n,), the root of the BVH over the group's shapes; owner (n,), the shape id in the scene; copy
    (n,), the number of the copy, since a group that contains instances has many of one shape id."""

    center: FloatArray
    to_local: FloatArray
    edges: FloatArray
    root: IntArray
    owner: IntArray
    copy: IntArray


@kernel
def ray_in(instances: Instances | None, i: int, ray: Ray) -> Ray:
    """The ray in the coordinates of the group of instance i; unchanged for i = -1."""
    if instances is None:
        return ray
    if i < 0:
        return ray
    return local_ray(instances, i, ray)


@kernel
def out_of(instances: Instances | None, i: int, point: SurfacePoint) -> SurfacePoint:
    """A point of a group's surface, in the world; unchanged for i = -1."""
    if instances is None:
        return point
    if i < 0:
        return point
    p = world_point(instances, i, point.p)
    covector = world_covector(instances, i, point.n)
    covector_length = length(covector)
    error = world_error(instances, i, p, point.p, point.n, covector_length, point.error)
    return SurfacePoint(
        p,
        covector * (1.0 / covector_length),
        normalize(world_covector(instances, i, point.ns)),
        error,
        point.material,
        point.light,
    )


@kernel
def tangents_out_of(instances: Instances | None, i: int, tangents: Tangents) -> Tangents:
    """Tangents to a group's surface, in the world; unchanged for i = -1."""
    if instances is None:
        return tangents
    if i < 0:
        return tangents
    return Tangents(
        world_vector(instances, i, tangents.dpdu), world_vector(instances, i, tangents.dpdv)
    )
