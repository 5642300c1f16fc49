"""A block of samples: the scratch of a band of pixels, and rays that are traced together."""

from typing import NamedTuple

from reference_rt import shapes as any_shape
from reference_rt.bvh import Bvh
from reference_rt.geometry import Geometry, closest_hit, occluded
from reference_rt.kernel import kernel
from reference_rt.ray import BLOCK, Hit, Ray
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.streams import RAY_FLOATS, Hits, Rays, put_hit, ray_of
from reference_rt.streams import hit_of as kept_hit

STATE_FLOATS = 11 * BLOCK
VECTOR_FLOATS = 3 * BLOCK


class Scratch(NamedTuple):
    """rays: from the eye at first;  totals (VECTOR_FLOATS,): the radiance along each of these.

    While an integrator works: shadows, rays that may be blocked, and the light (VECTOR_FLOATS,)
    that each brings to sample `lit` (BLOCK,);  hits;  states (STATE_FLOATS,) of paths, and the
    sample (BLOCK,) that each is of;  kept (`materials.kept_floats`,) for `shade`.
    """

    rays: Rays
    totals: FloatArray
    shadows: Rays
    lights: FloatArray
    lit: IntArray
    hits: Hits
    states: FloatArray
    samples: IntArray
    kept: FloatArray


@kernel
def prepare(scratch: Scratch) -> None:
    """Before the first rays.  Lanes without a ray are traced too, and memory that nobody has
    written may hold subnormal numbers, on which some processors are a hundred times slower."""
    for k in range(RAY_FLOATS):
        scratch.rays.numbers[k] = 1.0
        scratch.shadows.numbers[k] = 1.0


@kernel
def closest_hits(geometry: Geometry, rays: Rays, hits: Hits, n: int) -> None:
    """`closest_hit` of the first n rays: what `hit_of` tells."""
    _trace(geometry.bvh, geometry, rays, hits, n, False)


@kernel
def any_hits(geometry: Geometry, rays: Rays, hits: Hits, n: int) -> None:
    """`occluded` of the first n rays: of the hits, only whether there is any is meant."""
    _trace(geometry.bvh, geometry, rays, hits, n, True)


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
def _trace(
    bvh: Bvh | None, geometry: Geometry, rays: Rays, hits: Hits, n: int, any_hit: bool
) -> None:
    if bvh is None:
        any_shape.nearest_of_rays(geometry.shapes, rays, hits, n, any_hit)
        return
    for j in range(n):
        if any_hit:
            hits.codes[j] = 0 if occluded(geometry, ray_of(rays, j)) else -1
        else:
            put_hit(hits, j, closest_hit(geometry, ray_of(rays, j)))
