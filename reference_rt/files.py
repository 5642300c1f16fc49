"""Writing files whole or not at all."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from reference_rt.errors import ImageError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside `path` to write to; it becomes `path` when the block ends well.

    A reader sees the old file or the whole new one; an error, Ctrl-C or a full disk leaves the old
    one and no rubbish.  Makes parent folders.  Raises ImageError where the file cannot be written.
    """
    # The same folder, since a rename is atomic within one file system only; the same suffix, since
    # writers choose the format by it.
    temporary = path.with_name(f".{secrets.token_hex(4)}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise ImageError(
            f"{path}: cannot be written: {error.strerror or error}; expected a writable place"
        ) from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def check_writable(*paths: Path) -> None:
    """Raise ImageError where one of these files could not be written.

    Every command calls this for all files that it will write, before its work begins: nobody should
    wait for results that cannot be stored.  Leaves nothing behind, no folder either.
    """
    for path in paths:
        _check_writable(path)


def _check_writable(path: Path) -> None:
    probe = path.with_name(f".{secrets.token_hex(4)}-{path.name}")
    made: list[Path] = []
    try:
        if path.is_dir():
            raise ImageError(f"{path}: is a folder; expected the name of a file")
        if (file := next((p for p in path.parents if p.is_file()), None)) is not None:
            raise ImageError(f"{path}: cannot be written: {file} is a file; expected a folder")
        made = [parent for parent in path.parents if not parent.exists()]
        path.parent.mkdir(parents=True, exist_ok=True)
        probe.touch()
    except OSError as error:
        raise ImageError(
            f"{path}: cannot be written: {error.strerror}; expected a writable place"
        ) from None
    finally:
        with suppress(OSError):
            probe.unlink(missing_ok=True)
        for parent in made:  # the deepest first; one that somebody else fills stays
            with suppress(OSError):
                parent.rmdir()
