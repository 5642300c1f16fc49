"""Reading regular files within limits, and writing files atomically: whole or not at all."""

import codecs
import errno
import glob
import hashlib
import os
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from reference_rt.util.errors import ImageError

MOST_BYTES = 1 << 32
"""The most bytes of a file that is read as a whole: no mesh that fits into memory has more."""

MOST_TEXT = 1 << 28
"""The most bytes of a scene, a suite or a stored result: two million spheres in YAML.  Once read,
such a scene takes about eight times as much memory: 2 GiB."""

UNFINISHED_FOR = 3600.0
"""Seconds after which a temporary file is deleted: writing takes seconds, so its writer was
killed."""

_TOKEN = "[0-9a-f]" * 8

_KINDS = (
    (stat.S_ISREG, "is a file"),
    (stat.S_ISDIR, "is a folder"),
    (stat.S_ISFIFO, "is a pipe"),
    (stat.S_ISSOCK, "is a socket"),
    (stat.S_ISCHR, "is a device"),
    (stat.S_ISBLK, "is a device"),
)


def _kind(mode: int) -> str:
    return next((kind for is_one, kind in _KINDS if is_one(mode)), "is something else")


def kind_of(path: Path) -> str:
    """What is there, links followed, in words ("is a pipe"); "" if nothing is."""
    try:
        return _kind(path.stat().st_mode)
    except OSError:
        return ""


_LFS = b"version https://git-lfs.github.com/spec/"
"""What a repository cloned without Git LFS has in place of a large file begins with this."""


def open_input(path: Path) -> BinaryIO:
    """Opens a regular file for reading.  Raises OSError, whose `strerror` says what is wrong.

    Reading anything else could block or never end: a pipe without a writer, /dev/zero.
    """
    flags = os.O_RDONLY
    for name in ("O_BINARY", "O_CLOEXEC", "O_NOCTTY", "O_NONBLOCK"):  # not every system has all
        flags |= getattr(os, name, 0)
    try:
        number = os.open(path, flags)  # does not wait for a pipe's writer
    except ValueError as error:  # a name with a null byte
        raise OSError(errno.EINVAL, str(error), str(path)) from None
    try:
        mode = os.fstat(number).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, f"{_kind(mode)}, not a regular file", str(path))
        file = os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise
    try:
        if file.peek(len(_LFS)).startswith(_LFS):
            reason = "is a Git LFS pointer; run `git lfs pull` to get the file itself"
            raise OSError(errno.EINVAL, reason, str(path))
    except BaseException:
        file.close()
        raise
    return file


def read_input(path: Path, most: int = MOST_BYTES) -> bytes:
    """All bytes of a regular file.  Raises OSError, also for more than `most` bytes."""
    with open_input(path) as file:
        size = os.fstat(file.fileno()).st_size
        content = file.read(size + 1) if size <= most else b""
        # A file may grow while it is read, and files below /proc report size 0.
        while size <= most and (more := file.read(1 << 20)):
            content += more
            size = len(content)
    if size > most:
        raise OSError(errno.EFBIG, f"has more than {most} bytes", str(path))
    return content


def read_text(path: Path) -> str:
    """The text of a regular file.  Raises OSError; UnicodeDecodeError where it is not UTF-8."""
    return read_input(path, MOST_TEXT).decode("utf-8")


_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),  # before that of UTF-16, which begins it
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)
"""The marks of byte order with which texts begin."""


def wide_encoding(content: bytes) -> str | None:
    """The encoding of a text whose characters take two or four bytes, by its mark of byte order, or
    by the zeros beside its ASCII characters; None for anything else."""
    for mark, name in _MARKS:
        if content.startswith(mark):
            return name
    start = content[:64]
    for step, name in ((4, "UTF-32"), (2, "UTF-16")):
        columns = [start[k::step] for k in range(step)]
        letters = [column for column in columns if column and all(9 <= c < 127 for c in column)]
        zeros = [column for column in columns if column and not any(column)]
        if len(start) >= 8 and len(letters) == 1 and len(zeros) == step - 1:
            return name
    return None


def not_utf8(error: UnicodeDecodeError) -> str:
    """What is said of a text that `read_text` cannot decode."""
    return f"is {wide_encoding(error.object) or 'not text'}; expected UTF-8"


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields a temporary file name beside `path`; the file is renamed to `path` if the block ends
    without an exception.  A symbolic link stays: the file that it names is replaced.

    A reader sees the old file or the whole new one.  After an error, Ctrl-C or with a full disk the
    old file is unchanged and the temporary one is removed.  Creates parent folders.  Raises
    ImageError where the file cannot be written.
    """
    with _temporary_beside(path) as temporary:
        target = _target(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(target)


@contextmanager
def _temporary_beside(path: Path) -> Iterator[Path]:
    """Yields a temporary file name beside `path`, and removes the file afterwards; turns OSErrors
    into an ImageError."""
    # The same folder, since a rename is atomic within one file system only; the same suffix, since
    # writers choose the format by it.
    temporary = None
    try:
        target = _target(path)
        temporary = target.with_name(f".{secrets.token_hex(4)}-{_short(target.name)}")
        yield temporary
    except OSError as error:
        raise ImageError(
            f"{path}: cannot be written: {error.strerror or error}; expected a writable place"
        ) from None
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def _target(path: Path) -> Path:
    """The file that a symbolic link names in the end; of anything else the path itself.  Raises
    ImageError for what must not be replaced by a file, OSError where links go round."""
    with suppress(FileNotFoundError, NotADirectoryError):
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise ImageError(f"{path}: {_kind(mode)}; expected the name of a file")
        if not os.access(path, os.W_OK):
            raise ImageError(f"{path}: may not be written; expected a file that is not read-only")
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def discard(path: Path) -> None:
    """Delete a file that an earlier run wrote, if there is one; of a symbolic link the file that it
    names, so that `replacing` writes there again.  Raises OSError, ImageError."""
    _target(path).unlink(missing_ok=True)


def _short(name: str) -> str:
    """A file name, or a shorter one with its suffix, which leaves room for what is put before it:
    file systems allow 255 bytes."""
    if len(os.fsencode(name)) <= 240:
        return name
    return hashlib.sha256(os.fsencode(name)).hexdigest()[:32] + Path(name).suffix[-16:]


def delete_unfinished(folder: Path, name: str = "*") -> None:
    """Delete the temporary files of `replacing` that killed processes left in a folder, for files
    with this name or pattern.  Errors are ignored: another process may be deleting the same files.
    """
    with suppress(OSError):
        for path in folder.glob(f".{_TOKEN}-{name}"):
            with suppress(OSError):
                if time.time() - path.lstat().st_mtime > UNFINISHED_FOR:
                    path.unlink()


_TEMPORARY, _OWNER = ".reference_rt-", ".owner"
"""How the names of temporary folders begin; the file in each that its process holds locked."""


@contextmanager
def temporary_folder(place: Path | None = None) -> Iterator[Path]:
    """Yields a new temporary folder, by default where the system has them, and removes it
    afterwards.

    Where a process is killed its folder stays.  So each call first removes this user's folders of
    this kind that no process holds locked.
    """
    place = place or Path(tempfile.gettempdir())
    _remove_ownerless(place)
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_TEMPORARY, dir=place))
        with _owned(folder, os.O_CREAT) as is_ours:
            if not is_ours:  # another process removed it before it was locked
                continue
            try:
                (files := folder / "files").mkdir(0o700)  # empty, without the locked file
                yield files
            finally:
                _remove(folder)
            return


def _remove_ownerless(place: Path) -> None:
    with suppress(OSError):
        for folder in place.glob(f"{_TEMPORARY}*"):
            with _owned(folder, 0) as is_ours:
                if is_ours:
                    _remove(folder)


def _remove(folder: Path) -> None:
    """The locked file goes last, and only if nothing else is left: another process may still write
    here, and a folder without that file would stay for ever."""
    shutil.rmtree(folder / "files", ignore_errors=True)
    with suppress(OSError):
        if not (folder / "files").exists():
            (folder / _OWNER).unlink()
            folder.rmdir()


@contextmanager
def _owned(folder: Path, flags: int) -> Iterator[bool]:
    """Holds the lock of a temporary folder; yields False if another process has it, or if this is
    none of this user.  The system releases the locks of a process that ends in any way."""
    with ExitStack() as stack:
        try:
            import fcntl

            flags |= os.O_RDWR | os.O_NOFOLLOW
            file = stack.enter_context(os.fdopen(os.open(folder / _OWNER, flags, 0o600), "r+b"))
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            is_ours = os.fstat(file.fileno()).st_uid == os.geteuid() and folder.exists()
        except ImportError:  # Windows: folders of killed processes stay
            is_ours = bool(flags & os.O_CREAT)
        except OSError:
            is_ours = False
        yield is_ours


def check_writable(*paths: Path) -> None:
    """Raises ImageError if one of these files could not be written.

    Every command calls this for all its output files before it starts to work, so that no long run
    ends with results that cannot be stored.  Leaves no files or folders behind, and deletes what
    killed processes left.
    """
    for path in paths:
        _check_writable(path)
        target = _target(path)
        delete_unfinished(target.parent, glob.escape(_short(target.name)))


def _check_parents(path: Path) -> None:
    """Raises ImageError where something else stands in the place of a folder."""
    for parent in path.parents:
        there = kind_of(parent) or ("is a link to nothing" if parent.is_symlink() else "")
        if there not in ("", "is a folder"):
            raise ImageError(f"{path}: cannot be written: {parent} {there}; expected a folder")


def _check_writable(path: Path) -> None:
    made: list[Path] = []
    try:
        with _temporary_beside(path) as probe:
            _check_parents(path)
            made = [parent for parent in probe.parents if not parent.exists()]
            probe.parent.mkdir(parents=True, exist_ok=True)
            probe.touch()
    finally:
        for parent in made:  # the deepest first; one that somebody else fills stays
            with suppress(OSError):
                parent.rmdir()
