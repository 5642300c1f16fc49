"""A ray's crossings with a closed mesh, an operand of a solid, in order; and its origin's winding
number."""

import math
from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.accel.bvh import NOTHING, WIDE_STACK, Bvh, first_of, row_of, size_of
from reference_rt.accel.single_ray import enter, nearest_child, slab_ray_of
from reference_rt.core.ray import Ray
from reference_rt.jit.kernel import kernel, local_floats, local_integers
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes import TRIANGLE, Shapes
from reference_rt.shapes.meshes.watertight import shear_of


class Step(NamedTuple):
    """A crossing: t, inf for none; the triangle and its barycentrics; sign, +1 where the ray goes
    in, -1 where it comes out."""

    t: float
    row: int
    u: float
    v: float
    sign: int


@kernel
def next_mesh_crossing(
    shapes: Shapes, bvh: Bvh, root: int, ray: Ray, after: float, row: int
) -> Step:
    """The first crossing of a mesh that comes after (t = `after`, `row`), ordered by t and then by
    row, so that none is skipped where several have the same t."""
    found, _ = _walk(shapes, bvh, root, ray, after, row, False)
    return found


@kernel
def winding(shapes: Shapes, bvh: Bvh, root: int, ray: Ray) -> int:
    """The winding number of a closed mesh about the ray's origin: 0 outside, 1 inside."""
    _, total = _walk(shapes, bvh, root, ray, 0.0, -1, True)
    return -total


@kernel
def _walk(
    shapes: Shapes, bvh: Bvh, root: int, ray: Ray, after: float, row: int, total: bool
) -> tuple[Step, int]:
    """(the next crossing, with `total` the sum of the signs of all crossings at t > 0)."""
    found, balance = Step(math.inf, -1, 0.0, 0.0, 0), 0
    stack, waiting = local_integers(WIDE_STACK), local_floats(WIDE_STACK)
    distances = local_floats(VECTOR_WIDTH)
    slab_ray, shear = slab_ray_of(bvh, root, ray), shear_of(ray)
    node, top = root, 0
    while True:
        while node >= 0:
            met = enter(bvh, node, slab_ray, math.inf if total else found.t, distances)
            if met == 0:
                node = NOTHING
            else:
                node, top = nearest_child(bvh, node, met, distances, stack, waiting, top)
        begin = first_of(node)
        for k in range(begin, begin + size_of(node)):
            i = row_of(bvh, k)
            t, u, v = any_shape.intersect(shapes, TRIANGLE, i, ray, shear)
            if t < math.inf and (t > after or (t == after and i > row)):
                if t < found.t or (t == found.t and i < found.row):
                    found = Step(t, i, u, v, any_shape.enters(shapes, TRIANGLE, i, shear))
                if total:
                    balance += any_shape.enters(shapes, TRIANGLE, i, shear)
        if top == 0:
            return found, balance
        top -= 1
        node = stack[top]
