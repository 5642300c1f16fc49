"""How much memory the machine has, so that what cannot fit is refused before it is read."""

import os
from contextlib import suppress
from pathlib import Path


def machine_memory() -> int | None:
    """Bytes of memory that this process may have in all: the machine's, or what its container or
    its shell (`ulimit -v`) leaves of it; None where the system does not say."""
    found = []
    with suppress(AttributeError, ValueError, OSError):  # Windows has no sysconf
        found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with suppress(OSError, ValueError):  # of Linux: control groups, where "max" is no number
        found.append(int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    with suppress(ImportError, OSError, ValueError):
        import resource

        soft = resource.getrlimit(resource.RLIMIT_AS)[0]
        if soft != resource.RLIM_INFINITY:
            found.append(soft)
    return min((n for n in found if n > 0), default=None)


def check_memory(needed: int, what: str) -> None:
    """Raise ValueError where `needed` bytes, for `what`, are more than the machine has."""
    there = machine_memory()
    if there is not None and needed > there:
        raise ValueError(
            f"has {what}, which take {needed / 2**30:.1f} GiB of memory; expected at most the "
            f"{there / 2**30:.1f} GiB that there are"
        )
