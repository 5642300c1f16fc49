"""The kernels of a tile: what each thread of `render` runs.

A tile is the pixels begin <= k < end, counted along rows.  Each kernel adds samples first to
last - 1 of these pixels to its sums, whose row 0 is of pixel `begin`.  Samples are added one after
another, so that the sums have the same bits however the samples are divided among calls.
`accumulation` turns sums into means.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from reference_rt import sampling
from reference_rt.accel.geometry import closest_hit, traversal_cost
from reference_rt.cameras import LENS_CENTRE, camera_ray
from reference_rt.cameras.film import Stratum, film_offset, no_stratum, stratum_of
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import (
    BLOCK,
    HIT_FLOATS,
    HIT_INTEGERS,
    POINT_FLOATS,
    POINT_INTEGERS,
    RAY_FLOATS,
    HitBlock,
    PointBlock,
    Ray,
    RayBlock,
    put_ray,
    vector_of,
)
from reference_rt.core.vec3 import Vec3, dot, row
from reference_rt.integrators import radiances
from reference_rt.integrators.path import STATE_FLOATS, VECTOR_FLOATS, Scratch, prepare
from reference_rt.integrators.ray_cast import cast
from reference_rt.integrators.scene_tables import KernelScene, surface
from reference_rt.integrators.shading import texture_place
from reference_rt.jit.kernel import by_class, entry_kernel, kernel, local_floats, local_integers
from reference_rt.lights import LIGHT_FLOATS, LIGHT_INTEGERS, LightBlock
from reference_rt.materials import SCATTER_FLOATS, SCATTER_INTEGERS, ScatterBlock, scratch_floats
from reference_rt.sampling import (
    PAIR_FLOATS,
    PAIR_INTEGERS,
    Samplers,
    draw_pair,
    invalidate_pairs,
    sampler_of,
    start_sample,
)
from reference_rt.sampling.sobol import SobolSetup
from reference_rt.textures import colour_at


class FilmRay(NamedTuple):
    """A camera ray through a film point, the filter weight of its radiance in the pixel, and what
    the film shows of the radiance."""

    ray: Ray
    weight: float
    exposure: float


class GivenRays(NamedTuple):
    """Given rays in place of a camera: a film of n pixels in one row, whose filter is not used.
    Pixel x has the ray from o[x] along the unit direction d[x]; o, d (n, 3)."""

    o: FloatArray
    d: FloatArray


class View(NamedTuple):
    """Where rays come from.  link: a camera's view behind a link, in plain Python itself;
    has_lens: whether lens points are drawn;  exposure: see `ThinLensView`, 0 for others;  forward:
    the unit direction of view where there is an exposure;  given: the rays in place of a camera's,
    of length 0 for a camera."""

    link: Any
    has_lens: int
    exposure: float
    forward: Vec3
    given: GivenRays


@kernel
def _film_ray(
    view: View,
    film_filter: Any,
    stratum: Stratum,
    sampler: Any,
    shape: tuple[int, int],
    x: int,
    y: int,
) -> FilmRay:
    given = view.given
    if len(given.o) > 0:
        return FilmRay(Ray(row(given.o, x), row(given.d, x), math.inf), 1.0, 1.0)
    width, height = shape
    u0, u1 = draw_pair(sampler, sampling.FILM)
    u0 = stratum.part_x[0] + stratum.part_x[1] * u0
    u1 = stratum.part_y[0] + stratum.part_y[1] * u1
    dx, weight_x = film_offset(film_filter, u0)
    dy, weight_y = film_offset(film_filter, u1)
    lens = LENS_CENTRE
    if view.has_lens != 0:
        lens = draw_pair(sampler, sampling.LENS)
    ray = camera_ray(view.link, (x + 0.5 + dx) / width, (y + 0.5 + dy) / height, lens)
    exposure = 1.0
    if view.exposure > 0.0:
        # Light through the hole on the film: both are inclined, and the way is longer.
        cosine = dot(ray.d, view.forward)
        exposure = view.exposure * (cosine * cosine) * (cosine * cosine)
    return FilmRay(ray, weight_x * weight_y * stratum.weight, exposure)


@kernel
def _stratum_of_sobol(setup: SobolSetup, film_filter: Any, pixel: int, sample: int) -> Stratum:
    seed: Any = np.int64(setup.seed)
    return stratum_of(film_filter, seed, pixel, sample)


@kernel
def _stratum_of_others(setup: Any, film_filter: Any, pixel: int, sample: int) -> Stratum:
    return no_stratum(pixel, sample)


_stratum = by_class(
    "stratum_of_sample",
    dict.fromkeys(sampling.SETUPS, _stratum_of_others) | {SobolSetup: _stratum_of_sobol},
)
"""_stratum(sampler_setup, film_filter, pixel, sample)."""


@entry_kernel
def render_tile(
    integrator: Any,
    scene: KernelScene,
    view: View,
    film_filter: Any,
    sampler_setup: Any,
    shape: tuple[int, int],
    out: FloatArray,
    m2: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """Radiance: its sum over samples in out (n, 3), and the sum of squared deviations from the mean
    in m2 (n, 3), of length 0 if it is not wanted."""
    scratch = Scratch(
        rays=RayBlock(local_floats(RAY_FLOATS)),
        totals=local_floats(VECTOR_FLOATS),
        shadows=RayBlock(local_floats(RAY_FLOATS)),
        arriving=local_floats(VECTOR_FLOATS),
        of=local_integers(BLOCK),
        hits=HitBlock(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS)),
        states=local_floats(STATE_FLOATS),
        samples=local_integers(BLOCK),
        kept=local_floats(scratch_floats(scene.materials)),
        points=PointBlock(local_floats(POINT_FLOATS), local_integers(POINT_INTEGERS)),
        lit=LightBlock(local_floats(LIGHT_FLOATS), local_integers(LIGHT_INTEGERS)),
        scattered=ScatterBlock(local_floats(SCATTER_FLOATS), local_integers(SCATTER_INTEGERS)),
    )
    weights = local_floats(BLOCK)
    samplers = Samplers(
        sampler_setup,
        local_integers(BLOCK),
        local_integers(BLOCK),
        local_floats(PAIR_FLOATS),
        local_integers(PAIR_INTEGERS),
    )
    prepare(scratch)
    invalidate_pairs(samplers)
    count = last - first
    paths = (end - begin) * count
    for start in range(0, paths, BLOCK):
        n = min(BLOCK, paths - start)
        for k in range(n):
            pixel, sample = begin + (start + k) // count, first + (start + k) % count
            stratum = _stratum(sampler_setup, film_filter, pixel, sample)
            samplers.pixels[k], samplers.numbers[k] = stratum.pixel, stratum.number
            y, x = pixel // shape[0], pixel % shape[0]
            seen = _film_ray(view, film_filter, stratum, sampler_of(samplers, k), shape, x, y)
            put_ray(scratch.rays, k, seen.ray)
            weights[k] = seen.weight * seen.exposure
        radiances(integrator, scene, samplers, n, scratch)
        for k in range(n):
            i, sample = (start + k) // count, first + (start + k) % count
            one = vector_of(scratch.totals, 0, k) * weights[k]
            total = row(out, i) + one
            _add_to_m2(m2, i, sample, one, total)
            out[i, 0], out[i, 1], out[i, 2] = total


@kernel
def _add_to_m2(m2: FloatArray, i: int, sample: int, one: Vec3, total: Vec3) -> None:
    """Update row i of M2, the sum of squared deviations from the mean, with sample number `sample`,
    whose value is `one`; total: the sum including it.  Youngs & Cramer 1971: only squares are
    added, so that nothing cancels."""
    if len(m2) == 0:
        return
    if sample > 0:
        count = sample + 1.0
        off = one * count - total
        scale = 1.0 / (count * sample)
        m2[i, 0] += off.x * off.x * scale
        m2[i, 1] += off.y * off.y * scale
        m2[i, 2] += off.z * off.z * scale


@entry_kernel
def first_hits_tile(
    scene: KernelScene,
    view: View,
    film_filter: Any,
    sampler_setup: Any,
    shape: tuple[int, int],
    albedos: FloatArray,
    normals: FloatArray,
    positions: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """Albedo, shading normal and position at the first hits of the rays of `render_tile`: their
    sums over samples in albedos, normals and positions (n, 3)."""
    for pixel in range(begin, end):
        y, x = pixel // shape[0], pixel % shape[0]
        i = pixel - begin
        albedo, normal, position = row(albedos, i), row(normals, i), row(positions, i)
        for sample in range(first, last):
            stratum = _stratum(sampler_setup, film_filter, pixel, sample)
            sampler = start_sample(sampler_setup, stratum.pixel, stratum.number)
            seen = _film_ray(view, film_filter, stratum, sampler, shape, x, y)
            hit = closest_hit(scene.geometry, seen.ray)
            if hit.kind >= 0:
                point = surface(scene, seen.ray, hit)
                at = texture_place(scene.textures, scene.geometry, seen.ray, hit)
                own = colour_at(scene.materials.shown, point.material, at)
                albedo = albedo + own * seen.weight
                normal = normal + point.ns * seen.weight
                position = position + point.p * seen.weight
        albedos[i, 0], albedos[i, 1], albedos[i, 2] = albedo
        normals[i, 0], normals[i, 1], normals[i, 2] = normal
        positions[i, 0], positions[i, 1], positions[i, 2] = position


@entry_kernel
def aov_tile(
    scene: KernelScene,
    view: View,
    shape: tuple[int, int],
    out: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """The AOV pass: all layers of ray casting at the pixels' centres, into out (n, 10): colour,
    distance, normal, id, u, v.  `first` and `last` are not used; all kernels have them."""
    width, height = shape
    for pixel in range(begin, end):
        y, x = pixel // width, pixel % width
        ray = camera_ray(view.link, (x + 0.5) / width, (y + 0.5) / height, LENS_CENTRE)
        found = cast(scene, ray)
        i = pixel - begin
        out[i, 0], out[i, 1], out[i, 2] = found.colour
        out[i, 3] = found.distance
        out[i, 4], out[i, 5], out[i, 6] = found.n
        out[i, 7], out[i, 8], out[i, 9] = found.id, found.u, found.v


@entry_kernel
def cost_tile(
    scene: KernelScene,
    view: View,
    shape: tuple[int, int],
    out: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """What the rays of `aov_tile` cost, into the first two columns of out: see `geometry.Cost`."""
    width, height = shape
    for pixel in range(begin, end):
        y, x = pixel // width, pixel % width
        ray = camera_ray(view.link, (x + 0.5) / width, (y + 0.5) / height, LENS_CENTRE)
        found = traversal_cost(scene.geometry, ray)
        out[pixel - begin, 0], out[pixel - begin, 1] = found.steps, found.tests
