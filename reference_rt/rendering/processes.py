"""An executor of several processes on this machine."""

import multiprocessing
import os
import signal
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress

from reference_rt.rendering.accumulation import Sums
from reference_rt.rendering.prepared import Done
from reference_rt.rendering.remote import SIZE, RemoteScene, compute_remotely
from reference_rt.rendering.units import Unit
from reference_rt.util.child_processes import end_with_parent
from reference_rt.util.errors import WorkersError

_MOST_DEATHS = 5
"""Times in a row that processes may die before a unit is computed."""


class Processes:
    """An `executor.Executor`: processes of one thread each.  One that dies is replaced, and what it
    was computing is computed again."""

    size = SIZE

    def __init__(self, scene: RemoteScene, workers: int) -> None:
        self._scene, self._workers, self._deaths = scene, workers, 0
        self.slots = 2 * workers + 1
        self.samples_of_pass = 2 * self.slots * SIZE
        self._pool = self._start()

    def submit(self, unit: Unit, sums: Sums) -> "Future[Done]":
        future = self._pool.submit(
            compute_remotely, self._scene, unit, sums if unit.first else None
        )
        future.add_done_callback(self._count)
        return future

    def recovers(self, error: BaseException) -> bool:
        if not isinstance(error, BrokenProcessPool):
            return False
        try:  # of all units of a pool that is broken only the first one replaces it
            self._pool.submit(os.getpid)
        except BrokenProcessPool:
            self._deaths += 1
            if self._deaths >= _MOST_DEATHS:
                raise WorkersError(
                    f"processes have died {self._deaths} times without computing anything, "
                    "perhaps for lack of memory; expected fewer --workers"
                ) from None
            self._pool.shutdown(wait=False)
            self._pool = self._start()
        return True

    def progress(self, fraction: float) -> None:
        pass

    def stop(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)

    def _start(self) -> ProcessPoolExecutor:
        # Forked children would have this process's locks, but not the threads that hold them.
        spawn = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self._workers, spawn, _begin, (os.getpid(),))

    def _count(self, future: "Future[Done]") -> None:
        with suppress(BaseException):
            if future.exception() is None:
                self._deaths = 0


def _begin(parent: int) -> None:
    """In a new process: ends with its parent, which alone handles Ctrl-C."""
    end_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
