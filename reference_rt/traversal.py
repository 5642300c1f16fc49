"""Rays against the boxes of a hierarchy: slabs that rounding cannot make too small."""

import math
from typing import NamedTuple

from reference_rt.bvh import FAR_SLACK, Bvh
from reference_rt.kernel import kernel, reciprocal
from reference_rt.ray import Ray, surface_error
from reference_rt.vec3 import Vec3

Columns = tuple[int, int, int]


class View(NamedTuple):
    """A ray as boxes see it.

    near, far: its origin, moved so that every box's near planes come nearer and the far ones go
    further by the rounding of what is inside;  inverse: 1 / d;  columns of the near planes.
    """

    near: Vec3
    far: Vec3
    inverse: Vec3
    columns: Columns


@kernel
def view_of(bvh: Bvh, root: int, ray: Ray) -> View:
    """Once per ray and hierarchy."""
    inverse = Vec3(reciprocal(ray.d.x), reciprocal(ray.d.y), reciprocal(ray.d.z))
    columns = (
        0 if inverse.x > 0.0 else 3,
        1 if inverse.y > 0.0 else 4,
        2 if inverse.z > 0.0 else 5,
    )
    reach = 0.0
    for k in range(6):
        reach = max(reach, abs(bvh.nodes[root, k]))
    # Primitives find hits outside of their bounds by as much as their points are uncertain.
    error = surface_error(ray.o, ray.o, reach)
    x, y, z = (
        math.copysign(error, inverse.x),
        math.copysign(error, inverse.y),
        math.copysign(error, inverse.z),
    )
    return View(
        Vec3(ray.o.x + x, ray.o.y + y, ray.o.z + z),
        Vec3(ray.o.x - x, ray.o.y - y, ray.o.z - z),
        inverse,
        columns,
    )


@kernel
def entry(bvh: Bvh, node: int, view: View, t_max: float) -> float:
    """Where the ray enters a node's box, inf where it misses.

    The columns of the near planes are chosen by the sign of d: the 0 * inf of a ray in a plane can
    only be NaN, which max and min pass over: such a plane does not limit the ray.
    """
    boxes = bvh.nodes
    x, y, z = view.columns
    t_in = max(0.0, (boxes[node, x] - view.near.x) * view.inverse.x)
    t_in = max(t_in, (boxes[node, y] - view.near.y) * view.inverse.y)
    t_in = max(t_in, (boxes[node, z] - view.near.z) * view.inverse.z)
    t_out = min(math.inf, (boxes[node, 3 - x] - view.far.x) * view.inverse.x)
    t_out = min(t_out, (boxes[node, 5 - y] - view.far.y) * view.inverse.y)
    t_out = min(t_out, (boxes[node, 7 - z] - view.far.z) * view.inverse.z)
    if t_in <= t_out * FAR_SLACK and can_be_nearer(t_in, t_max):
        return float(t_in)
    return math.inf


@kernel
def can_be_nearer(t_in: float, t_max: float) -> bool:
    """Whether a box entered at t_in can hold something at t_max or before."""
    return t_in <= t_max * FAR_SLACK
