"""Rendering: bands of pixels on all cores, with progress and a clean stop."""

import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from reference_rt import sampling
from reference_rt.cameras import LENS_CENTRE, camera_ray, lens_sample
from reference_rt.film import film_offset
from reference_rt.integrators import RayCast, radiance
from reference_rt.integrators.ray_cast import cast
from reference_rt.kernel import entry_kernel, precompile
from reference_rt.sampling import draw_pair, start_sample
from reference_rt.scene import Scene
from reference_rt.shapes.shape import FloatArray
from reference_rt.tables import SceneTables, build_tables, colours
from reference_rt.vec3 import row

SAMPLES_PER_BAND = 1 << 15
"""A band takes some 20 ms: short enough for progress and Ctrl-C, long against the 0.1 ms that
handing it to a thread costs."""

Progress = Callable[[str, float], None]
"""Called with what is being done ("compile", "render") and the fraction of it that is done."""


@dataclass(frozen=True)
class Picture:
    """A rendered scene.

    layers: (height, width, 3) float64 linear radiance as "colour", or for ray casting all of
    colour (height, width, 3), distance (height, width), normal (height, width, 3), id (height,
    width) and uv (height, width, 2);  shown: the layer that is the picture;  seconds: wall clock of
    "tables" (files, arrays, hierarchy), "compile" (or loading what was compiled before) and
    "render".
    """

    layers: dict[str, FloatArray]
    shown: str = "colour"
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def colour(self) -> FloatArray:
        """(height, width, 3), row 0 on top."""
        return self.layers["colour"]

    @property
    def nonfinite(self) -> int:
        """Pixels of the colour with a NaN, or with more than float32, which files hold, can."""
        held = np.abs(self.colour) <= np.finfo(np.float32).max
        return int(np.count_nonzero(~held.all(axis=-1)))


@entry_kernel
def _render_band(
    integrator: Any,
    scene: SceneTables,
    view: Any,
    film_filter: Any,
    sampler_setup: Any,
    shape: tuple[int, int],
    spp: int,
    out: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """Samples first..last of the pixels begin..end, counted along rows, added to out (n, 3); with
    the last of all `spp` samples the sum becomes the mean."""
    width, height = shape
    for pixel in range(begin, end):
        y, x = pixel // width, pixel % width
        total = row(out, pixel)
        for sample in range(first, last):
            sampler = start_sample(sampler_setup, pixel, sample)
            u0, u1 = draw_pair(sampler, sampling.FILM)
            dx, weight_x = film_offset(film_filter, u0)
            dy, weight_y = film_offset(film_filter, u1)
            lens = lens_sample(view, sampler)
            ray = camera_ray(view, (x + 0.5 + dx) / width, (y + 0.5 + dy) / height, lens)
            arriving = radiance(integrator, scene, ray, sampler)
            total = total + arriving * (weight_x * weight_y)
        if last == spp:
            total = total / spp
        out[pixel, 0], out[pixel, 1], out[pixel, 2] = total


@entry_kernel
def _cast_band(
    scene: SceneTables,
    material_colours: FloatArray,
    view: Any,
    shape: tuple[int, int],
    out: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """All layers at the centres of the pixels begin..end, into out (n, 10);
    `first` and `last`, which samples, are there for the likeness to `_render_band`."""
    width, height = shape
    for pixel in range(begin, end):
        y, x = pixel // width, pixel % width
        ray = camera_ray(view, (x + 0.5) / width, (y + 0.5) / height, LENS_CENTRE)
        found = cast(scene, material_colours, ray)
        out[pixel, 0], out[pixel, 1], out[pixel, 2] = found.colour
        out[pixel, 3] = found.distance
        out[pixel, 4], out[pixel, 5], out[pixel, 6] = found.n
        out[pixel, 7], out[pixel, 8], out[pixel, 9] = found.id, found.u, found.v


def render(
    scene: Scene,
    *,
    threads: int | None = None,
    tables: SceneTables | None = None,
    progress: Progress | None = None,
) -> Picture:
    """Render a scene.

    The same scene gives the same bits for any number of `threads` (default: all cores).  `tables`
    spares building them again.  Ctrl-C stops within a band.  Raises SceneError.
    """
    say = progress or (lambda what, fraction: None)
    _check_memory(scene)
    clock = [time.perf_counter()]
    tables = build_tables(scene) if tables is None else tables
    clock.append(time.perf_counter())
    film, integrator = scene.film, scene.integrator
    view = scene.camera.setup(film.width, film.height)
    shape = (film.width, film.height)
    pixels = film.width * film.height
    band: Any
    arguments: tuple[Any, ...]
    if isinstance(integrator, RayCast):
        out, spp = np.zeros((pixels, 10)), 1
        band, arguments = _cast_band, (tables, colours(scene), view, shape, out)
    else:
        sampler = scene.resolved_sampler
        out, spp = np.zeros((pixels, 3)), sampler.spp
        setups = (integrator.setup(), tables, view, film.filter.setup(), sampler.setup())
        band, arguments = _render_band, (*setups, shape, spp, out)
    say("compile", 0.0)
    precompile(band, *arguments, 0, 0, 0, 0)
    say("compile", 1.0)
    clock.append(time.perf_counter())
    _run_bands(band, arguments, pixels, spp, threads or os.cpu_count() or 1, say)
    clock.append(time.perf_counter())
    seconds = dict(zip(("tables", "compile", "render"), np.diff(clock).tolist(), strict=True))
    return _picture(integrator, out.reshape(film.height, film.width, -1), seconds)


def _picture(integrator: Any, out: FloatArray, seconds: dict[str, float]) -> Picture:
    if not isinstance(integrator, RayCast):
        return Picture({"colour": out}, "colour", seconds)
    layers = {
        "colour": out[..., 0:3],
        "distance": out[..., 3],
        "normal": out[..., 4:7],
        "id": out[..., 7],
        "uv": out[..., 8:10],
    }
    return Picture(layers, integrator.show, seconds)


def _check_memory(scene: Scene) -> None:
    """Refuse a picture that cannot fit, before anything is allocated."""
    film = scene.film
    # 3 or 10 channels of float64, and as much again while files are written.
    needed = film.width * film.height * 10 * 2 * 8
    try:
        available = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):  # not every system tells
        available = 1 << 36
    if needed > available:
        raise scene.error(
            f"{film.width} x {film.height} pixels need {needed / 2**30:.3g} GiB; "
            f"expected at most the {available / 2**30:.3g} GiB that this machine has",
            "film",
        )


def _run_bands(
    band: Any, arguments: Sequence[Any], pixels: int, spp: int, threads: int, say: Progress
) -> None:
    """Bands on a pool.  Kernels release the GIL; the main thread reports and listens to Ctrl-C."""
    stop = threading.Event()

    def run(begin: int, end: int) -> None:
        # In plain Python (NUMBA_DISABLE_JIT=1) NumPy would warn of the infinities that IEEE
        # division and wrapping hashes are meant to make.
        with np.errstate(all="ignore"):
            for first in range(0, spp, SAMPLES_PER_BAND):
                if stop.is_set():
                    return
                band(*arguments, begin, end, first, min(first + SAMPLES_PER_BAND, spp))

    step = max(1, min(pixels, SAMPLES_PER_BAND // spp))
    say("render", 0.0)
    pool = ThreadPoolExecutor(threads, thread_name_prefix="band")
    try:
        waiting = {pool.submit(run, k, min(k + step, pixels)) for k in range(0, pixels, step)}
        total = len(waiting)
        while waiting:
            done, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
            for future in done:
                future.result()
            say("render", 1.0 - len(waiting) / total)
    except BaseException:
        stop.set()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


__all__ = ["Picture", "Progress", "render"]
