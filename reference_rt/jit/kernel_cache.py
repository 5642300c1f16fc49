"""The cache of compiled kernels on disk: one checksummed file per kernel and set of argument types.

Numba's own cache does not verify what it reads.  It writes an index of a function's files before
the files themselves, without fsync: after a crash, a full disk or a damaged sector every later
process fails while unpickling, or runs damaged machine code.  This cache has no index: a file's
name is a digest of its key.  A file is written atomically (`files.replacing`) and begins with a
checksum; if that is wrong, the file is deleted and the kernel compiled again.  Reading and writing
need no lock: if two processes write the same file, the second replaces the first.

Compiling takes seconds, so a process that needs a kernel which another one compiles waits for it
(`KernelCache.alone`).

The checksum protects against accidents, not against attackers: the payload is a pickle, which can
run any code, so only the owner may read or write the folder (mode 0700).
"""

import functools
import hashlib
import os
import pickle
import shutil
import stat
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

try:
    import fcntl
except ImportError:  # Windows: two processes may compile the same kernel
    fcntl = None  # type: ignore[assignment]

import llvmlite
import numba
import platformdirs
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from reference_rt.util.errors import CacheWarning, ImageError
from reference_rt.util.files import replacing

_UNUSED_FOR = 14 * 24 * 3600.0
"""Seconds without use after which another version's kernels are deleted (compiling them again takes
ten)."""

_UNFINISHED_FOR = 3600.0
"""Seconds after which a temporary file is deleted: writing takes less than one, so its writer was
killed."""

_PATIENCE = 60.0
"""Seconds to wait for a process that compiles the same kernel; one takes less than ten."""

_PACKAGE = Path(__file__).parents[1]

_MAGIC = b"reference_rt kernel\n"
_CHECKSUM_BYTES = 32


def _sources_digest() -> str:
    """Digest of all sources that kernels may be in, of versions and the bounds-check flag.  Numba's
    own key lacks that flag and edits in a callee's file (numba#1833)."""
    digest = hashlib.sha256()
    for version in (sys.version, numba.__version__, llvmlite.__version__):
        digest.update(version.encode())
    digest.update(str(numba.config.BOUNDSCHECK).encode())
    # Kernels of every folder call each other, but for the command line, which has none.
    for source in sorted(_PACKAGE.rglob("*.py")):
        if source.parent.name == "cli":
            continue
        digest.update(source.relative_to(_PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:20]


def cache_root() -> Path:
    """The folder of all that is cached; prepare_folder makes one in it for kernels."""
    root = os.environ.get("REFERENCE_RT_CACHE") or platformdirs.user_cache_dir("reference_rt")
    return Path(root)


def prepare_folder() -> str | None:
    """Create the folder for kernels of exactly these sources and versions; None if it cannot be
    written, or others could write machine code into it.  Deletes folders that are no longer
    used."""
    folder = cache_root() / "kernels" / _sources_digest()
    try:
        _make(folder)
        os.utime(folder)
        if not os.access(folder, os.W_OK):
            return None
        if (stranger := _open_to_others(folder)) is not None:
            warnings.warn_explicit(  # on one line, without one of source code
                f"kernels are not cached: {stranger} belongs to another user or others may write"
                " to it, and what it holds is run; expected a folder of your own, of mode 700"
                " (REFERENCE_RT_CACHE)",
                CacheWarning,
                "reference_rt",
                0,
            )
            return None
    except OSError:
        return None
    _delete_old(folder.parent, "*", _UNUSED_FOR)
    _delete_old(folder, ".*", _UNFINISHED_FOR)
    return str(folder)


def _open_to_others(folder: Path) -> Path | None:
    """Of the folder of kernels and the two that hold it, the first that others may change."""
    if not hasattr(os, "getuid"):  # Windows: a user's folders are the user's
        return None
    for path in (folder, folder.parent, folder.parent.parent):
        found = path.stat()
        if found.st_uid != os.getuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return path
    return None


def _make(folder: Path) -> None:
    with suppress(FileExistsError):
        for path in (folder.parent.parent, folder.parent, folder):
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
        return
    folder.unlink()  # a file, or a link to nothing
    folder.mkdir(mode=0o700)


def _delete_old(folder: Path, pattern: str, seconds: float) -> None:
    """Errors are ignored: another process may be deleting the same files."""
    with suppress(OSError):
        for path in folder.glob(pattern):
            with suppress(OSError):
                if time.time() - path.lstat().st_mtime > seconds:
                    _delete(path)


def _delete(path: Path) -> None:
    """Delete a file, or a folder in its place."""
    try:
        path.unlink(missing_ok=True)
    except OSError:  # a folder
        shutil.rmtree(path, ignore_errors=True)


# Which kernels are being compiled: a byte of one file each, which is locked but never written.
# Such locks belong to a process: a forked child has none, and they end with it.


@functools.cache
def _lock_file(process: int) -> int | None:
    """The descriptor of the file; None where there are no locks."""
    if fcntl is None:
        return None
    with suppress(OSError):
        return os.open(cache_root() / "compiling", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    return None


def _lock(byte: int) -> bool:
    """Lock a byte unless another process has locked it; True where there are no locks."""
    if (file := _lock_file(os.getpid())) is None:
        return True
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
    except BlockingIOError:
        return False
    except OSError:  # such as a file system without locks
        return True
    return True


def _unlock(byte: int) -> None:
    if (file := _lock_file(os.getpid())) is not None:
        with suppress(OSError):
            fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)


def _place(file: Path) -> str:
    """A source file's path, for a file of this package within the package: an installed copy and
    the sources that it was installed from share their kernels, as does a copy elsewhere."""
    if file.is_relative_to(_PACKAGE):
        return file.relative_to(_PACKAGE).as_posix()
    return str(file)


class KernelCache:
    """The cache of one function.  Assigned to the attribute `_cache` of Numba's dispatcher, which
    calls `load_overload` before it compiles and `save_overload` afterwards.

    Raises OSError for a function without a source file, such as one typed into a console: a change
    of it could not be detected.
    """

    def __init__(self, function: Callable[..., Any], folder: str, name: str = "") -> None:
        """name: of what is made of the function, if it is not the function itself."""
        self._function, self._folder = function, Path(folder)
        code = function.__code__
        self._name = f"{Path(code.co_filename).stem}.{code.co_name.strip('<>')}"
        # The folder's name covers the sources of this package only; functions may be outside.
        file = Path(code.co_filename)
        source = hashlib.blake2b(file.read_bytes()).digest()
        self._identity = _place(file), function.__qualname__, code.co_firstlineno, source, name
        self._head = _MAGIC + self._folder.name.encode()

    @property
    def cache_path(self) -> str:
        """The folder, for Numba's statistics."""
        return str(self._folder)

    def has(self, signature: Any, codegen: Any) -> bool:
        """Whether there is a file for arguments of these types, damaged or not."""
        return self._path(self._key(signature, codegen)).is_file()

    @contextmanager
    def alone(self, signature: Any, codegen: Any) -> Iterator[None]:
        """While this process compiles the kernel for arguments of these types.  Waits first for
        another process that compiles it, but not for ever: it may have been stopped."""
        byte = self._byte(signature, codegen)
        end = time.monotonic() + _PATIENCE
        while not (locked := _lock(byte)) and time.monotonic() < end:
            time.sleep(0.01)
        try:
            yield
        finally:
            if locked:
                _unlock(byte)

    def is_compiling(self, signature: Any, codegen: Any) -> bool:
        """Whether another process compiles the kernel for arguments of these types just now."""
        byte = self._byte(signature, codegen)
        if free := _lock(byte):
            _unlock(byte)
        return not free

    def _byte(self, signature: Any, codegen: Any) -> int:
        path = f"{self._folder.name}/{self._path(self._key(signature, codegen)).name}"
        return int.from_bytes(hashlib.blake2b(path.encode(), digest_size=7).digest())

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The `CompileResult` for arguments of these types; None if there is none, or if its file
        was damaged, and is deleted now."""
        # Numba's own cache calls `target_context.refresh()`, which takes 0.2 s: it also fills the
        # registries of the compiler, which does that itself before it compiles.
        rtsys.initialize(target_context)
        key = self._key(signature, target_context.codegen())
        path = self._path(key)
        try:
            kept, parts = pickle.loads(self._opened(path.read_bytes()))
            # Two NamedTuple classes may have the same name, and so the same file.
            return CompileResult._rebuild(target_context, *parts) if kept == key else None
        except FileNotFoundError:
            return None
        except Exception:  # damaged data makes unpickling raise anything
            _delete(path)
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Write a compiled kernel.  If that fails, on a full disk for example, the next process
        compiles it again."""
        if compiled.lifted or compiled.library.has_dynamic_globals:
            return  # it contains addresses that are valid in this process only
        key = self._key(signature, compiled.library.codegen)
        with suppress(OSError, ImageError):
            _make(self._folder)  # the cache may have been deleted
            with replacing(self._path(key)) as temporary:
                temporary.write_bytes(self._sealed(dumps((key, compiled._reduce()))))

    def flush(self) -> None:
        """Delete this function's kernels."""
        for path in self._folder.glob(f"{self._name}-*"):
            _delete(path)

    def _key(self, signature: Any, codegen: Any) -> tuple[Any, ...]:
        """All that the machine code depends on and the folder's name lacks: argument types,
        processor, the function and its closure."""
        cells = tuple(cell.cell_contents for cell in self._function.__closure__ or ())
        function = (*self._identity, self._function.__code__.co_code, dumps(cells))
        digest = hashlib.blake2b(repr(function).encode()).hexdigest()
        if not isinstance(signature, tuple):
            signature = signature.return_type, *signature.args
        return tuple(signature), codegen.magic_tuple(), digest

    def _path(self, key: tuple[Any, ...]) -> Path:
        digest = hashlib.blake2b(repr(key).encode(), digest_size=16).hexdigest()
        return self._folder / f"{self._name}-{digest}"

    def _sealed(self, payload: bytes) -> bytes:
        """A file's content: magic, version, a checksum of everything, and the payload."""
        checksum = hashlib.blake2b(self._head + payload, digest_size=_CHECKSUM_BYTES).digest()
        return self._head + checksum + payload

    def _opened(self, data: bytes) -> bytes:
        """The payload.  Raises ValueError unless every bit is as `_sealed` wrote it."""
        payload = data[len(self._head) + _CHECKSUM_BYTES :]
        if self._sealed(payload) != data:
            raise ValueError("damaged, or of another version")
        return payload
