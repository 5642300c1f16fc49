"""What the rays of a block hit: side by side, on their ways together, or one after another."""

from reference_rt import shapes as any_shape
from reference_rt.apart import Address, call_at
from reference_rt.bvh import Bvh
from reference_rt.geometry import Geometry, closest_hit, occluded
from reference_rt.groups import Instances
from reference_rt.kernel import kernel
from reference_rt.ray import Hit, Ray
from reference_rt.streams import Hits, Rays, put_hit, ray_of
from reference_rt.streams import hit_of as kept_hit
from reference_rt.wavefront import any_of_block, closest_of_block


@kernel
def closest_hits(geometry: Geometry, rays: Rays, hits: Hits, n: int) -> None:
    """`closest_hit` of the first n rays: what `hit_of` tells."""
    _closest_hits(geometry.bvh, geometry.instances, geometry.tracer, geometry, rays, hits, n)


@kernel
def _closest_hits(
    bvh: Bvh | None,
    instances: Instances | None,
    tracer: Address | None,
    geometry: Geometry,
    rays: Rays,
    hits: Hits,
    n: int,
) -> None:
    if bvh is None:
        any_shape.nearest_of_rays(geometry.shapes, rays, hits, n, False)
        return
    if instances is not None:
        # Rays have directions and origins of their own in each, which change on their ways.
        for j in range(n):
            put_hit(hits, j, closest_hit(geometry, ray_of(rays, j)))
        return
    if tracer is not None:
        call_at(tracer[0], (bvh, geometry.shapes, geometry.solids, rays, hits, n, False))
        return
    closest_of_block(bvh, geometry.shapes, geometry.solids, rays, hits, n)


@kernel
def hit_of(geometry: Geometry, ray: Ray, hits: Hits, j: int) -> Hit:
    """What ray number j has found."""
    return _hit_of(geometry.bvh, geometry, ray, hits, j)


@kernel
def _hit_of(bvh: Bvh | None, geometry: Geometry, ray: Ray, hits: Hits, j: int) -> Hit:
    if bvh is None:
        return any_shape.nearest_of_ray(geometry.shapes, ray, hits, j)
    return kept_hit(hits, j)


@kernel
def any_hits(geometry: Geometry, rays: Rays, hits: Hits, n: int) -> None:
    """`occluded` of the first n rays: of the hits, only whether there is any is meant."""
    _any_hits(geometry.bvh, geometry.instances, geometry.tracer, geometry, rays, hits, n)


@kernel
def _any_hits(
    bvh: Bvh | None,
    instances: Instances | None,
    tracer: Address | None,
    geometry: Geometry,
    rays: Rays,
    hits: Hits,
    n: int,
) -> None:
    if bvh is None:
        any_shape.nearest_of_rays(geometry.shapes, rays, hits, n, True)
        return
    if instances is not None:
        for j in range(n):
            hits.codes[j] = 0 if occluded(geometry, ray_of(rays, j)) else -1
        return
    if tracer is not None:
        call_at(tracer[0], (bvh, geometry.shapes, geometry.solids, rays, hits, n, True))
        return
    any_of_block(bvh, geometry.shapes, geometry.solids, rays, hits, n)
