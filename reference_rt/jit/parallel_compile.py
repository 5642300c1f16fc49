"""Compilation in two processes at once: a forked child compiles some of the kernels.

Threads would not help: Numba's compiler is Python code, and holds the GIL.
"""

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
"""Seconds to wait for the child when nothing else is left to do; all kernels of a scene compile in
less."""

Call = tuple[Callable[..., Any], Signature]
"""An entry kernel, and the argument types to compile it for."""


def precompile_all(calls: Sequence[Call], threads: int) -> list[Callable[..., Any]]:
    """`kernel.precompile` of several entry kernels, in parallel where possible.

    The first that is not in the cache is compiled here; a forked child compiles the others
    meanwhile and stores them in the cache.  Without a child (threads = 1, no `fork`, no cache, not
    in the main thread), or if it fails, this process compiles all of them.
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
    """Whether a child can be forked, and can hand over its kernels through the cache."""
    return (
        sys.platform == "linux"
        and CACHE_FOLDER is not None
        and threading.current_thread() is threading.main_thread()
    )


def _fork(calls: Sequence[Call]) -> int:
    """The process id of a new child that compiles these and then exits."""
    # Holding the compiler's lock, so that no other thread does: the child has this thread only, and
    # a lock held by another would stay locked in it for ever.
    parent = os.getpid()
    with global_compiler_lock, warnings.catch_warnings():
        # Python 3.12 warns of a fork in a process with threads.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child != 0:
        return child
    try:
        end_with_parent(parent)
        for call in calls:
            precompile(*call)
    finally:
        # At once: buffers must not be flushed, nor exit handlers run, a second time.  An error is
        # not reported, since the parent compiles the kernel again and reports it.
        os._exit(0)


def _wait(child: int) -> None:
    end = time.monotonic() + PATIENCE
    with suppress(ChildProcessError):  # other code of this process may have reaped the child
        while os.waitpid(child, os.WNOHANG)[0] == 0:
            if time.monotonic() > end:
                _end(child)
                return
            time.sleep(0.002)


def _end(child: int) -> None:
    with suppress(ProcessLookupError, ChildProcessError):
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
