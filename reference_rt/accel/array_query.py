"""What arrays of rays hit, block after block."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.accel.block_query import any_hits, closest_hits, hit_of
from reference_rt.accel.geometry import Geometry, closest_hit
from reference_rt.accel.packet.packet import BUNDLE
from reference_rt.accel.packet.traversal import ALONE, FOUND, closest_together
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import BLOCK, Hit, Ray
from reference_rt.core.ray_block import (
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    Hits,
    Rays,
    put_ray,
    ray_of,
)
from reference_rt.core.scaled_ray import scaled
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import kernel, local_floats, local_integers


class Primitives(NamedTuple):
    """What n rays hit, as `Hit`, each with the t of its `scaled` ray: t (n,); codes (n, 3): kind,
    row and instance, kind -1 for a miss; uv (n, 2)."""

    t: FloatArray
    codes: IntArray
    uv: FloatArray


MOST_ADDED = BLOCK + BUNDLE
"""Rays that one call of `trace_bundle` may add to what is found."""


class Work(NamedTuple):
    """Buffers of `trace_bundle`.  bundle, hits: of rays that are traced together;  rays, numbers
    (BLOCK,): rays that wait to be traced as a block, and their numbers."""

    bundle: Rays
    hits: Hits
    rays: Rays
    numbers: IntArray


@kernel
def trace_bundle(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    begin: int,
    work: Work,
    waiting: int,
    found: Primitives,
    numbers: IntArray,
    filled: int,
) -> tuple[int, int]:
    """Trace BUNDLE rays from origins o (n, 3) into directions d (n, 3), from number `begin` on:
    together where they are alike, else let them wait until there is a block of them.

    What rays meet is added to `found` and their numbers to `numbers`, of which `filled` are used,
    in any order; with the last of the n rays all are there.  (waiting, filled) afterwards.
    """
    end = min(begin + BUNDLE, len(o))
    outcome = ALONE
    if end == begin + BUNDLE:
        outcome = closest_together(geometry, o, d, begin, work.bundle, work.hits)
    for i in range(begin, end):
        hit = Hit(math.inf, -1, -1, 0.0, 0.0, -1)
        if outcome == FOUND:
            hit = hit_of(geometry, ray_of(work.bundle, i - begin), work.hits, i - begin)
        elif outcome == ALONE:
            ray, _, valid = scaled(row(o, i), row(d, i), math.inf)
            if valid:
                put_ray(work.rays, waiting, ray)
                work.numbers[waiting] = i
                waiting += 1
                continue
        _put(found, filled, hit)
        numbers[filled] = i
        filled += 1
    if waiting > BLOCK - BUNDLE or end == len(o):
        closest_hits(geometry, work.rays, work.hits, waiting)
        for j in range(waiting):
            _put(found, filled, hit_of(geometry, ray_of(work.rays, j), work.hits, j))
            numbers[filled] = work.numbers[j]
            filled += 1
        waiting = 0
    return waiting, filled


@kernel
def closest_one_by_one(geometry: Geometry, o: FloatArray, d: FloatArray, found: Primitives) -> None:
    """What rays meet first, ray after ray: the same bits, slower, from far less code."""
    for i in range(len(o)):
        ray, _, valid = scaled(row(o, i), row(d, i), math.inf)
        hit = Hit(math.inf, -1, -1, 0.0, 0.0, -1)
        if valid:
            hit = closest_hit(geometry, ray)
        _put(found, i, hit)


@kernel
def _put(found: Primitives, i: int, hit: Hit) -> None:
    found.t[i], found.uv[i, 0], found.uv[i, 1] = hit.t, hit.u, hit.v
    found.codes[i, 0], found.codes[i, 1], found.codes[i, 2] = hit.kind, hit.row, hit.instance


@kernel
def occluded_rays(
    geometry: Geometry, o: FloatArray, d: FloatArray, t_max: FloatArray, out: npt.NDArray[np.bool_]
) -> None:
    """Whether anything lies on rays up to t_max (n,), into out (n,)."""
    rays = Rays(local_floats(RAY_FLOATS))
    hits = Hits(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS))
    numbers = local_integers(BLOCK)
    for k in range(RAY_FLOATS):
        rays.numbers[k] = 1.0
    for begin in range(0, len(o), BLOCK):
        count = 0
        for i in range(begin, min(begin + BLOCK, len(o))):
            out[i] = False
            ray, _, valid = scaled(row(o, i), row(d, i), t_max[i])
            if valid:
                put_ray(rays, count, Ray(ray.o, ray.d, ray.t_max))
                numbers[count] = i
                count += 1
        any_hits(geometry, rays, hits, count)
        for j in range(count):
            out[numbers[j]] = hits.codes[j] >= 0
