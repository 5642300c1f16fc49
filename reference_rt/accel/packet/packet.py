"""Rays that go through a hierarchy together, because they see the same boxes.

A node is asked once for all rays of a bundle, with intervals in place of their origins and
inverse directions: a box that any of the rays enters is entered.  In a leaf each ray is asked by
itself, as if it had come alone, and so finds what it would find alone, to the last bit.
"""

import math
from typing import Any, NamedTuple

from reference_rt.accel.bvh import CENTER, Bvh
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import surface_error
from reference_rt.core.scaled_ray import SHORT
from reference_rt.core.vec3 import Vec3, component, max_abs
from reference_rt.jit.kernel import kernel, reciprocal
from reference_rt.jit.simd import LANES, larger, smaller
from reference_rt.jit.simd_kernels import lane_kernel

BUNDLE = 16
"""Rays of a bundle.  Measured on the bunny, camera rays along the rows of 1024 pixels, when all
numbers were made for each ray: 8 take 38 ns each, 16 take 30, 32 take 31, 64 take 40."""

NARROW = 96.0
"""How wide a bundle may be where it is in the tree: that share of half the tree, over the root of
the number of references, and no more than that half.

Between what gained and what lost on spheres of triangles seen with 40 degrees.  Time with bundles
over that without: of 300 triangles 0.78 for 64 pixels a row and 1.31 for 32, of 5,292 0.73 for 128
and 1.30 for 64, of 69,312 0.80 for 256 and 1.32 for 128, of a million 0.70 for 1024 and 1.12 for
512."""

_TURNS = 3 * LANES
SPAN_FLOATS = 4 * _TURNS + LANES


class Bundle(NamedTuple):
    """Rays as boxes see them, see `traversal.View`; of each number what makes boxes nearest or
    furthest.

    together: whether they can go together, else the rest means nothing;  near, far: origins
    relative to the tree's centre;  least, most: 1 / d, by magnitude;  error: how far origins were
    moved, with the sign of d;  x, y, z: the rows of near planes;  axis: the largest of d.
    """

    together: bool
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
def are_alike(first: Vec3, last: Vec3) -> bool:
    """Whether directions may be those of a bundle's ends: tells rays that go all ways, most of them
    at once, for a few per cent of their time.  `bundle_of` decides of the others."""
    length = 0.25 * max_abs(first)
    off = last - first
    return abs(off.x) <= length and abs(off.y) <= length and abs(off.z) <= length


@lane_kernel
def _span(o: Any, d: Any, first: Any, boxes: Any, span: Any) -> Any:
    """Of BUNDLE origins and directions from number `first` of their arrays on the smallest numbers
    and the largest of eight bundles of x, y and z in turn, and how far a tree's boxes reach from
    its centre, into span (SPAN_FLOATS,); the lanes whose numbers are finite."""
    is_finite = boxes.load(0) <= float("inf")
    for place, vectors in ((0, o), (_TURNS, d)):
        for begin in range(0, 3 * LANES, LANES):
            low = high = vectors.load(first + begin)
            for more in range(0, 3 * BUNDLE, 3 * LANES):
                x = vectors.load(first + (begin + more))
                is_finite = is_finite & (abs(x) < float("inf"))
                low, high = smaller(low, x), larger(high, x)
            span.store(place + begin, low)
            span.store(2 * _TURNS + place + begin, high)
    upper = larger(boxes.load(3 * LANES), boxes.load(4 * LANES))
    span.store(4 * _TURNS, larger(upper, boxes.load(5 * LANES)))
    return is_finite


@kernel
def _lowest(span: FloatArray, place: int) -> Vec3:
    """The smallest x, y and z of those that `_span` has left."""
    low = Vec3(span[place], span[place + 1], span[place + 2])
    for j in range(place + 3, place + _TURNS, 3):
        low = Vec3(min(low.x, span[j]), min(low.y, span[j + 1]), min(low.z, span[j + 2]))
    return low


@kernel
def _highest(span: FloatArray, place: int) -> Vec3:
    """The largest."""
    high = Vec3(span[place], span[place + 1], span[place + 2])
    for j in range(place + 3, place + _TURNS, 3):
        high = Vec3(max(high.x, span[j]), max(high.y, span[j + 1]), max(high.z, span[j + 2]))
    return high


@kernel
def bundle_of(bvh: Bvh, o: FloatArray, d: FloatArray, begin: int, span: FloatArray) -> Bundle:
    """The BUNDLE rays from number `begin` on; span (SPAN_FLOATS,) is scratch."""
    together = _span(o, d, 3 * begin, bvh.boxes, span) == (1 << LANES) - 1
    o_low, d_low = _lowest(span, 0), _lowest(span, _TURNS)
    o_high, d_high = _highest(span, 2 * _TURNS), _highest(span, 3 * _TURNS)
    reach = 0.0
    for lane in range(LANES):
        reach = max(reach, span[4 * _TURNS + lane])
    steep = Vec3(_least(d_low.x, d_high.x), _least(d_low.y, d_high.y), _least(d_low.z, d_high.z))
    axis = 2
    if steep.x > steep.y and steep.x > steep.z:
        axis = 0
    elif steep.y > steep.z:
        axis = 1
    frame = bvh.frames
    size = frame[0, CENTER + 3]
    # As in `view_of`, of a point as far out as any of the origins.
    far_out = Vec3(
        max(abs(o_low.x), abs(o_high.x)),
        max(abs(o_low.y), abs(o_high.y)),
        max(abs(o_low.z), abs(o_high.z)),
    )
    error = surface_error(far_out, far_out, 3.0 * size)
    center = Vec3(frame[0, CENTER], frame[0, CENTER + 1], frame[0, CENTER + 2])
    o_low, o_high = o_low - center, o_high - center
    length = component(steep, axis)
    together = together and SHORT <= length <= 1.0 / SHORT
    slope = (max(max_abs(o_low), max_abs(o_high)) + reach) / length
    widest = reach * min(1.0, NARROW / math.sqrt(len(bvh.references)))
    for k in range(3):
        low, high = component(d_low, k), component(d_high, k)
        width = component(o_high, k) - component(o_low, k) + (high - low) * slope
        together = together and width <= widest and (low > 0.0 or high < 0.0 or low == high)
        # Along `axis` no longer than what `scaled` leaves alone.
        longest = max(abs(low), abs(high))
        together = together and (longest <= 1.0 / SHORT if k == axis else longest < length)
    x = _slab(o_low.x, o_high.x, d_low.x, d_high.x, error)
    y = _slab(o_low.y, o_high.y, d_low.y, d_high.y, error)
    z = _slab(o_low.z, o_high.z, d_low.z, d_high.z, error)
    return Bundle(
        together,
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
def _least(low: float, high: float) -> float:
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
    """A component of `Bundle`.  Rounding is monotonic: what bounds the operands bounds the result.
    Where all of d is 0 the inverse is inf, whatever the sign of the zeros."""
    if d_low < 0.0:
        return _Slab(o_low - error, o_high + error, 1.0 / d_low, reciprocal(d_high), -error)
    return _Slab(
        o_high + error, o_low - error, reciprocal(d_high + 0.0), reciprocal(d_low + 0.0), error
    )
