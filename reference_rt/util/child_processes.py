"""Child processes that end with their parent, even if it is killed and cannot end them itself."""

import ctypes
import functools
import os
import signal
import sys
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
