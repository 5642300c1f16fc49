"""Functions for workers on other machines."""

import socket
from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar

from comparisons.runs.fingerprint import everything_fingerprint
from reference_rt.util.errors import WorkersError
from reference_rt.util.workers import Workers, run_in_order

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
