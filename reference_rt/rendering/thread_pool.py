"""Kernel calls on a thread pool, one tile of pixels per task.  Kernels release the GIL."""

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from reference_rt.rendering.units import Unit

SAMPLES_PER_TILE = 1 << 15
"""Samples of one kernel call, about 20 ms: short enough for progress and Ctrl-C, long against the
0.1 ms that a task of the thread pool costs."""

Progress = Callable[[str, float], None]
"""Called with the phase ("compile" or "render") and the fraction of it that is done."""


def tiles_of(unit: Unit) -> Iterator[Unit]:
    """The kernel calls of a unit, in order."""
    step = max(1, SAMPLES_PER_TILE // (unit.last - unit.first))
    for begin in range(unit.begin, unit.end, step):
        end = min(begin + step, unit.end)
        for first in range(unit.first, unit.last, SAMPLES_PER_TILE):
            yield Unit(begin, end, first, min(first + SAMPLES_PER_TILE, unit.last))


def run_tiles(
    kernel: Any, arguments: Sequence[Any], pixels: int, spp: int, threads: int, say: Progress
) -> None:
    """Run a kernel for all tiles; the calling thread reports progress and handles Ctrl-C.

    kernel(*arguments, begin, end, first, last) computes samples first to last - 1 of pixels begin
    to end - 1.
    """
    stop = threading.Event()

    def run(begin: int, end: int) -> None:
        # In plain Python (NUMBA_DISABLE_JIT=1) NumPy would warn of intended infinities (IEEE
        # division) and intended overflow (integer hashes).
        with np.errstate(all="ignore"):
            for tile in tiles_of(Unit(begin, end, 0, spp)):
                if stop.is_set():
                    return
                kernel(*arguments, *tile)

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
