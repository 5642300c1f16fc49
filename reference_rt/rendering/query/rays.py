"""Arrays of rays: checks, broadcasting, and blocks for threads; the rays of a scene's camera."""

import math
import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.cameras import LENS_CENTRE, camera_ray
from reference_rt.core.arrays import FloatArray
from reference_rt.jit.kernel import entry_kernel
from reference_rt.scene.build import BuiltScene


def numbers(name: str, values: npt.ArrayLike, *tail: int) -> FloatArray:
    """Values as a float64 array whose shape ends in `tail`.  Raises ValueError for other shapes and
    for values that are not real numbers."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.empty(0, np.object_)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name}: expected an array of real numbers")
    if array.shape[array.ndim - len(tail) :] != tail:
        expected = f"({', '.join(map(str, ('...', *tail)))})"
        raise ValueError(f"{name}: expected shape {expected}, got {array.shape}")
    return np.asarray(array, np.float64)


def broadcast(*arrays: tuple[str, FloatArray, int]) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Broadcast arrays (name, array, number of trailing dimensions of an entry) to one leading
    shape: that shape, and each array as (n, ...).  Raises ValueError.

    Kernels need contiguous and writable arrays; arrays that are so already are not copied.
    """
    leading = [a.shape[: a.ndim - tail] for _, a, tail in arrays]
    try:
        shape = np.broadcast_shapes(*leading)
    except ValueError:
        described = ", ".join(f"{name} {a.shape}" for name, a, _ in arrays)
        raise ValueError(f"expected shapes that broadcast to one, got {described}") from None
    flat = []
    for (_, a, tail), own in zip(arrays, leading, strict=True):
        entry = a.shape[a.ndim - tail :]
        if own != shape:
            a = np.broadcast_to(a, shape + entry)
        flat.append(np.require(a.reshape((math.prod(shape), *entry)), np.float64, ["C", "A", "W"]))
    return shape, flat


class Rays(NamedTuple):
    """n rays.  o, d (n, 3): origins and directions;  t_min, t_max (n,): None for no limit;  shape:
    of the given arrays, broadcast, without the last dimension; () for a single ray."""

    shape: tuple[int, ...]
    o: FloatArray
    d: FloatArray
    t_min: FloatArray | None
    t_max: FloatArray | None


def rays_of(
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = math.inf,
) -> Rays:
    """Origins (..., 3) and directions (..., 3), and t_min and t_max (...), broadcast.

    Raises ValueError, also for a t that is NaN and for a negative t_min.
    """
    arrays = [
        ("origins", numbers("origins", origins, 3), 1),
        ("directions", numbers("directions", directions, 3), 1),
    ]
    limits = {"t_min": (numbers("t_min", t_min), 0.0), "t_max": (numbers("t_max", t_max), math.inf)}
    for name, (limit, without) in limits.items():
        if np.isnan(limit).any():
            raise ValueError(f"{name}: expected numbers, got NaN")
        if limit.ndim > 0 or limit != without:
            arrays.append((name, limit, 0))
    if (limits["t_min"][0] < 0.0).any():
        raise ValueError("t_min: expected 0 or above")
    shape, flat = broadcast(*arrays)
    found = {name: array for (name, _, _), array in zip(arrays, flat, strict=True)}
    return Rays(shape, flat[0], flat[1], found.get("t_min"), found.get("t_max"))


def checked_rays(
    origins: npt.ArrayLike, directions: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Both as float64 arrays (n, 3).  Raises ValueError."""
    rays = rays_of(origins, directions)
    return rays.o, rays.d


def shaped(values: npt.NDArray[Any], shape: tuple[int, ...]) -> Any:
    """(n, ...) in the shape of the given rays; a number for a single ray, whose shape is ()."""
    return values.reshape(shape + values.shape[1:])[()]


def check_in_unit_cube(u: FloatArray) -> None:
    """Raise ValueError for random numbers outside [0, 1)."""
    if not ((u >= 0.0) & (u < 1.0)).all():
        raise ValueError("u: expected numbers from 0 up to, not including, 1")


_LEAST, _MOST = 1 << 12, 1 << 16
"""Fewest and most rays of a thread's block.  Each block costs a wait for the GIL: for a camera ray
two threads together took 43 ns with blocks of 2^14, 34 ns with 2^16 and more, one thread 31 ns
(measured, a million rays)."""


def in_blocks(
    trace: Callable[[slice], None], n: int, threads: int | None, least: int = _LEAST
) -> None:
    """Call `trace` for blocks of at least `least` of n rays, on threads (None: all cores; kernels
    release the GIL), of which the caller's is one.  Raises ValueError for a number of threads below
    1."""
    if threads is not None and threads < 1:
        raise ValueError(f"threads: expected 1 or more, got {threads}")
    threads = threads or os.cpu_count() or 1
    # Ever smaller blocks, so that no thread waits long for the last block of another.
    blocks, end = [], 0
    while end < n:
        begin, size = end, min(max((n - end) // (2 * threads), least), _MOST)
        end = min(begin + size, n)
        blocks.append(slice(begin, end))
    waiting = iter(blocks)

    def run() -> None:
        with np.errstate(all="ignore"):
            for k in waiting:
                trace(k)

    helpers = min(threads, len(blocks)) - 1
    if helpers < 1:
        run()
        return
    with ThreadPoolExecutor(helpers) as pool:
        try:
            helping = [pool.submit(run) for _ in range(helpers)]
            run()
        finally:  # after Ctrl-C the helpers, which the pool waits for, begin no further block
            deque(waiting, maxlen=0)
        for helper in helping:
            helper.result()


# ---- the rays of a scene's camera ----------------------------------------------------------------


class CameraRays(NamedTuple):
    """origins, directions (..., 3): in the world, directions of unit length."""

    origins: FloatArray
    directions: FloatArray


# It takes only the camera, so that all scenes with such a camera share it.
@entry_kernel
def camera_kernel(
    view: Any, x: FloatArray, y: FloatArray, lens: FloatArray, o: FloatArray, d: FloatArray
) -> None:
    for i in range(len(x)):
        ray = camera_ray(view, x[i], y[i], (lens[i, 0], lens[i, 1]))
        o[i, 0], o[i, 1], o[i, 2] = ray.o
        d[i, 0], d[i, 1], d[i, 2] = ray.d


def camera_rays(
    scene: BuiltScene,
    pixels: npt.ArrayLike | None = None,
    offsets: npt.ArrayLike = (0.0, 0.0),
    lens: npt.ArrayLike = LENS_CENTRE,
    threads: int | None = None,
) -> CameraRays:
    """The camera's rays through points of the film, as `render` traces them.

    pixels (..., 2): column and row, counted from the top left; None: all, (height, width);  offsets
    (..., 2): from the pixel's centre, in pixels to the right and down, within [-1/2, 1/2] for
    points of the pixel itself;  lens (..., 2): the numbers in [0, 1) that select the point of a
    thin lens, (1/2, 1/2) for its middle; other cameras ignore them.  All broadcast.  Origins are on
    the camera's near clipping plane, if it has one; the far one, where the rays end, is
    `scene.camera.far`.  Raises ValueError.
    """
    width, height = scene.film.width, scene.film.height
    if pixels is None:
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    shape, (pixel, offset, on_lens) = broadcast(
        ("pixels", numbers("pixels", pixels, 2), 1),
        ("offsets", numbers("offsets", offsets, 2), 1),
        ("lens", numbers("lens", lens, 2), 1),
    )
    if not ((on_lens >= 0.0) & (on_lens <= 1.0)).all():
        raise ValueError("lens: expected numbers from 0 to 1")
    x = (pixel[:, 0] + 0.5 + offset[:, 0]) / width
    y = (pixel[:, 1] + 0.5 + offset[:, 1]) / height
    view = scene.camera.setup(width, height)
    o, d = np.empty((2, math.prod(shape), 3))

    def send(k: slice) -> None:
        camera_kernel(view, x[k], y[k], on_lens[k], o[k], d[k])

    in_blocks(send, len(o), threads)
    return CameraRays(shaped(o, shape), shaped(d, shape))
