"""Files that a command looks at again and again."""

import time
from collections.abc import Sequence
from pathlib import Path

POLLED = 0.3
"""Seconds between two looks at files."""

Stamp = tuple[int, int] | None
"""When a file was written, in ns, and its size; None where there is none, as for a moment where an
editor replaces it."""


def stamp(path: Path) -> Stamp:
    """Of a file as it is now."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def stamps(paths: Sequence[Path]) -> list[Stamp]:
    """Of several."""
    return [stamp(path) for path in paths]


def wait_for_change(paths: Sequence[Path], before: Sequence[Stamp]) -> None:
    """Return when a file has another stamp than `before`, all of them are there, and none has
    changed from one look to the next: it is not being written."""
    last = list(before)
    while (now := stamps(paths)) == before or now != last or None in now:
        last = now
        time.sleep(POLLED)
