"""Signals that end the program: as exceptions, so that nothing is left behind."""

import os
import signal
import sys
import threading
from typing import Any


class Terminated(KeyboardInterrupt):
    """SIGINT, SIGTERM or SIGHUP, so that child processes are ended and no file is left half
    written.  Its argument is the signal's number."""


_AGAIN = 2.0
"""Seconds after which a signal is sent again that has not ended the command."""


def _terminate(number: int, frame: Any) -> None:
    # An exception is lost where the signal arrives in a callback: of LLVM, which compiles, or of a
    # fork.
    again = threading.Timer(_AGAIN, os.kill, (os.getpid(), number))
    again.daemon = True
    again.start()
    raise Terminated(number)


def exit_code_of(error: KeyboardInterrupt) -> int:
    """The exit code of an interruption that has been caught; it is not sent again."""
    if not isinstance(error, Terminated):
        return 130
    number = int(error.args[0])
    signal.signal(number, signal.SIG_IGN)
    return 128 + number


def catch_signals() -> None:
    """Let the program end by an exception, `Terminated`, on SIGINT, SIGTERM and SIGHUP."""
    lost = sys.unraisablehook

    def tell(unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, Terminated):  # which comes again
            lost(unraisable)

    sys.unraisablehook = tell
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number and signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _terminate)  # one that is ignored, as by `nohup`, stays so
