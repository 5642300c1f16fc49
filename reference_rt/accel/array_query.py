"""Arrays of rays: closest hits by packets where rays are coherent, else by blocks; occlusion by
blocks."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.accel.block_query import any_hits, closest_hits
from reference_rt.accel.geometry import Geometry, closest_hit, occluded
from reference_rt.accel.packet import PACKET_SIZE, TILE, may_be_coherent, ray_number
from reference_rt.accel.packet_traversal import FOUND, INCOHERENT, closest_of_packet
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import (
    BLOCK,
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    Hit,
    HitBlock,
    RayBlock,
    hit_of,
    put_ray,
    scaled,
)
from reference_rt.core.vec3 import max_abs, row
from reference_rt.jit.kernel import kernel, local_floats, local_integers


class Primitives(NamedTuple):
    """The hits of n rays as arrays.  t (n,), of the `scaled` ray; codes (n, 3): `Hit.kind`, row and
    instance, kind -1 for a miss; uv (n, 2): `Hit.u` and v."""

    t: FloatArray
    codes: IntArray
    uv: FloatArray


MOST_ADDED = BLOCK + PACKET_SIZE
"""The most hits that one call of `trace_packet` adds to its output."""


class TraceScratch(NamedTuple):
    """Scratch buffers of `trace_packet`.  packet, hits: the rays of a packet and their hits (hits
    also of a block);  rays, numbers (BLOCK,): incoherent rays that wait until they fill a block,
    and their indices."""

    packet: RayBlock
    hits: HitBlock
    rays: RayBlock
    numbers: IntArray


@kernel
def trace_packet(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    begin: int,
    width: int,
    count: int,
    is_last: bool,
    work: TraceScratch,
    waiting: int,
    found: Primitives,
    numbers: IntArray,
    filled: int,
) -> tuple[int, int]:
    """Closest hits of the first `count` rays of a packet, see `ray_number`, with origins o (n, 3)
    and directions d (n, 3): together where they are PACKET_SIZE coherent ones, else queued until
    there is a block of them.

    waiting: rays in the queue, which is emptied with is_last;  filled: hits in `found`, whose rays'
    indices are in `numbers`.  Returns both as they are afterwards.  Hits come in any order, misses
    are left out.
    """
    outcome = _together(geometry, o, d, begin, width, count, work.packet, work.hits)
    if outcome == FOUND:
        for j in range(PACKET_SIZE):
            hit = hit_of(work.hits, j)
            filled = _add_hit(found, numbers, filled, hit, ray_number(begin, width, j))
    elif outcome == INCOHERENT:
        for j in range(count):
            i = ray_number(begin, width, j)
            ray, _, valid = scaled(row(o, i), row(d, i), math.inf)
            if valid:
                put_ray(work.rays, waiting, ray)
                work.numbers[waiting] = i
                waiting += 1
    if waiting > BLOCK - PACKET_SIZE or is_last:
        closest_hits(geometry, work.rays, work.hits, waiting)
        for j in range(waiting):
            hit = hit_of(work.hits, j)
            filled = _add_hit(found, numbers, filled, hit, work.numbers[j])
        waiting = 0
    return waiting, filled


@kernel
def _together(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    begin: int,
    width: int,
    count: int,
    packet: RayBlock,
    hits: HitBlock,
) -> int:
    """`closest_of_packet` of the first `count` rays of a packet."""
    if count < PACKET_SIZE:
        return INCOHERENT
    if not may_be_coherent(row(d, begin), row(d, ray_number(begin, width, PACKET_SIZE - 1))):
        return INCOHERENT
    return closest_of_packet(geometry, o, d, begin, width, packet, hits)


@kernel
def rows_width(o: FloatArray, d: FloatArray) -> int:
    """How many rays are in a row, a multiple of TILE, if rays are in the order of a picture's
    pixels, at least 8 rows of them; else TILE.

    A row ends where a ray differs from the one before it by more than JUMP times what any in the
    row does.  Any number is correct: rays of a wrong one are not coherent.
    """
    if len(o) < PACKET_SIZE or not may_be_coherent(row(d, 0), row(d, TILE)):
        return TILE
    end, widest = -1, 0.0
    for i in range(1, len(o) // 4):
        step = max_abs(row(d, i) - row(d, i - 1)) + max_abs(row(o, i) - row(o, i - 1))
        if i < TILE or not step > JUMP * widest:
            widest = max(widest, step)
        elif end < 0:
            end = i
        else:
            return i - end if (i - end) % TILE == 0 else TILE
    return TILE


JUMP = 8.0


@kernel
def packet_place(k: int, n: int, width: int) -> tuple[int, int]:
    """(begin, width) for `ray_number` of the packet of the rays that come k-th of n.

    Bands of TILE rows are traced in packets of TILE rows, and the rays after the last one in their
    order.
    """
    band = width * TILE
    if width > TILE and k < n // band * band:
        return k // band * band + k % band // TILE, width
    return k, TILE


@kernel
def _add_hit(found: Primitives, numbers: IntArray, filled: int, hit: Hit, ray: int) -> int:
    """Append the hit of a ray, unless it is a miss; how many there are then."""
    if hit.kind < 0:
        return filled
    _put_hit(found, filled, hit)
    numbers[filled] = ray
    return filled + 1


@kernel
def closest_one_by_one(geometry: Geometry, o: FloatArray, d: FloatArray, found: Primitives) -> None:
    """Closest hits by `closest_hit`: the same bits as by `trace_packet`, slower, but much faster to
    compile."""
    for i in range(len(o)):
        ray, _, valid = scaled(row(o, i), row(d, i), math.inf)
        hit = Hit(math.inf, -1, -1, 0.0, 0.0, -1)
        if valid:
            hit = closest_hit(geometry, ray)
        _put_hit(found, i, hit)


@kernel
def _put_hit(found: Primitives, i: int, hit: Hit) -> None:
    found.t[i], found.uv[i, 0], found.uv[i, 1] = hit.t, hit.u, hit.v
    found.codes[i, 0], found.codes[i, 1], found.codes[i, 2] = hit.kind, hit.row, hit.instance


@kernel
def occluded_one_by_one(
    geometry: Geometry, o: FloatArray, d: FloatArray, t_max: FloatArray, out: npt.NDArray[np.bool_]
) -> None:
    """`occluded_rays` by `occluded`: slower, but much faster to compile."""
    for i in range(len(o)):
        ray, _, valid = scaled(row(o, i), row(d, i), t_max[i])
        out[i] = valid and occluded(geometry, ray)


@kernel
def occluded_rays(
    geometry: Geometry, o: FloatArray, d: FloatArray, t_max: FloatArray, out: npt.NDArray[np.bool_]
) -> None:
    """Whether each ray hits anything at 0 < t < t_max (n,), written to out (n,).

    In blocks only: with packets, rays that any hit ends took 0.60 of the time at best (a camera's
    at the bunny), 1.45 at worst (a camera's at a knot on a floor, and shadow rays there).
    """
    rays = RayBlock(local_floats(RAY_FLOATS))
    hits = HitBlock(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS))
    numbers, waiting = local_integers(BLOCK), 0
    for k in range(RAY_FLOATS):
        rays.numbers[k] = 1.0  # lanes without a ray are traced too
    for i in range(len(o)):
        out[i] = False
        ray, _, valid = scaled(row(o, i), row(d, i), t_max[i])
        if valid:
            put_ray(rays, waiting, ray)
            numbers[waiting] = i
            waiting += 1
        if waiting == BLOCK or i + 1 == len(o):
            any_hits(geometry, rays, hits, waiting)
            for j in range(waiting):
                out[numbers[j]] = hits.codes[j] >= 0
            waiting = 0
