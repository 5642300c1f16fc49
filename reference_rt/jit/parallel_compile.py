"""Compilation in several processes at once: forked children compile some of the kernels.

Threads would not help: Numba's compiler is Python code, and holds the GIL.
"""

import os
import signal
import struct
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

Report = Callable[[int, int], None]
"""Called with the number of kernels that are compiled, and of all that had to be."""

_NUMBER = struct.Struct("<i")


def precompile_all(
    calls: Sequence[Call], threads: int, say: Report | None = None
) -> list[Callable[..., Any]]:
    """`kernel.precompile` of several entry kernels, in parallel where possible: see
    `compile_all`."""
    compile_all([call for call in calls if not is_compiled(*call)], threads, say)
    return [precompile(*call) for call in calls]


def compile_all(missing: Sequence[Call], threads: int, say: Report | None = None) -> None:
    """Compile entry kernels that are not in the cache.

    They are divided among this process and forked children, `threads` in all, each of which takes
    the next when it has finished one: so the longest should come first.  Children store their
    kernels in the cache.  Without children (threads = 1, no `fork`, no cache, not in the main
    thread) this process compiles all; of those that children fail at, none.  say(done, total):
    called after each kernel, and before the first.
    """
    if not missing:
        return
    tell = say or (lambda done, total: None)
    tell(0, len(missing))
    if threads > 1 and len(missing) > 1 and may_fork():
        _compile_in_parallel(missing, min(threads, len(missing)) - 1, tell)
        return
    for k, call in enumerate(missing):
        precompile(*call)
        tell(k + 1, len(missing))


def _compile_in_parallel(missing: Sequence[Call], children: int, tell: Report) -> None:
    """Compile these here and in children: whoever is free takes the next number from a pipe."""
    waiting, numbers = os.pipe()
    finished, reports = os.pipe()
    started: list[int] = []
    try:
        for k in range(len(missing)):
            os.write(numbers, _NUMBER.pack(k))  # 4 bytes each: a pipe holds 16,000
        os.close(numbers)
        numbers = -1
        os.set_blocking(finished, False)
        for _ in range(children):
            started.append(_fork(missing, waiting, reports))
        done = 0
        while (taken := os.read(waiting, _NUMBER.size)) != b"":
            precompile(*missing[_NUMBER.unpack(taken)[0]])
            done += 1 + _count(finished)
            tell(done, len(missing))
        end = time.monotonic() + PATIENCE
        for child in started:
            while not has_ended(child) and time.monotonic() < end:
                if (more := _count(finished)) > 0:
                    done += more
                    tell(done, len(missing))
                time.sleep(0.002)
    finally:
        for child in started:
            _end(child)
        for descriptor in (waiting, numbers, finished, reports):
            if descriptor >= 0:
                os.close(descriptor)


def _count(finished: int) -> int:
    """How many kernels children have reported since the last call."""
    with suppress(BlockingIOError):
        return len(os.read(finished, 1 << 16))
    return 0


def may_fork() -> bool:
    """Whether a child can be forked, and can hand over its kernels through the cache."""
    return (
        sys.platform == "linux"
        and CACHE_FOLDER is not None
        and threading.current_thread() is threading.main_thread()
    )


def _fork(calls: Sequence[Call], waiting: int, reports: int) -> int:
    """The process id of a new child, which compiles those whose numbers it takes from a pipe,
    reports each by one byte, and then exits."""
    child = fork_with_compiler()
    if child != 0:
        return child
    try:
        while (taken := os.read(waiting, _NUMBER.size)) != b"":
            precompile(*calls[_NUMBER.unpack(taken)[0]])
            os.write(reports, b".")
    finally:
        # At once: buffers must not be flushed, nor exit handlers run, a second time.  An error is
        # not reported, since the parent compiles the kernel again and reports it.
        os._exit(0)


def fork_with_compiler() -> int:
    """`os.fork` of a child that can compile, and that ends with this process."""
    # Holding the compiler's lock, so that no other thread does: the child has this thread only, and
    # a lock held by another would stay locked in it for ever.
    parent = os.getpid()
    with global_compiler_lock, warnings.catch_warnings():
        # Python 3.12 warns of a fork in a process with threads.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        end_with_parent(parent)
    return child


def has_ended(child: int) -> bool:
    """Whether a child process has ended; it is reaped."""
    try:
        return os.waitpid(child, os.WNOHANG)[0] != 0
    except ChildProcessError:  # other code of this process may have reaped the child
        return True


def _end(child: int) -> None:
    with suppress(ProcessLookupError, ChildProcessError):
        if not has_ended(child):
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
