"""Functions for workers on other machines."""

import socket
import time
from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar

from comparisons.runs.provenance import everything_fingerprint
from reference_rt.util.errors import WorkersError
from reference_rt.util.workers import Workers, run_in_order

# Thread-pool cooldown: wait until idle threads stop spinning, before the next measurement.


_INTERVAL = 0.005
"""Seconds between two checks."""
_BUSY = 0.1
"""CPU time over wall-clock time above which a process is busy: one busy thread takes 1, sleeping
between the checks far less."""


def cool_down(longest: float = 1.0) -> None:
    """Wait until no thread of this process is busy, at most `longest` seconds.

    Dr.Jit's threads spin for 20 ms after their last task.  Kernels started in that time, with as
    many threads as cores, took 53 ns instead of 33 (measured).
    """
    end = time.perf_counter() + longest
    while time.perf_counter() < end:
        used, began = time.process_time(), time.perf_counter()
        time.sleep(_INTERVAL)
        if time.process_time() - used < _BUSY * (time.perf_counter() - began):
            return


T = TypeVar("T")


def check_sources(sources: str) -> None:
    """Raise WorkersError unless this machine has these (`everything_fingerprint`)."""
    if sources != everything_fingerprint():
        raise WorkersError(
            f"the worker on {socket.gethostname()} has other sources of reference_rt or "
            "comparisons, or other versions of packages; expected the same as here"
        )


def run_elsewhere(
    workers: Workers, function: Callable[..., T], tasks: Iterable[tuple[Any, ...]]
) -> Generator[T, None, None]:
    """function(*task) of each task, in order.  Raises WorkersError for workers that have other
    sources, and what the function raises."""
    sources = everything_fingerprint()
    yield from run_in_order(workers, _checked, ((sources, function, *task) for task in tasks))


def _checked(sources: str, function: Callable[..., T], *arguments: Any) -> T:
    check_sources(sources)
    return function(*arguments)
