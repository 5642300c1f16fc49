"""What arrays of rays hit, block after block."""

import math

import numpy as np
import numpy.typing as npt

from reference_rt.block_hits import any_hits, closest_hits, hit_of
from reference_rt.bundles import BUNDLE
from reference_rt.coherent import ALONE, FOUND, closest_together
from reference_rt.geometry import Geometry
from reference_rt.kernel import kernel, local_floats, local_integers
from reference_rt.ray import BLOCK, Ray, at
from reference_rt.scaled_ray import is_told, scaled
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.streams import (
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    Hits,
    Rays,
    put_ray,
    ray_of,
)
from reference_rt.vec3 import row


@kernel
def closest_of_rays(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    kind: IntArray,
    rows: IntArray,
    uv: FloatArray,
) -> None:
    """What rays from origins o (n, 3) into directions d (n, 3) hit first, see `query.Closest`:
    neighbours that are alike in bundles, the others in blocks."""
    bundle = Rays(local_floats(RAY_FLOATS))
    rays = Rays(local_floats(RAY_FLOATS))
    hits = Hits(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS))
    numbers, units, count = local_integers(BLOCK), local_floats(BLOCK), 0
    for k in range(RAY_FLOATS):
        rays.numbers[k] = 1.0  # lanes without a ray are traced too
    for begin in range(0, len(o), BUNDLE):
        end = min(begin + BUNDLE, len(o))
        for i in range(begin, end):
            t[i], kind[i], rows[i], uv[i, 0], uv[i, 1] = math.inf, -1, -1, 0.0, 0.0
        outcome = ALONE
        if end == begin + BUNDLE:
            outcome = closest_together(geometry, o, d, begin, bundle, hits)
        if outcome == FOUND:
            for j in range(BUNDLE):
                _tell(geometry, bundle, 1.0, hits, j, begin + j, t, kind, rows, uv)
        elif outcome == ALONE:
            for i in range(begin, end):
                ray, unit, valid = scaled(row(o, i), row(d, i), math.inf)
                if valid:
                    put_ray(rays, count, ray)
                    numbers[count], units[count] = i, unit
                    count += 1
        if count > BLOCK - BUNDLE or end == len(o):
            closest_hits(geometry, rays, hits, count)
            for j in range(count):
                _tell(geometry, rays, units[j], hits, j, numbers[j], t, kind, rows, uv)
            count = 0


@kernel
def _tell(
    geometry: Geometry,
    rays: Rays,
    unit: float,
    hits: Hits,
    j: int,
    i: int,
    t: FloatArray,
    kind: IntArray,
    rows: IntArray,
    uv: FloatArray,
) -> None:
    """Write what ray j of a block, number i of all, has hit, if it has; unit: of its t, see
    `scaled`."""
    ray = ray_of(rays, j)
    hit = hit_of(geometry, ray, hits, j)
    if hit.kind >= 0 and is_told(hit.t * unit, at(ray, hit.t)):
        t[i], kind[i], rows[i] = hit.t * unit, hit.kind, hit.row
        uv[i, 0], uv[i, 1] = hit.u, hit.v


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
