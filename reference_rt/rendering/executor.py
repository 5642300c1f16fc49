"""Executors compute units: the threads of this process, or any workers (`util.workers`).

A unit's sums are copied to the executor and back, so that a unit is a function of what it is given:
one that was lost can be computed again, and nothing is ever added twice.
"""

import threading
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from reference_rt.rendering import thread_pool
from reference_rt.rendering.accumulation import Sums
from reference_rt.rendering.prepared import Done, Prepared
from reference_rt.rendering.remote import SIZE, RemoteScene, compute_remotely
from reference_rt.rendering.units import Unit
from reference_rt.util.workers import Workers


class Executor(Protocol):
    """size: samples of a unit that it likes best;  slots: units that keep it busy;
    samples_of_pass: samples of all pixels with which a pass keeps it busy."""

    @property
    def size(self) -> int: ...

    @property
    def slots(self) -> int: ...

    @property
    def samples_of_pass(self) -> int: ...

    def submit(self, unit: Unit, sums: Sums) -> "Future[Done]":
        """Add the samples of a unit to the sums of its pixels, sooner or later."""

    def recovers(self, error: BaseException) -> bool:
        """Called for a unit that failed: whether it may be submitted again."""

    def progress(self, fraction: float) -> None:
        """Called in the main thread now and then, with the fraction of the picture that is done."""

    def stop(self) -> None:
        """Give up what is being computed, as soon as possible: it raises `StoppedError`."""

    def close(self) -> None:
        """End its threads and processes."""


_AHEAD = 16
"""Units of each thread: none waits while others are collected."""


class Threads:
    """An `Executor`: the threads of this process."""

    samples_of_pass = 0  # passes of 16 samples are shown sooner

    def __init__(self, prepared: Prepared, threads: int, chunk: int) -> None:
        """chunk: see `units`."""
        self._prepared, self._chunk = prepared, chunk
        self._stop = threading.Event()
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="tile")
        self.size, self.slots = thread_pool.SAMPLES_PER_TILE, _AHEAD * threads

    def submit(self, unit: Unit, sums: Sums) -> "Future[Done]":
        return self._pool.submit(self._prepared.compute, unit, sums, self._chunk, self._stop)

    def recovers(self, error: BaseException) -> bool:
        return False

    def progress(self, fraction: float) -> None:
        self._prepared.running.progress(fraction)

    def stop(self) -> None:
        self._stop.set()

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)


_THREADS_OF_SIZE, _LARGEST = 32, SIZE << 4
"""Threads of workers that units of SIZE keep busy, while client and scheduler take 5 to 10 ms for
each (measured); samples of the largest units, of ten seconds."""


class Remote:
    """An `Executor`: workers in other processes or on other machines."""

    def __init__(self, scene: RemoteScene, workers: Workers) -> None:
        self._scene, self._workers = scene, workers

    @property
    def slots(self) -> int:
        return 2 * self._workers.threads + 1

    @property
    def size(self) -> int:
        """Larger for more workers: client and scheduler take milliseconds for each unit."""
        size = SIZE
        while size * _THREADS_OF_SIZE < SIZE * self._workers.threads and size < _LARGEST:
            size *= 2
        return size

    @property
    def samples_of_pass(self) -> int:
        return 2 * self.slots * self.size

    def submit(self, unit: Unit, sums: Sums) -> "Future[Done]":
        given = sums if unit.first else None
        return self._workers.submit(compute_remotely, self._scene, unit, given)

    def recovers(self, error: BaseException) -> bool:
        return self._workers.recovers(error)

    def progress(self, fraction: float) -> None:
        pass

    def stop(self) -> None:
        self._workers.stop()

    def close(self) -> None:
        self._workers.close()
