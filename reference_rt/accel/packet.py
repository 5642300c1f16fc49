"""Ray packets: intervals of the origins and inverse directions of neighbouring rays, and the test
whether the rays are coherent."""

import functools
import math
import operator
from typing import Any, NamedTuple

from reference_rt.accel.bvh import CENTER, Bvh
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import SHORT, surface_error
from reference_rt.core.vec3 import Vec3, component, max_abs
from reference_rt.jit.kernel import kernel, reciprocal
from reference_rt.jit.simd import (
    LANES,
    VECTOR_WIDTH,
    lanes_where,
    larger,
    least,
    select,
    simd_kernel,
    smaller,
)

TILE = 4
PACKET_SIZE = TILE * TILE
"""Rays in a packet: TILE side by side in each of TILE rows.  Measured on the bunny, camera rays of
a picture 1024 pixels wide, per ray: 16 in a row 24.6 ns, 2 x 8 23.0, 4 x 4 21.1; 32 as 4 x 8 21.4;
64 as 8 x 8 22.5."""

NARROW = 96.0
"""The largest width of a coherent packet within the tree's box: NARROW / sqrt(references) times
half the size of the box, and at most that half.

Chosen between gain and loss on spheres of triangles, 40 degrees of view.  Time with packets over
time without: 300 triangles 0.78 at 64 pixels a row and 1.31 at 32; 5,292 triangles 0.73 at 128 and
1.30 at 64; 69,312 triangles 0.80 at 256 and 1.32 at 128; a million 0.70 at 1024 and 1.12 at 512."""

SPAN_FLOATS = 13 * VECTOR_WIDTH


class RayPacket(NamedTuple):
    """Rays prepared for slab tests, as `single_ray.SlabRay`: bounds of the rays' numbers that make
    boxes nearest or furthest.

    is_coherent: without it the rest means nothing;  near, far: origins relative to the tree's
    centre;  least, most: 1 / d of the smallest and of the largest magnitude;  error: the
    displacement of the origins, with the sign of d;  x, y, z: the rows of near planes;  axis: that
    of the largest component of all d.
    """

    is_coherent: bool
    near: Vec3
    far: Vec3
    least: Vec3
    most: Vec3
    error: Vec3
    x: int
    y: int
    z: int
    axis: int


@kernel
def may_be_coherent(first: Vec3, last: Vec3) -> bool:
    """A quick test of the first and the last direction: rejects most groups of random rays for a
    few per cent of their time.  `packet_of` decides on the others."""
    length = 0.25 * max_abs(first)
    off = last - first
    return abs(off.x) <= length and abs(off.y) <= length and abs(off.z) <= length


@kernel
def ray_number(begin: int, width: int, j: int) -> int:
    """The number of ray j of a packet: it has TILE rays from ray `begin` on, and as many in each of
    the following rows, `width` rays further on; TILE is the width of rays that are in no rows."""
    return begin + (j // TILE) * width + j % TILE


@simd_kernel
def _span(o: Any, d: Any, first: Any, across: Any, boxes: Any, span: Any) -> Any:
    """Componentwise bounds of PACKET_SIZE origins and directions, from float `first` of their
    arrays on, rows `across` floats apart.

    Into span (SPAN_FLOATS,), each VECTOR_WIDTH times: the smallest x, y and z of o, the largest,
    and those of d; then how far each child of the root reaches beyond the tree's centre.  Returns
    the mask of lanes in which the sum of all numbers is finite.
    """
    sums = []
    # The coordinates x, y, z in turn of TILE rays are two vectors, which overlap.
    starts = 0, 3 * TILE - VECTOR_WIDTH
    for place, vectors in ((0, o), (6 * VECTOR_WIDTH, d)):
        lows, highs = [], []
        for start in starts:
            rows = [vectors.load(first + (across * row + start)) for row in range(TILE)]
            sums.append(functools.reduce(operator.add, rows))
            lows.append(functools.reduce(smaller, rows))
            highs.append(functools.reduce(larger, rows))
        for axis in range(3):
            low, high = math.inf, -math.inf
            for start, some_low, some_high in zip(starts, lows, highs, strict=True):
                here = lanes_where([(start + k) % 3 == axis for k in LANES], some_low)
                low, high = select(here, some_low, low), select(here, some_high, high)
            span.store(place + axis * VECTOR_WIDTH, least(low))
            span.store(place + (3 + axis) * VECTOR_WIDTH, -least(-high))
    upper = larger(boxes.load(3 * VECTOR_WIDTH), boxes.load(4 * VECTOR_WIDTH))
    span.store(12 * VECTOR_WIDTH, larger(upper, boxes.load(5 * VECTOR_WIDTH)))
    return abs(functools.reduce(operator.add, sums)) < math.inf


@kernel
def _bound(span: FloatArray, k: int) -> Vec3:
    """x, y and z of the bounds number k of `_span`."""
    at = 3 * VECTOR_WIDTH * k
    return Vec3(span[at], span[at + VECTOR_WIDTH], span[at + 2 * VECTOR_WIDTH])


@kernel
def packet_of(
    bvh: Bvh, o: FloatArray, d: FloatArray, begin: int, width: int, span: FloatArray
) -> RayPacket:
    """The packet of PACKET_SIZE rays, see `ray_number`; span (SPAN_FLOATS,) is scratch."""
    finite = _span(o, d, 3 * begin, 3 * width, bvh.boxes, span)
    is_coherent = finite == (1 << VECTOR_WIDTH) - 1
    o_low, o_high, d_low, d_high = (
        _bound(span, 0),
        _bound(span, 1),
        _bound(span, 2),
        _bound(span, 3),
    )
    reach = 0.0
    for lane in range(VECTOR_WIDTH):
        reach = max(reach, span[12 * VECTOR_WIDTH + lane])
    steep = Vec3(
        _least_abs(d_low.x, d_high.x),
        _least_abs(d_low.y, d_high.y),
        _least_abs(d_low.z, d_high.z),
    )
    axis = 2
    if steep.x > steep.y and steep.x > steep.z:
        axis = 0
    elif steep.y > steep.z:
        axis = 1
    frame = bvh.frames
    size = frame[0, CENTER + 3]
    # As in `slab_ray_of`, for a point as far from 0 as any of the origins.
    far_out = Vec3(
        max(abs(o_low.x), abs(o_high.x)),
        max(abs(o_low.y), abs(o_high.y)),
        max(abs(o_low.z), abs(o_high.z)),
    )
    error = surface_error(far_out, far_out, 3.0 * size)
    center = Vec3(frame[0, CENTER], frame[0, CENTER + 1], frame[0, CENTER + 2])
    o_low, o_high = o_low - center, o_high - center
    length = component(steep, axis)
    is_coherent = is_coherent and SHORT <= length <= 1.0 / SHORT
    # Times `length`, and squared, which spares a division and a square root.
    far = max(max_abs(o_low), max_abs(o_high)) + reach
    widest = reach * length
    for k in range(3):
        low, high = component(d_low, k), component(d_high, k)
        extent = (component(o_high, k) - component(o_low, k)) * length + (high - low) * far
        is_narrow = extent * extent * len(bvh.references) <= NARROW * NARROW * widest * widest
        is_coherent = is_coherent and is_narrow and extent <= widest
        is_coherent = is_coherent and (low > 0.0 or high < 0.0 or low == high)
        # Along `axis` within the range of lengths that `scaled` does not change.
        longest = max(abs(low), abs(high))
        is_coherent = is_coherent and (longest <= 1.0 / SHORT if k == axis else longest < length)
    x = _slab(o_low.x, o_high.x, d_low.x, d_high.x, error)
    y = _slab(o_low.y, o_high.y, d_low.y, d_high.y, error)
    z = _slab(o_low.z, o_high.z, d_low.z, d_high.z, error)
    return RayPacket(
        is_coherent,
        Vec3(x.near, y.near, z.near),
        Vec3(x.far, y.far, z.far),
        Vec3(x.least, y.least, z.least),
        Vec3(x.most, y.most, z.most),
        Vec3(x.error, y.error, z.error),
        0 if x.least > 0.0 else 3,
        1 if y.least > 0.0 else 4,
        2 if z.least > 0.0 else 5,
        axis,
    )


@kernel
def _least_abs(low: float, high: float) -> float:
    """The smallest magnitude between two numbers of one sign."""
    return min(abs(low), abs(high))


class _Slab(NamedTuple):
    near: float
    far: float
    least: float
    most: float
    error: float


@kernel
def _slab(o_low: float, o_high: float, d_low: float, d_high: float, error: float) -> _Slab:
    """One axis of `RayPacket`.  Rounding is monotonic: bounds of the operands give bounds of the
    result.  Where d is 0 for all rays the inverse is inf, whatever the sign of the zeros."""
    if d_low < 0.0:
        return _Slab(o_low - error, o_high + error, 1.0 / d_low, reciprocal(d_high), -error)
    return _Slab(
        o_high + error, o_low - error, reciprocal(d_high + 0.0), reciprocal(d_low + 0.0), error
    )
