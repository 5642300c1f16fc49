"""Closest-hit and any-hit queries for a block of rays: by SIMD brute force, stream traversal or
single-ray traversal."""

from typing import Any

import numba
import numpy as np

from reference_rt import shapes as any_shape
from reference_rt.accel.geometry import Geometry, closest_hit, geometries, occluded
from reference_rt.accel.stream import any_of_block, closest_of_block, trace_block
from reference_rt.core.ray import (
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    Hit,
    HitBlock,
    Ray,
    RayBlock,
    put_hit,
    ray_of,
)
from reference_rt.core.ray import hit_of as hit_in_block
from reference_rt.jit.function_pointer import call_pointer
from reference_rt.jit.kernel import by_class, kernel, signature_of
from reference_rt.jit.links import Link
from reference_rt.jit.parallel_compile import Call


def tracer_of(geometry: Geometry) -> Call | None:
    """The stream traversal and its signature, to be compiled separately and called through
    `geometry.tracer`; None where there is no BVH, where there are instances, or without a compiler.

    Compiling brute force separately too gained nothing measurable, and spheres were 1 to 2 %
    slower (measured).
    """
    bvh, shapes, solids = geometry.bvh, geometry.shapes, geometry.solids
    if numba.config.DISABLE_JIT or bvh is None or geometry.instances is not None:
        return None
    rays = RayBlock(np.empty(RAY_FLOATS))
    hits = HitBlock(np.empty(HIT_FLOATS), np.empty(HIT_INTEGERS, np.int64))
    return trace_block, signature_of(bvh, shapes, solids, rays, hits, 0, False)


@geometries.operation
def closest_hits(geometry: Geometry, rays: RayBlock, hits: HitBlock, n: int) -> None:
    """`closest_hit` of the first n rays; read the hits with `hit_of`."""
    _trace(geometry, rays, hits, n, False)


@geometries.operation
def any_hits(geometry: Geometry, rays: RayBlock, hits: HitBlock, n: int) -> None:
    """`occluded` of the first n rays: hits.codes[j] >= 0 for those that are; the rest of the hits
    means nothing."""
    _trace(geometry, rays, hits, n, True)


@kernel
def _trace(geometry: Geometry, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
    bvh: Any = geometry.bvh
    shapes, solids = geometry.shapes, geometry.solids
    if geometry.bvh is None:
        any_shape.nearest_of_rays(shapes, rays, hits, n, any_hit)
        return
    if geometry.instances is not None:
        # An instance changes the ray's origin and direction, which streams compute only once.
        for j in range(n):
            if any_hit:
                hits.codes[j] = 0 if occluded(geometry, ray_of(rays, j)) else -1
            else:
                put_hit(hits, j, closest_hit(geometry, ray_of(rays, j)))
        return
    if geometry.tracer is not None:
        call_pointer(geometry.tracer[0], (bvh, shapes, solids, rays, hits, n, any_hit))
        return
    if any_hit:
        any_of_block(bvh, shapes, solids, rays, hits, n)
    else:
        closest_of_block(bvh, shapes, solids, rays, hits, n)


@kernel
def _hit_in_geometry(geometry: Geometry, ray: Ray, hits: HitBlock, j: int) -> Hit:
    if geometry.bvh is None:
        found: Hit = any_shape.completed(geometry.shapes, ray, hits, j)
        return found
    return hit_in_block(hits, j)


@kernel
def _hit_through_link(geometry: Link, ray: Ray, hits: HitBlock, j: int) -> Hit:
    return hit_in_block(hits, j)


hit_of = by_class("hit_of", {Geometry: _hit_in_geometry, Link: _hit_through_link})
"""hit_of(geometry, ray, hits, j): the hit of ray j after `closest_hits`."""
