"""The radiance along given rays, by any integrator."""

import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.cameras.film import BoxFilter
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF, Ray
from reference_rt.core.vec3 import row
from reference_rt.integrators import AnyIntegrator, Light, Path, RayCast
from reference_rt.integrators.ray_cast import cast
from reference_rt.integrators.scene_tables import KernelScene, SceneTables
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.accumulation import mean_and_variance, radiance_job, setup_for
from reference_rt.rendering.kept_links import link_to_scene
from reference_rt.rendering.kernels import kernels_for
from reference_rt.rendering.query.rays import Rays, in_blocks, rays_of, shaped
from reference_rt.rendering.tiles import GivenRays
from reference_rt.rendering.units import SAMPLES_PER_TILE, Unit, tiles_of
from reference_rt.sampling import Independent
from reference_rt.scene.build import BuiltScene


class Radiance(NamedTuple):
    """mean (..., 3): the radiance along each ray, linear sRGB;  standard_error (..., 3): the
    estimate of the mean's standard deviation: 0 for integrators that draw no random numbers, inf
    for a single sample of one that does."""

    mean: FloatArray
    standard_error: FloatArray


@entry_kernel
def cast_kernel(scene: KernelScene, o: FloatArray, d: FloatArray, out: FloatArray) -> None:
    for i in range(len(o)):
        found = cast(scene, Ray(row(o, i), row(d, i), math.inf))
        out[i, 0], out[i, 1], out[i, 2] = found.colour


def radiance(
    scene: BuiltScene,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    spp: int | None = None,
    seed: int = 0,
    integrator: AnyIntegrator | None = None,
    threads: int | None = None,
) -> Radiance:
    """The radiance that arrives at each origin from the direction of its ray.

    Rays as for `intersect`; a ray that is not finite or has no direction gets 0.  integrator:
    default the scene's; `Path(max_depth=1)` gives emission only, `RayCast` its colour.  spp:
    samples per ray; None: as many as the scene's sampler takes per pixel, or one for a
    deterministic integrator.  The random numbers are independent, as the standard error requires,
    and a pure function of (seed, number of the ray along the rows, sample).  threads: default all
    cores; their number changes no bit.  Raises ValueError, SceneError.
    """
    integrator = scene.integrator if integrator is None else integrator
    if isinstance(integrator, Light):
        raise ValueError("integrator: 'light' has pictures, no radiance of a ray; expected 'path'")
    if spp is None:
        spp = 1 if integrator.deterministic else scene.resolved_sampler.spp
    if scene.has_media:
        scene.changed(integrator=integrator, sampler=None)  # an integrator that follows media
    tables = _tables_for(scene, integrator)
    rays = rays_of(origins, directions)
    if isinstance(integrator, RayCast):
        if integrator.show != "colour":
            raise ValueError(
                f"integrator: shows '{integrator.show}', not radiance; expected 'colour', or "
                "see `intersect`"
            )
        mean = _colours(tables, rays, threads)
        return Radiance(shaped(mean, rays.shape), shaped(np.zeros_like(mean), rays.shape))
    setup = setup_for(scene, integrator, True)
    mean, error = estimate(tables, setup, rays, spp, seed, threads)
    if integrator.deterministic:
        error = np.zeros_like(mean)
    return Radiance(shaped(mean, rays.shape), shaped(error, rays.shape))


def _tables_for(scene: BuiltScene, integrator: AnyIntegrator) -> SceneTables:
    """The scene's tables for another integrator: its own, if they would be the same."""
    own = scene.integrator
    if own.follows_scattered == integrator.follows_scattered and (
        isinstance(own, Path) or not isinstance(integrator, Path)
    ):
        return scene.tables
    return scene.changed(integrator=integrator, sampler=None).tables


class _UnitRays(NamedTuple):
    o: FloatArray
    d: FloatArray
    valid: npt.NDArray[np.bool_]


def _unit(rays: Rays) -> _UnitRays:
    """Rays with unit directions; an arbitrary ray in place of each invalid one.

    Directions that are unit to within rounding are kept, so that camera rays keep the bits that
    `render` traces.
    """
    with np.errstate(all="ignore"):
        size = np.abs(rays.d).max(axis=1, initial=0.0, keepdims=True)
        valid = np.isfinite(rays.o).all(axis=1) & np.isfinite(size[:, 0]) & (size[:, 0] > 0.0)
        # By a power of two, so that no square leaves float64's range.
        d = np.ldexp(rays.d, -np.frexp(np.where(valid[:, None], size, 1.0))[1])
        made = d / np.linalg.norm(d, axis=1, keepdims=True)
        # The sum of three squares rounds by 3 u: its root by 2.5 u, the inverse of that by 3.5 u
        # and the vector made unit by 4.5 u, the square of whose length, by 3 u more, is seen.
        is_unit = np.abs(np.square(rays.d).sum(axis=1) - 1.0) <= 12.0 * UNIT_ROUNDOFF
    d = np.where(is_unit[:, None], rays.d, made)
    o = rays.o
    if not valid.all():
        o = np.where(valid[:, None], o, 0.0)
        d = np.where(valid[:, None], d, (0.0, 0.0, 1.0))
    return _UnitRays(o, np.ascontiguousarray(d), valid)


def _colours(tables: SceneTables, rays: Rays, threads: int | None) -> FloatArray:
    o, d, valid = _unit(rays)
    out = np.empty_like(o)
    found = link_to_scene(tables, cast_kernel)

    def trace(k: slice) -> None:
        cast_kernel(found.tables, o[k], d[k], out[k])

    in_blocks(trace, len(o), threads)
    out[~valid] = 0.0
    return out


def estimate(
    tables: SceneTables, setup: Any, rays: Rays, spp: int, seed: int, threads: int | None
) -> tuple[FloatArray, FloatArray]:
    """The mean (n, 3) of samples of an integrator's `setup()`, and its standard error (n, 3)."""
    sampler = Independent(spp=spp, seed=seed)
    o, d, valid = _unit(rays)
    n = len(o)
    sums = {"colour": np.zeros((n, 3)), "m2": np.zeros((n, 3))}
    threads = threads or os.cpu_count() or 1
    if n > 0:
        job = radiance_job(setup, sampler, (n, 1), has_variance=True)
        given = tables, GivenRays(o, d), BoxFilter().setup()
        (kernel,) = kernels_for([job], *given, threads)

        def add(begin: int, end: int, first: int, last: int) -> None:
            kernel({name: a[begin:end] for name, a in sums.items()}, begin, end, first, last)

        run_tiles(add, n, spp, threads)
    mean, variance = mean_and_variance(sums, spp)
    if spp == 1:
        variance[:] = math.inf
    mean[~valid], variance[~valid] = 0.0, 0.0
    return mean, np.sqrt(variance)


def run_tiles(kernel: Callable[..., None], pixels: int, spp: int, threads: int) -> None:
    """Call kernel(begin, end, first, last) for all tiles of samples, on threads; the calling thread
    handles Ctrl-C."""
    stop = threading.Event()

    def run(begin: int, end: int) -> None:
        # In plain Python (NUMBA_DISABLE_JIT=1) NumPy would warn of intended infinities (IEEE
        # division) and intended overflow (integer hashes).
        with np.errstate(all="ignore"):
            for tile in tiles_of(Unit(begin, end, 0, spp)):
                if stop.is_set():
                    return
                kernel(*tile)

    step = max(1, SAMPLES_PER_TILE // spp)
    pool = ThreadPoolExecutor(threads, thread_name_prefix="tile")
    try:
        waiting = {pool.submit(run, k, min(k + step, pixels)) for k in range(0, pixels, step)}
        while waiting:
            # Polled: waking this thread after each of 256 tiles costs 0.1 s (measured).
            done, waiting = wait(waiting, timeout=0.2, return_when=FIRST_EXCEPTION)
            for future in done:
                future.result()
    except BaseException:
        stop.set()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def radiance_without_noise(
    tables: SceneTables, setup: Any, origins: npt.ArrayLike, directions: npt.ArrayLike
) -> FloatArray:
    """The radiance (..., 3) by the `setup()` of an integrator that draws no random numbers."""
    rays = rays_of(origins, directions)
    mean, _ = estimate(tables, setup, rays, 1, 0, None)
    return shaped(mean, rays.shape)  # type: ignore[no-any-return]
