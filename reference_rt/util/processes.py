"""Ends of processes: children end with their parent, even if it is killed and cannot end them
itself; signals that end the program are raised as exceptions, so that cleanup code runs.
"""

import ctypes
import functools
import os
import signal
import sys
import threading
from typing import Any

_PR_SET_PDEATHSIG = 1  # linux/prctl.h

# Loaded at import: a forked child must not load libraries, since other threads may have held their
# locks.
_PRCTL: Any = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


def end_with_parent(parent: int) -> None:
    """Called in a new process: makes Linux kill it when the thread that started it ends; no effect
    on other systems.  parent: id of the process that started it, which may have ended already."""
    if _PRCTL is not None:
        _PRCTL(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)


def tied() -> dict[str, Any]:
    """Options of `subprocess.run` and `Popen` for a child that ends with this process."""
    if _PRCTL is None:
        return {}
    return {"preexec_fn": functools.partial(end_with_parent, os.getpid())}


class Terminated(KeyboardInterrupt):
    """Raised on SIGINT, SIGTERM or SIGHUP: child processes are ended, and no file is left half
    written.  Its argument is the signal's number."""


_received: list[int] = []

_AGAIN = 2.0
"""Seconds after which the signal is sent again if the command has not ended."""


def _terminate(number: int, frame: Any) -> None:
    _received.append(number)
    # Python drops the exception if the signal arrives in a callback, of LLVM or of a fork.
    again = threading.Timer(_AGAIN, os.kill, (os.getpid(), number))
    again.daemon = True
    again.start()
    raise Terminated(number)


def dropped() -> Terminated | None:
    """The signal that this process has received, if any: the reason for errors after it.  LLVM, for
    example, fails where its callback was interrupted, and the interruption itself is lost."""
    return Terminated(_received[-1]) if _received else None


def exit_code_of(error: KeyboardInterrupt) -> int:
    """The exit code for a caught interruption; from now on the signal is ignored."""
    if not isinstance(error, Terminated):
        return 130
    number = int(error.args[0])
    signal.signal(number, signal.SIG_IGN)
    return 128 + number


def catch_signals() -> None:
    """Makes SIGINT, SIGTERM and SIGHUP raise `Terminated` in the main thread."""
    lost = sys.unraisablehook

    def report(unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, Terminated):  # which comes again
            lost(unraisable)

    sys.unraisablehook = report
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number and signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _terminate)  # one that is ignored, as by `nohup`, stays so
