"""Child processes that end with their parent, also where that is killed and cannot end them."""

import ctypes
import functools
import os
import signal
import sys
from typing import Any

_PR_SET_PDEATHSIG = 1  # linux/prctl.h

# Found now: a new process must not load libraries, whose locks other threads may have held.
_PRCTL: Any = ctypes.CDLL(None).prctl if sys.platform == "linux" else None


def end_with_parent(parent: int) -> None:
    """Called in a new process: have Linux kill it when the thread that began it ends; elsewhere do
    nothing.  parent: the number of the process that began it, which may have ended already."""
    if _PRCTL is not None:
        _PRCTL(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)


def tied() -> dict[str, Any]:
    """Options of `subprocess.run` and `Popen` for a child that is to end with this process."""
    if _PRCTL is None:
        return {}
    return {"preexec_fn": functools.partial(end_with_parent, os.getpid())}
