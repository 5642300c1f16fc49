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

from reference_rt.jit.kernel import (
    CACHE_FOLDER,
    Signature,
    is_compiled,
    is_compiling,
    precompile,
)
from reference_rt.util.processes import end_with_parent

PATIENCE = 60.0
"""Seconds to wait for the child when nothing else is left to do; all kernels of a scene compile in
less."""

Call = tuple[Callable[..., Any], Signature]
"""An entry kernel, and the argument types to compile it for."""

Report = Callable[[int, int], None]
"""Called with the number of kernels that are compiled, and of all that had to be."""

_NUMBER = struct.Struct("<i")


class Ahead:
    """Kernels that a child compiles while this process does something else: those of `calls` that
    are not in the cache, if there are several threads and a child can be forked.  A context
    manager: afterwards there is no child."""

    def __init__(self, calls: Sequence[Call], threads: int) -> None:
        self.calls = [call for call in calls if not is_compiled(*call)]
        self._child = 0
        if not self.calls or threads < 2 or not may_fork():
            self.calls = []
            return
        self._child = fork_with_compiler()
        if self._child == 0:
            try:
                for call in self.calls:
                    precompile(*call)
            finally:
                os._exit(0)

    def __enter__(self) -> "Ahead":
        return self

    def __exit__(self, *error: Any) -> None:
        if self._child:
            _end(self._child)

    @property
    def is_done(self) -> bool:
        """Whether there is nothing to wait for."""
        if self._child and has_ended(self._child):
            self._child = 0
        return self._child == 0


def precompile_all(
    calls: Sequence[Call], threads: int, say: Report | None = None, ahead: Ahead | None = None
) -> list[Callable[..., Any]]:
    """`kernel.precompile` of several entry kernels, in parallel where possible: see `compile_all`.

    ahead: kernels that a child compiles already.
    """
    begun = [] if ahead is None or ahead.is_done else ahead.calls
    missing = [call for call in calls if call not in begun and not is_compiled(*call)]
    compile_all(missing, threads, say, ahead)
    return [precompile(*call) for call in calls]


def compile_all(
    missing: Sequence[Call],
    threads: int,
    say: Report | None = None,
    ahead: Ahead | None = None,
) -> None:
    """Compile entry kernels that are not in the cache.

    They are divided among this process and forked children, `threads` in all, each of which takes
    the next when it has finished one: so the longest should come first.  Children store their
    kernels in the cache.  Without children (threads = 1, no `fork`, no cache, not in the main
    thread) this process compiles all; of those that children fail at, none.  say(done, total):
    called after each kernel, and before the first.  ahead: a child that compiles others, for which
    this waits.
    """
    begun = 0 if ahead is None or ahead.is_done else len(ahead.calls)
    total = len(missing) + begun
    if total == 0:
        return
    tell = say or (lambda done, total: None)
    tell(0, total)
    if threads > 1 and len(missing) > 1 and may_fork():
        _compile_in_parallel(missing, min(threads, len(missing)) - 1, total, tell, ahead)
    else:
        # What another process compiles comes last: meanwhile this one compiles what that one needs.
        left = list(missing)
        while left:
            k = next((k for k, call in enumerate(left) if not is_compiling(*call)), 0)
            precompile(*left.pop(k))
            tell(len(missing) - len(left), total)
    if begun:
        end = time.monotonic() + PATIENCE
        while ahead is not None and not ahead.is_done and time.monotonic() < end:
            time.sleep(0.002)
        tell(total, total)


def _compile_in_parallel(
    missing: Sequence[Call], children: int, total: int, tell: Report, ahead: Ahead | None
) -> None:
    """Compile these here and in children: whoever is free takes the next number from a pipe.  While
    there is the child of `ahead`, there is one child less."""
    waiting, numbers = os.pipe()
    finished, reports = os.pipe()
    started: list[int] = []
    try:
        for k in range(len(missing)):
            os.write(numbers, _NUMBER.pack(k))  # 4 bytes each: a pipe holds 16,000
        os.close(numbers)
        numbers = -1
        os.set_blocking(finished, False)
        done = 0
        while (taken := os.read(waiting, _NUMBER.size)) != b"":
            while len(started) < children - (ahead is not None and not ahead.is_done):
                started.append(_fork(missing, waiting, reports))
            precompile(*missing[_NUMBER.unpack(taken)[0]])
            done += 1 + _count(finished)
            tell(done, total)
        end = time.monotonic() + PATIENCE
        for child in started:
            has_child = True
            while has_child:
                has_child = not has_ended(child) and time.monotonic() < end
                if (more := _count(finished)) > 0:  # also what it reported last
                    done += more
                    tell(done, total)
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
    """`os.fork` of a child that can compile, and that ends with this process, not by Ctrl-C."""
    # Holding the compiler's lock, so that no other thread does: the child has this thread only, and
    # a lock held by another would stay locked in it for ever.
    parent = os.getpid()
    with global_compiler_lock, warnings.catch_warnings():
        # Python 3.12 warns of a fork in a process with threads.
        warnings.simplefilter("ignore", DeprecationWarning)
        # A terminal sends Ctrl-C to the child too.  Raised there before it is known to be a child,
        # it would end it as the program ends, with a message and exit handlers.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            child = os.fork()
            if child == 0:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
                end_with_parent(parent)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
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
