"""Ray packets: intervals of the origins and inverse directions of neighbouring rays, and the test
whether the rays are coherent."""

import math
from typing import Any, NamedTuple

from reference_rt.accel.bvh import CENTER, Bvh
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import SHORT, surface_error
from reference_rt.core.vec3 import Vec3, component, max_abs
from reference_rt.jit.kernel import kernel, reciprocal
from reference_rt.jit.simd import VECTOR_WIDTH, larger, simd_kernel, smaller

PACKET_SIZE = 16
"""Rays in a packet.  Measured on the bunny, camera rays along rows of 1024 pixels, at a time when
every number was computed for each ray: 8 take 38 ns per ray, 16 take 30, 32 take 31, 64 take
40."""

NARROW = 96.0
"""The largest width of a coherent packet within the tree's box: NARROW / sqrt(references) times
half the size of the box, and at most that half.

Chosen between gain and loss on spheres of triangles, 40 degrees of view.  Time with packets over
time without: 300 triangles 0.78 at 64 pixels a row and 1.31 at 32; 5,292 triangles 0.73 at 128 and
1.30 at 64; 69,312 triangles 0.80 at 256 and 1.32 at 128; a million 0.70 at 1024 and 1.12 at 512."""

_TURNS = 3 * VECTOR_WIDTH
SPAN_FLOATS = 4 * _TURNS + VECTOR_WIDTH


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


@simd_kernel
def _span(o: Any, d: Any, first: Any, boxes: Any, span: Any) -> Any:
    """Componentwise bounds of PACKET_SIZE origins and directions, from float `first` of their
    arrays on.

    Into span (SPAN_FLOATS,): the smallest numbers of o and d, then the largest, each as 3
    VECTOR_WIDTH numbers that are x, y, z in turn and still to be reduced; then how far each child
    of the root reaches beyond the tree's centre.  Returns the mask of lanes whose numbers are all
    finite.
    """
    is_finite = boxes.load(0) <= float("inf")
    for place, vectors in ((0, o), (_TURNS, d)):
        for begin in range(0, 3 * VECTOR_WIDTH, VECTOR_WIDTH):
            low = high = vectors.load(first + begin)
            for more in range(0, 3 * PACKET_SIZE, 3 * VECTOR_WIDTH):
                x = vectors.load(first + (begin + more))
                is_finite = is_finite & (abs(x) < float("inf"))
                low, high = smaller(low, x), larger(high, x)
            span.store(place + begin, low)
            span.store(2 * _TURNS + place + begin, high)
    upper = larger(boxes.load(3 * VECTOR_WIDTH), boxes.load(4 * VECTOR_WIDTH))
    span.store(4 * _TURNS, larger(upper, boxes.load(5 * VECTOR_WIDTH)))
    return is_finite


@kernel
def _lowest(span: FloatArray, place: int) -> Vec3:
    """The smallest x, y and z of the 3 VECTOR_WIDTH numbers of `_span` at `place`."""
    low = Vec3(span[place], span[place + 1], span[place + 2])
    for j in range(place + 3, place + _TURNS, 3):
        low = Vec3(min(low.x, span[j]), min(low.y, span[j + 1]), min(low.z, span[j + 2]))
    return low


@kernel
def _highest(span: FloatArray, place: int) -> Vec3:
    """The largest, as `_lowest`."""
    high = Vec3(span[place], span[place + 1], span[place + 2])
    for j in range(place + 3, place + _TURNS, 3):
        high = Vec3(max(high.x, span[j]), max(high.y, span[j + 1]), max(high.z, span[j + 2]))
    return high


@kernel
def packet_of(bvh: Bvh, o: FloatArray, d: FloatArray, begin: int, span: FloatArray) -> RayPacket:
    """The packet of the PACKET_SIZE rays begin, begin + 1, ...; span (SPAN_FLOATS,) is scratch."""
    is_coherent = _span(o, d, 3 * begin, bvh.boxes, span) == (1 << VECTOR_WIDTH) - 1
    o_low, d_low = _lowest(span, 0), _lowest(span, _TURNS)
    o_high, d_high = _highest(span, 2 * _TURNS), _highest(span, 3 * _TURNS)
    reach = 0.0
    for lane in range(VECTOR_WIDTH):
        reach = max(reach, span[4 * _TURNS + lane])
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
    slope = (max(max_abs(o_low), max_abs(o_high)) + reach) / length
    widest = reach * min(1.0, NARROW / math.sqrt(len(bvh.references)))
    for k in range(3):
        low, high = component(d_low, k), component(d_high, k)
        width = component(o_high, k) - component(o_low, k) + (high - low) * slope
        is_coherent = is_coherent and width <= widest and (low > 0.0 or high < 0.0 or low == high)
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
