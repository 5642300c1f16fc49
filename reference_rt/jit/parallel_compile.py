"""Compiling in two processes at once: Numba's compiler is Python code, and a process runs one
thread of that at a time."""

import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from numba.core.compiler_lock import global_compiler_lock

from reference_rt.jit.kernel import CACHE_FOLDER, Signature, is_compiled, precompile
from reference_rt.util.child_processes import end_with_parent

PATIENCE = 60.0
"""Seconds that the other process is waited for when nothing else is left to do: all kernels of a
scene take less."""

Call = tuple[Callable[..., Any], Signature]
"""An entry kernel, and the types of arguments that it is to be compiled for."""


def precompile_all(calls: Sequence[Call], threads: int) -> list[Callable[..., Any]]:
    """`kernel.precompile` of entry kernels: what runs each for arguments of its types.

    Of those that are to be compiled the first is compiled here, the others meanwhile in a copy of
    this process that leaves them in the cache; where there is no such process (one of the `threads`
    that may be used, no `fork`, no cache, not the main thread), or it comes to nothing, here too.
    """
    missing: list[Call] = []
    if len(calls) > 1 and threads > 1 and may_fork():
        missing = [call for call in calls if not is_compiled(*call)]
    child = _fork(missing[1:]) if len(missing) > 1 else None
    try:
        for call in missing[:1]:
            precompile(*call)
        if child is not None:
            _wait(child)
    except BaseException:
        if child is not None:
            _end(child)
        raise
    return [precompile(*call) for call in calls]


def may_fork() -> bool:
    """Whether another process could be begun, and its kernels found."""
    return (
        sys.platform == "linux"
        and CACHE_FOLDER is not None
        and threading.current_thread() is threading.main_thread()
    )


def _fork(calls: Sequence[Call]) -> int:
    """The number of a new process that compiles these and does nothing else."""
    # Nobody else holds the compiler's lock then: the new process has this thread only, and what
    # other threads hold stays locked in it.
    parent = os.getpid()
    with global_compiler_lock, warnings.catch_warnings():
        # Python 3.12 warns of that.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child != 0:
        return child
    try:
        end_with_parent(parent)
        for call in calls:
            precompile(*call)
    finally:
        # Neither buffers are written nor handlers called a second time; nor is an error told: who
        # compiles it again will.
        os._exit(0)


def _wait(child: int) -> None:
    end = time.monotonic() + PATIENCE
    with suppress(ChildProcessError):  # where somebody else waits for all that end
        while os.waitpid(child, os.WNOHANG)[0] == 0:
            if time.monotonic() > end:
                _end(child)
                return
            time.sleep(0.002)


def _end(child: int) -> None:
    with suppress(ProcessLookupError, ChildProcessError):
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
