"""The folder of all renders that are stored without being asked for: old ones are deleted."""

import shutil
import time
from contextlib import suppress
from pathlib import Path

_UNUSED_FOR = 14 * 24 * 3600.0
"""Seconds without being written after which a render is deleted."""


def delete_old(folder: Path) -> None:
    """Delete the renders in a folder that nobody has gone on with for long.  Errors are ignored:
    another process may be deleting the same ones."""
    with suppress(OSError):
        for render in folder.iterdir():
            with suppress(OSError):
                if time.time() - render.stat().st_mtime > _UNUSED_FOR:
                    shutil.rmtree(render, ignore_errors=True)
