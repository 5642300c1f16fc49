"""Workers run functions: threads of this process, processes of this machine, or the machines of
`cluster`.

All have one interface, so that whatever is made of independent tasks runs on any of them.  A task
is a function of its arguments alone: one that was lost with its worker is run again.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import (
    FIRST_COMPLETED,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any, Protocol, TypeVar

from reference_rt.util.errors import WorkersError
from reference_rt.util.processes import end_with_parent

T = TypeVar("T")

_MOST_DEATHS = 5
"""Times in a row that processes may die before anything is computed."""

_MOST_LOSSES = 10
"""Times that one task may be lost."""

_POLL = 0.1
"""Seconds between calls of `watch`."""


class Workers(Protocol):
    """What runs functions.  Processes and machines need functions and arguments that can be
    pickled."""

    @property
    def threads(self) -> int:
        """How many functions run at the same time."""

    def submit(self, function: Callable[..., T], *arguments: Any) -> "Future[T]":
        """Run a function, sooner or later."""

    def recovers(self, error: BaseException) -> bool:
        """Called for a function that failed: whether it may be submitted again.  Raises
        WorkersError if there are no workers any more."""

    def stop(self) -> None:
        """Give up what is running, as far as possible."""

    def close(self) -> None:
        """End the threads, processes or connections."""


class Threads:
    """`Workers`: threads of this process, for functions that wait for other processes."""

    def __init__(self, threads: int) -> None:
        self.threads, self._pool = threads, ThreadPoolExecutor(threads)

    def submit(self, function: Callable[..., T], *arguments: Any) -> "Future[T]":
        return self._pool.submit(function, *arguments)

    def recovers(self, error: BaseException) -> bool:
        return False

    def stop(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)


class Processes:
    """`Workers`: processes of one thread each.  One that dies is replaced."""

    def __init__(self, processes: int) -> None:
        self.threads, self._deaths = processes, 0
        self._pool = self._start()

    def submit(self, function: Callable[..., T], *arguments: Any) -> "Future[T]":
        future = self._pool.submit(function, *arguments)
        future.add_done_callback(self._count)
        return future

    def recovers(self, error: BaseException) -> bool:
        if not isinstance(error, BrokenProcessPool):
            return False
        try:  # of all functions of a pool that is broken only the first one replaces it
            self._pool.submit(os.getpid)
        except BrokenProcessPool:
            self._deaths += 1
            if self._deaths >= _MOST_DEATHS:
                raise WorkersError(
                    f"processes have died {self._deaths} times without computing anything, "
                    "perhaps for lack of memory; expected fewer --workers, or in a script of "
                    "Python that its work begins below: if __name__ == '__main__'"
                ) from None
            self._pool.shutdown(wait=False)
            self._pool = self._start()
        return True

    def stop(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)

    def _start(self) -> ProcessPoolExecutor:
        # Forked children would have this process's locks, but not the threads that hold them.
        spawn = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.threads, spawn, _begin, (os.getpid(),))

    def _count(self, future: "Future[Any]") -> None:
        with suppress(BaseException):
            if future.exception() is None:
                self._deaths = 0


def _begin(parent: int) -> None:
    """In a new process: ends with its parent, which alone handles Ctrl-C."""
    end_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def run_all(
    workers: Workers,
    function: Callable[..., T],
    tasks: Iterable[tuple[Any, ...]],
    watch: Callable[[], None] = lambda: None,
) -> Generator[tuple[int, T], None, None]:
    """Yield (k, function(*tasks[k])) for all tasks, as they end; `watch` is called meanwhile.

    Tasks are taken from their iterator when a worker is free.  Closing the generator gives up what
    is running.  Raises what a function raised; WorkersError.
    """
    left = enumerate(tasks)
    running: dict[Future[T], tuple[int, tuple[Any, ...]]] = {}
    losses: dict[int, int] = {}
    try:
        while True:
            while len(running) < workers.threads and (task := next(left, None)) is not None:
                running[workers.submit(function, *task[1])] = task
            if not running:
                return
            done, _ = wait(running, _POLL, FIRST_COMPLETED)
            watch()
            for future in [future for future in running if future in done]:
                number, arguments = running.pop(future)
                try:
                    result = future.result()
                except BaseException as error:
                    losses[number] = losses.get(number, 0) + 1
                    if losses[number] > _MOST_LOSSES or not workers.recovers(error):
                        raise
                    running[workers.submit(function, *arguments)] = (number, arguments)
                else:
                    yield number, result
    finally:
        for future in running:
            future.cancel()


def run_in_order(
    workers: Workers, function: Callable[..., T], tasks: Iterable[tuple[Any, ...]]
) -> Generator[T, None, None]:
    """The results of `run_all` in the order of the tasks, each as soon as those before it."""
    early: dict[int, T] = {}
    following = 0
    for number, result in run_all(workers, function, tasks):
        early[number] = result
        while following in early:
            yield early.pop(following)
            following += 1
