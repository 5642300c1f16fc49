"""Arrays of rays: checked and brought to one shape, and handed to threads."""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import FloatArray


def numbers(name: str, values: npt.ArrayLike, *tail: int) -> FloatArray:
    """Values as a float64 array whose shape ends in `tail`.  Raises ValueError for what is not
    numbers, or has another shape."""
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


def together(
    *arrays: tuple[str, FloatArray, int],
) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Arrays (name, array, number of dimensions of one entry) of one leading shape, to which they
    are broadcast: that shape, and each as (n, ...).  Raises ValueError.

    Kernels are compiled for arrays that are contiguous and writable: what is so already is not
    copied.
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
    """n rays from o (n, 3) into directions d (n, 3);  t_min, t_max (n,): None where nothing is
    limited;  shape: that of the arrays that were given, broadcast, without their last dimension, ()
    for a single ray."""

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

    Raises ValueError; of t also for NaN, and for a t_min below 0.
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
    shape, flat = together(*arrays)
    found = {name: array for (name, _, _), array in zip(arrays, flat, strict=True)}
    return Rays(shape, flat[0], flat[1], found.get("t_min"), found.get("t_max"))


def checked_rays(
    origins: npt.ArrayLike, directions: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Both as float64 arrays (n, 3).  Raises ValueError."""
    rays = rays_of(origins, directions)
    return rays.o, rays.d


def shaped(values: npt.NDArray[Any], shape: tuple[int, ...]) -> Any:
    """(n, ...) as the given rays were shaped; of a single ray, whose shape is (), a number."""
    return values.reshape(shape + values.shape[1:])[()]


_LEAST, _MOST = 1 << 12, 1 << 16
"""Rays that a thread takes at once.  To hand them over it has to wait for Python's lock: with 2^14
at once two threads took 43 ns of both together for a camera ray, with 2^16 and more 34, one thread
31 (measured, a million rays)."""


def in_blocks(
    trace: Callable[[slice], None], n: int, threads: int | None, least: int = _LEAST
) -> None:
    """`trace` of all of n rays, on threads (None: all cores), at least `least` of them at once:
    kernels release the GIL.  Raises ValueError for a number of threads below 1."""

    def run(k: slice) -> None:
        with np.errstate(all="ignore"):
            trace(k)

    if threads is not None and threads < 1:
        raise ValueError(f"threads: expected 1 or more, got {threads}")
    threads = threads or os.cpu_count() or 1
    # Eight shares of each thread: then none waits long for another's last.
    size = min(max(n // (8 * threads), least), _MOST)
    blocks = [slice(k, min(k + size, n)) for k in range(0, n, size)]
    if len(blocks) < 2 or threads == 1:
        for k in blocks:
            run(k)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(run, blocks):
            pass
