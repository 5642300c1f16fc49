"""What a ray can hit: the closest-hit and the any-hit query over all shapes of a scene."""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.bvh import FAR_SLACK, STACK_SIZE, Bvh
from reference_rt.kernel import kernel, local_floats, local_integers, reciprocal
from reference_rt.ray import Hit, Ray, no_hit
from reference_rt.shapes import Shapes, triangle
from reference_rt.shapes.shape import FloatArray
from reference_rt.shapes.triangle import shear_of
from reference_rt.vec3 import Vec3


class Packets(NamedTuple):
    """Shapes as `nearest_of` takes them, where no hierarchy leads to them; else None."""

    spheres: FloatArray | None
    rectangles: FloatArray | None
    boxes: FloatArray | None


class Geometry(NamedTuple):
    """All shapes, and the hierarchy over them where they are many enough to need one."""

    shapes: Shapes
    packets: Packets
    bvh: Bvh | None


Columns = tuple[int, int, int]


@kernel
def closest_hit(geometry: Geometry, ray: Ray) -> Hit:
    """The intersection with the smallest t in (0, t_max); `kind` is -1 for none."""
    return _trace(geometry.bvh, geometry.shapes, geometry.packets, ray, False)


@kernel
def occluded(geometry: Geometry, ray: Ray) -> bool:
    """Whether anything lies in (0, t_max): a hierarchy is left at the first thing found."""
    return _trace(geometry.bvh, geometry.shapes, geometry.packets, ray, True).kind >= 0


@kernel
def _trace(bvh: Bvh | None, shapes: Shapes, packets: Packets, ray: Ray, any_hit: bool) -> Hit:
    closest = no_hit(ray)
    if bvh is not None:
        return _traverse(bvh, shapes, ray, any_hit, closest)
    # For a few shapes, asking after each whether the ray is done costs more than testing the rest.
    closest = any_shape.nearest_of(shapes.spheres, packets.spheres, ray, closest)
    closest = any_shape.nearest_of(shapes.rectangles, packets.rectangles, ray, closest)
    closest = any_shape.nearest_of(shapes.boxes, packets.boxes, ray, closest)
    return triangle.intersect_all(shapes.triangles, ray, closest)


@kernel
def _entry(
    boxes: FloatArray, node: int, o: Vec3, inverse: Vec3, near: Columns, t_max: float
) -> float:
    """Where the ray enters a node's box, inf where it misses.

    `near` holds the columns of the near planes: chosen by the sign of d, the 0 * inf of a ray in
    a plane can only be NaN, which max and min pass over: such a plane does not limit the ray.
    """
    x, y, z = near
    t_in = max(0.0, (boxes[node, x] - o.x) * inverse.x)
    t_in = max(t_in, (boxes[node, y] - o.y) * inverse.y)
    t_in = max(t_in, (boxes[node, z] - o.z) * inverse.z)
    t_out = min(math.inf, (boxes[node, 3 - x] - o.x) * inverse.x)
    t_out = min(t_out, (boxes[node, 5 - y] - o.y) * inverse.y)
    t_out = min(t_out, (boxes[node, 7 - z] - o.z) * inverse.z)
    if t_in <= t_out * FAR_SLACK and t_in <= t_max * FAR_SLACK:
        return float(t_in)
    return math.inf


@kernel
def _traverse(bvh: Bvh, shapes: Shapes, ray: Ray, any_hit: bool, closest: Hit) -> Hit:
    """Nearer child first; the other waits on a stack with the distance of its box."""
    stack, distance = local_integers(STACK_SIZE), local_floats(STACK_SIZE)
    inverse = Vec3(reciprocal(ray.d.x), reciprocal(ray.d.y), reciprocal(ray.d.z))
    near = (
        0 if inverse.x > 0.0 else 3,
        1 if inverse.y > 0.0 else 4,
        2 if inverse.z > 0.0 else 5,
    )
    shear = shear_of(ray)
    node, top = 0, 0
    while True:
        if bvh.size[node] > 0:
            begin = bvh.first[node]
            for k in range(begin, begin + bvh.size[node]):
                closest = any_shape.intersect(shapes, bvh.kind[k], bvh.row[k], ray, shear, closest)
            # Asked once a leaf: asked for each primitive it costs a quarter of the speed.
            if any_hit and closest.kind >= 0:
                return closest
        else:
            left = bvh.first[node]
            t_left = _entry(bvh.boxes, left, ray.o, inverse, near, closest.t)
            t_right = _entry(bvh.boxes, left + 1, ray.o, inverse, near, closest.t)
            if t_left < math.inf or t_right < math.inf:
                node = left if t_left <= t_right else left + 1
                if t_left < math.inf and t_right < math.inf:
                    stack[top] = left + 1 if t_left <= t_right else left
                    distance[top] = max(t_left, t_right)
                    top += 1
                continue
        while True:
            if top == 0:
                return closest
            top -= 1
            if distance[top] <= closest.t * FAR_SLACK:
                break
        node = stack[top]
