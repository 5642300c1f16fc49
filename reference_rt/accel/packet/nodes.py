"""A bundle of rays against the boxes of a hierarchy, all at once or each by itself."""

from typing import Any

from reference_rt.accel.bvh import CENTER, FAR_SLACK, NODE_SINGLES, Bvh
from reference_rt.accel.packet.packet import BUNDLE, Bundle
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import BLOCK
from reference_rt.core.ray_block import Rays
from reference_rt.core.vec3 import component
from reference_rt.jit.kernel import kernel
from reference_rt.jit.simd import LANES, larger, smaller
from reference_rt.jit.simd_kernels import lane_kernel
from reference_rt.shapes.meshes.watertight import Shear

OWN_FLOATS = 12 * BUNDLE


@lane_kernel
def _entered(
    boxes: Any,
    node: Any,
    x: Any,
    y: Any,
    z: Any,
    near_x: Any,
    near_y: Any,
    near_z: Any,
    far_x: Any,
    far_y: Any,
    far_z: Any,
    least_x: Any,
    least_y: Any,
    least_z: Any,
    most_x: Any,
    most_y: Any,
    most_z: Any,
    t_max: Any,
    distances: Any,
) -> Any:
    """The children whose boxes any ray may enter before t_max, and from where on.

    As in `traversal`, with the smaller and the larger of both products.  The NaN of 0 * inf comes
    from `most` alone or from both, and stands first where it has to remain: it limits nothing.
    """
    first = node * NODE_SINGLES

    def enter(row: Any, near: Any, least: Any, most: Any) -> Any:
        side = boxes.load(first + row * LANES) - near
        return smaller(side * least, side * most)

    def leave(row: Any, far: Any, least: Any, most: Any) -> Any:
        side = boxes.load(first + row * LANES) - far
        return larger(side * most, side * least)

    t_in = larger(0.0, enter(x, near_x, least_x, most_x))
    t_in = larger(t_in, enter(y, near_y, least_y, most_y))
    t_in = larger(t_in, enter(z, near_z, least_z, most_z))
    t_out = smaller(t_max, leave(3 - x, far_x, least_x, most_x))
    t_out = smaller(t_out, leave(5 - y, far_y, least_y, most_y))
    t_out = smaller(t_out, leave(7 - z, far_z, least_z, most_z))
    distances.store(0, t_in)
    return t_in <= t_out * FAR_SLACK


@kernel
def enter_together(bvh: Bvh, node: int, bundle: Bundle, t_max: float, distances: FloatArray) -> int:
    """The children of a node that rays of a bundle meet, as bits; into distances (LANES,) how far
    away."""
    return _entered(
        bvh.boxes,
        node,
        bundle.x,
        bundle.y,
        bundle.z,
        bundle.near.x,
        bundle.near.y,
        bundle.near.z,
        bundle.far.x,
        bundle.far.y,
        bundle.far.z,
        bundle.least.x,
        bundle.least.y,
        bundle.least.z,
        bundle.most.x,
        bundle.most.y,
        bundle.most.z,
        t_max,
        distances,
    )


@lane_kernel
def _each(
    rays: Any,
    x: Any,
    y: Any,
    z: Any,
    center_x: Any,
    center_y: Any,
    center_z: Any,
    error_x: Any,
    error_y: Any,
    error_z: Any,
    own: Any,
) -> Any:
    """What each ray needs in leaves, into own (OWN_FLOATS,): near, far and inverse for boxes, see
    `traversal.view_of`, and the shear for triangles by axes x, y, z, see `watertight.shear_of`."""
    place = ((center_x, error_x), (center_y, error_y), (center_z, error_z))
    for j in range(0, BUNDLE, LANES):
        for k, (center, error) in enumerate(place):
            o, d = rays.load(k * BLOCK + j), rays.load((3 + k) * BLOCK + j)
            own.store(k * BUNDLE + j, o - center + error)
            own.store((3 + k) * BUNDLE + j, o - center - error)
            own.store((6 + k) * BUNDLE + j, 1.0 / (d + 0.0))  # of -0 inf too, as in `_slab`
        d_x, d_y, d_z = (rays.load(axis * BLOCK + (3 * BLOCK + j)) for axis in (x, y, z))
        own.store(9 * BUNDLE + j, d_x / d_z)
        own.store(10 * BUNDLE + j, d_y / d_z)
        own.store(11 * BUNDLE + j, 1.0 / d_z)
    return rays.load(0) <= float("inf")


@kernel
def shear_axes(bundle: Bundle) -> tuple[int, int, int]:
    """The axes x, y, z of all shears, see `watertight.shear_of`."""
    x, y = (bundle.axis + 1) % 3, (bundle.axis + 2) % 3
    if component(bundle.least, bundle.axis) < 0.0:
        x, y = y, x
    return x, y, bundle.axis


@kernel
def prepare_each(bvh: Bvh, bundle: Bundle, rays: Rays, own: FloatArray) -> None:
    """Before the first leaf: most bundles of a picture meet none."""
    x, y, z = shear_axes(bundle)
    frame = bvh.frames
    _each(
        rays.numbers,
        x,
        y,
        z,
        frame[0, CENTER],
        frame[0, CENTER + 1],
        frame[0, CENTER + 2],
        bundle.error.x,
        bundle.error.y,
        bundle.error.z,
        own,
    )


@kernel
def shear_in(bundle: Bundle, rays: Rays, j: int, own: FloatArray) -> Shear:
    """That of ray number j of a bundle."""
    x, y, z = shear_axes(bundle)
    o = rays.numbers
    return Shear(
        x,
        y,
        z,
        o[x * BLOCK + j],
        o[y * BLOCK + j],
        o[z * BLOCK + j],
        own[9 * BUNDLE + j],
        own[10 * BUNDLE + j],
        own[11 * BUNDLE + j],
    )


@lane_kernel
def _enter_box(
    own: Any,
    j: Any,
    ends: Any,
    near_x: Any,
    near_y: Any,
    near_z: Any,
    far_x: Any,
    far_y: Any,
    far_z: Any,
) -> Any:
    """Which of LANES rays from number j on enter a box before their ends, as in `traversal`."""
    inverse = [own.load(j + k * BUNDLE) for k in (6, 7, 8)]
    t_in = larger(0.0, (near_x - own.load(j)) * inverse[0])
    t_in = larger(t_in, (near_y - own.load(j + BUNDLE)) * inverse[1])
    t_in = larger(t_in, (near_z - own.load(j + 2 * BUNDLE)) * inverse[2])
    t_out = smaller(ends.load(j), (far_x - own.load(j + 3 * BUNDLE)) * inverse[0])
    t_out = smaller(t_out, (far_y - own.load(j + 4 * BUNDLE)) * inverse[1])
    t_out = smaller(t_out, (far_z - own.load(j + 5 * BUNDLE)) * inverse[2])
    return t_in <= t_out * FAR_SLACK


@kernel
def enter_child(
    bvh: Bvh, place: int, bundle: Bundle, j: int, own: FloatArray, ends: FloatArray
) -> int:
    """Which of LANES rays from number j of a bundle on enter a child before ends[j + lane]."""
    node, lane = place // LANES, place % LANES
    box = bvh.boxes[node]
    return _enter_box(
        own,
        j,
        ends,
        float(box[bundle.x * LANES + lane]),
        float(box[bundle.y * LANES + lane]),
        float(box[bundle.z * LANES + lane]),
        float(box[(3 - bundle.x) * LANES + lane]),
        float(box[(5 - bundle.y) * LANES + lane]),
        float(box[(7 - bundle.z) * LANES + lane]),
    )
