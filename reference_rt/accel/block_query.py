"""Closest-hit and any-hit queries for a block of rays: by SIMD brute force, stream traversal or
single-ray traversal."""

from typing import Any

from reference_rt import shapes as any_shape
from reference_rt.accel.geometry import Geometry, closest_hit, geometries, occluded
from reference_rt.accel.stream import any_of_block, closest_of_block
from reference_rt.core.ray import HitBlock, RayBlock, put_hit, ray_of
from reference_rt.jit.kernel import kernel


@geometries.operation
def closest_hits(geometry: Geometry, rays: RayBlock, hits: HitBlock, n: int) -> None:
    """`closest_hit` of the first n rays; read them with `hit_of`."""
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
    if any_hit:
        any_of_block(bvh, shapes, solids, rays, hits, n)
    else:
        closest_of_block(bvh, shapes, solids, rays, hits, n)
