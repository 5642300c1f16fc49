"""The machine's memory: data that cannot fit are refused before they are read."""

import ctypes
import functools
import os
from contextlib import suppress
from pathlib import Path


def machine_memory() -> int | None:
    """The memory limit of this process in bytes: the smallest of the machine's memory, its
    container's and its shell's limit (`ulimit -v`); None where the system reports none."""
    found = []
    with suppress(AttributeError, ValueError, OSError):  # Windows has no sysconf
        found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with suppress(OSError, ValueError):  # Linux control groups; "max" (no limit) is no number
        found.append(int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    with suppress(ImportError, OSError, ValueError):
        import resource

        soft = resource.getrlimit(resource.RLIMIT_AS)[0]
        if soft != resource.RLIM_INFINITY:
            found.append(soft)
    return min((n for n in found if n > 0), default=None)


def check_memory(needed: int, what: str) -> None:
    """Raises ValueError if `needed` bytes, for `what`, exceed the memory limit."""
    there = machine_memory()
    if there is not None and needed > there:
        raise ValueError(
            f"has {what}, which take {needed / 2**30:.1f} GiB of memory; expected at most the "
            f"{there / 2**30:.1f} GiB that there are"
        )


RATIO = 200
"""The most that content may unpack to, as a multiple of its own size: arrays of numbers shrink to a
half, texts of numbers to a tenth, and nothing but repetition to less than a hundredth (at most
1/1032, by the format of zlib)."""

SMALL = 1 << 24
"""Bytes that are unpacked whatever the ratio."""


def check_unpacked(packed: int, unpacked: int, what: str, each: int = 8) -> None:
    """Raises ValueError if content must not be unpacked: it is made to fill memory, or too large.

    packed, unpacked: bytes;  what: names the content;  each: bytes of memory per unpacked byte.
    """
    if unpacked > max(SMALL, RATIO * packed):
        raise ValueError(
            f"{what} unpacks from {packed} to {unpacked} bytes; expected at most {RATIO} times as "
            "many"
        )
    there = machine_memory()
    if there is not None and each * unpacked > there:
        raise ValueError(
            f"{what} unpacks to {unpacked} bytes, which take {each * unpacked / 2**30:.1f} GiB of "
            f"memory; expected at most the {there / 2**30:.1f} GiB that there are"
        )


def resident_memory() -> int | None:
    """The bytes of memory that this process has now; None where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError, AttributeError):
        return None


def give_back() -> None:
    """Gives freed memory back to the system.  glibc keeps up to 32 MB of every array that it has
    freed, in case it is needed again; other systems' allocators are left alone."""
    with suppress(AttributeError, OSError, TypeError):
        _program().malloc_trim(0)


@functools.cache
def _program() -> ctypes.CDLL:
    """What this process has loaded."""
    return ctypes.CDLL(None)
