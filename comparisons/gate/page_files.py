"""Files of a folder, for a page that must not read any others."""

import errno
import os
import stat
from pathlib import Path

_READ = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
_READ |= getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
"""Follows no link, and does not wait for a pipe's writer."""


def read_below(folder: Path, name: str) -> bytes:
    """The bytes of a regular file in `folder`, whose path is resolved, or below it.

    Links are followed as far as they stay below the folder.  They are resolved first, and the path
    without links is then opened part by part, following none: one that appears in between is an
    error.  Raises OSError, PermissionError for what lies outside.
    """
    try:
        path = Path(os.path.realpath(folder / name.lstrip("/"), strict=True))
    except ValueError as error:  # a null byte
        raise OSError(errno.EINVAL, str(error), name) from None
    if not path.is_relative_to(folder):
        raise PermissionError(errno.EPERM, f"it lies outside of {folder}", name)
    with os.fdopen(_opened(folder, path), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is no regular file", name)
        return file.read()


def _opened(folder: Path, path: Path) -> int:
    """The descriptor of a file, opened without following links below `folder`."""
    if os.open not in os.supports_dir_fd:
        return os.open(path, _READ)
    at = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    for part in path.relative_to(folder).parts:
        try:
            inner = os.open(part, _READ, dir_fd=at)
        finally:
            os.close(at)
        at = inner
    return at
