"""Rendering: compile the kernels of `tiles`, and run them on a thread pool, one tile per task.

A tile is a run of consecutive pixels, counted along rows.
"""

import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import INTEGRATORS, RayCast
from reference_rt.integrators.path import PathSetup
from reference_rt.integrators.scene_tables import LinkedScene, SceneTables
from reference_rt.jit.parallel_compile import Report
from reference_rt.rendering.kernels import Job, Running, compile_ahead
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.settings import with_settings
from reference_rt.rendering.tiles import aov_tile, first_hits_tile, render_tile
from reference_rt.scene.build import BuiltScene, build_tables
from reference_rt.scene.likely_mistakes import likely_mistakes

SAMPLES_PER_TILE = 1 << 15
"""Samples of one kernel call, about 20 ms: short enough for progress and Ctrl-C, long against the
0.1 ms that a task of the thread pool costs."""

Progress = Callable[[str, float], None]
"""Called with the phase ("compile" or "render") and the fraction of it that is done."""


def render(
    scene: BuiltScene | str | os.PathLike[str],
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    seed: int | None = None,
    threads: int | None = None,
    tables: SceneTables | None = None,
    progress: Progress | None = None,
    compiling: Report | None = None,
    specialised: bool | None = None,
) -> Picture:
    """Render a scene, or a scene file.

    spp: samples per pixel;  size: width and height in pixels;  seed: of the random numbers; None:
    the scene's own.  threads: default all cores; their number changes no bit.  tables: the scene's
    tables, if they are built already.  progress: called as the render goes on;  compiling: called
    in its place while kernels are compiled, with the number of those that are, and of all.
    specialised: whether kernels are compiled for this kind of scene, for the highest speed, or
    linked; None: see `kernels`; no bit changes.  Ctrl-C stops it within a tile.
    Raises SceneError; issues a SceneWarning for each of `likely_mistakes`.
    """
    say = progress or (lambda what, fraction: None)
    if not isinstance(scene, BuiltScene):
        scene = BuiltScene.load(os.fspath(scene))
    if (spp, size, seed) != (None, None, None):
        scene = with_settings(scene, spp=spp, size=size, seed=seed)
    _check(scene)
    film, integrator = scene.film, scene.integrator
    shown = integrator.show if isinstance(integrator, RayCast) else "colour"
    jobs, layers = jobs_of(scene)
    view = scene.camera.setup(film.width, film.height)
    threads = threads or os.cpu_count() or 1
    clock = [time.perf_counter()]
    with compile_ahead(jobs, threads if specialised is not True else 1) as ahead:
        tables = build_tables(scene) if tables is None else tables
        clock.append(time.perf_counter())
        for mistake in likely_mistakes(scene, tables):
            scene.warn(mistake.message, *mistake.path)

        compiling = compiling or (lambda done, total: say("compile", done / total))
        running = Running(
            jobs, tables, view, film.filter.setup(), threads, compiling, specialised, ahead
        )
    say("compile", 1.0)
    clock.append(time.perf_counter())
    pixels = film.width * film.height
    with running:
        for k, job in enumerate(jobs):

            def say_part(what: str, fraction: float, k: int = k) -> None:
                say(what, (k + fraction) / len(jobs))
                running.progress((k + fraction) / len(jobs))

            run_tiles(running.run(k), (), pixels, job.spp, threads, say_part)
    clock.append(time.perf_counter())
    seconds = dict(zip(("tables", "compile", "render"), np.diff(clock).tolist(), strict=True))
    return Picture(layers, shown, seconds, scene)


def jobs_of(scene: BuiltScene) -> tuple[list[Job], dict[str, FloatArray]]:
    """The jobs that compute a scene's picture, and the layers that they write."""
    if isinstance(scene.integrator, RayCast):
        return _aov_jobs(scene)
    return _render_jobs(scene, scene.integrator)


def _aov_jobs(scene: BuiltScene) -> tuple[list[Job], dict[str, FloatArray]]:
    """The AOV pass (one ray through each pixel's centre), and the layers that it writes."""
    film = scene.film
    out = np.zeros((film.height, film.width, 10))
    shape, rows = (film.width, film.height), out.reshape(-1, 10)

    def arguments(tables: Any, view: Any, film_filter: Any) -> tuple[Any, ...]:
        return tables, view, shape, rows

    layers = {
        "colour": out[..., 0:3],
        "distance": out[..., 3],
        "normal": out[..., 4:7],
        "id": out[..., 7],
        "uv": out[..., 8:10],
    }
    return [Job(aov_tile, "ray_cast", 1, arguments)], layers


def _render_jobs(scene: BuiltScene, integrator: Any) -> tuple[list[Job], dict[str, FloatArray]]:
    """The jobs that compute the picture and the film's layers, and these layers."""
    film, sampler = scene.film, scene.resolved_sampler
    shape, spp = (film.width, film.height), sampler.spp
    out = np.zeros((film.height, film.width, 3))
    variance = np.zeros_like(out) if "variance" in film.layers else None
    jobs = [radiance_job(integrator.setup(), sampler, shape, out, variance)]
    layers = {"colour": out}
    if variance is not None:
        layers["variance"] = variance
    if set(_OF_FIRST_HITS) & set(film.layers):
        layers |= {name: np.zeros_like(out) for name in _OF_FIRST_HITS}
        hits = [layers[name].reshape(-1, 3) for name in _OF_FIRST_HITS]
        random_numbers = sampler.setup()

        def arguments(tables: Any, view: Any, film_filter: Any) -> tuple[Any, ...]:
            return tables, view, film_filter, random_numbers, shape, spp, *hits

        jobs.append(Job(first_hits_tile, "first_hits", spp, arguments))
    if {"depth", "id"} & set(film.layers):
        centres, cast = _aov_jobs(scene)
        jobs += centres
        layers |= {"depth": cast["distance"], "id": cast["id"]}
    return jobs, {name: layers[name] for name in ("colour", *film.layers)}


_OF_FIRST_HITS = ("albedo", "normal", "position")
"""Layers of `first_hits_tile`, in its order."""

_NONE = np.zeros((0, 3))


def radiance_job(
    setup: Any,
    sampler: Any,
    shape: tuple[int, int],
    out: FloatArray,
    variance: FloatArray | None,
) -> Job:
    """Radiance by the `setup()` of an integrator, into out (height, width, 3), and its variance
    likewise."""
    random_numbers = sampler.setup()
    rows, squares = (None if a is None else a.reshape(-1, 3) for a in (out, variance))

    def arguments(tables: Any, view: Any, film_filter: Any) -> tuple[Any, ...]:
        own, of_squares = setup, squares
        if isinstance(tables, LinkedScene):  # of one type for all scenes
            own = setup.linked() if isinstance(setup, PathSetup) else setup
            of_squares = _NONE if squares is None else squares
        return (
            *(own, tables, view, film_filter, random_numbers, shape, sampler.spp),
            *(rows, of_squares),
        )

    return Job(render_tile, INTEGRATORS[type(setup)], sampler.spp, arguments)


def _check(scene: BuiltScene) -> None:
    """Raise SceneError for a picture that needs more than the machine's memory, before anything is
    allocated, and for a variance of one sample."""
    film = scene.film
    casts = isinstance(scene.integrator, RayCast)
    if "variance" in film.layers and scene.resolved_sampler.spp < 2 and not casts:
        raise scene.error(
            "one sample per pixel has no variance; expected at least 2", "film", "layers"
        )
    # At most 10 channels of float64, 25 with layers, and the same again while files are written.
    needed = film.width * film.height * (25 if film.layers else 10) * 2 * 8
    try:
        available = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):  # not every system has these
        available = 1 << 36
    if needed > available:
        raise scene.error(
            f"{film.width} x {film.height} pixels need {needed / 2**30:.3g} GiB; "
            f"expected at most the {available / 2**30:.3g} GiB that this machine has",
            "film",
        )


def run_tiles(
    kernel: Any, arguments: Sequence[Any], pixels: int, spp: int, threads: int, say: Progress
) -> None:
    """Run a kernel for all tiles on a thread pool.  Kernels release the GIL; the main thread
    reports progress and handles Ctrl-C."""
    stop = threading.Event()

    def run(begin: int, end: int) -> None:
        # In plain Python (NUMBA_DISABLE_JIT=1) NumPy would warn of intended infinities (IEEE
        # division) and intended overflow (integer hashes).
        with np.errstate(all="ignore"):
            for first in range(0, spp, SAMPLES_PER_TILE):
                if stop.is_set():
                    return
                kernel(*arguments, begin, end, first, min(first + SAMPLES_PER_TILE, spp))

    step = max(1, min(pixels, SAMPLES_PER_TILE // spp))
    say("render", 0.0)
    pool = ThreadPoolExecutor(threads, thread_name_prefix="tile")
    try:
        waiting = {pool.submit(run, k, min(k + step, pixels)) for k in range(0, pixels, step)}
        total = len(waiting)
        while waiting:
            # Polled: waking this thread after each of 256 tiles costs 0.1 s (measured).
            done, waiting = wait(waiting, timeout=0.2, return_when=FIRST_EXCEPTION)
            for future in done:
                future.result()
            say("render", 1.0 - len(waiting) / total)
    except BaseException:
        stop.set()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


__all__ = ["Picture", "Progress", "render"]
