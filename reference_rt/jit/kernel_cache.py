"""Compiled kernels on disk: one file for each kernel and set of argument types, checked when read.

Numba's own cache trusts what it reads.  It writes an index of a function's files before the files
themselves, without fsync: after a crash, a full disk or a damaged sector every later process fails
while it unpickles, or runs damaged machine code.  Here there is no index: the name of a file is a
digest of what it is for.  A file appears whole or not at all (`files.replacing`) and begins with a
checksum; where that is wrong, the file is deleted and the kernel compiled again.  No lock is
needed: if two processes write the same file, the second one's replaces the first one's.

The checksum is against accidents, not against people: the payload is a pickle, which can run any
code, so that only the owner may read or write the folder (mode 0700).
"""

import hashlib
import os
import pickle
import shutil
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import llvmlite
import numba
import platformdirs
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from reference_rt.util.errors import ImageError
from reference_rt.util.files import replacing

_UNUSED_FOR = 14 * 24 * 3600.0
"""Seconds after which another version's kernels are deleted: compiling them again takes ten."""

_UNFINISHED_FOR = 3600.0
"""Seconds after which a temporary file is deleted: its writer, which needs less than one, was
killed."""

_MAGIC = b"reference_rt kernel\n"
_CHECKSUM_BYTES = 32


def _sources_digest(compiler: str) -> str:
    """Numba's own key misses an edit in a callee's file and the bounds-check flag (numba#1833)."""
    digest = hashlib.sha256()
    for version in (sys.version, numba.__version__, llvmlite.__version__, compiler):
        digest.update(version.encode())
    digest.update(str(numba.config.BOUNDSCHECK).encode())
    package = Path(__file__).parents[1]  # kernels of every folder call each other
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:20]


def prepare_folder(compiler: str) -> str | None:
    """The folder for the kernels of exactly these sources and versions; None where none can be
    written.  Deletes what is no longer used.

    compiler: a name that tells one way to compile the same sources from another.
    """
    root = os.environ.get("REFERENCE_RT_CACHE") or platformdirs.user_cache_dir("reference_rt")
    folder = Path(root) / "kernels" / _sources_digest(compiler)
    try:
        _make(folder)
        os.utime(folder)
        if not os.access(folder, os.W_OK):
            return None
    except OSError:
        return None
    _delete_old(folder.parent, "*", _UNUSED_FOR)
    _delete_old(folder, ".*", _UNFINISHED_FOR)
    return str(folder)


def _make(folder: Path) -> None:
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return
    folder.unlink()  # a file, or a link to nothing
    folder.mkdir(mode=0o700)


def _delete_old(folder: Path, pattern: str, seconds: float) -> None:
    """Another process may delete the same ones at the same time."""
    with suppress(OSError):
        for path in folder.glob(pattern):
            with suppress(OSError):
                if time.time() - path.lstat().st_mtime > seconds:
                    _delete(path)


def _delete(path: Path) -> None:
    """A file, or what stands in its place."""
    try:
        path.unlink(missing_ok=True)
    except OSError:  # a folder
        shutil.rmtree(path, ignore_errors=True)


class KernelCache:
    """The compiled kernels of one function.  Numba's dispatcher calls `load_overload` before it
    compiles and `save_overload` afterwards (its attribute `_cache`).

    Raises OSError for a function without a source file, as one typed into a console: nothing would
    tell when it changes.
    """

    def __init__(self, function: Callable[..., Any], folder: str) -> None:
        self._function, self._folder = function, Path(folder)
        code = function.__code__
        self._name = f"{Path(code.co_filename).stem}.{code.co_name.strip('<>')}"
        # The folder's name says nothing of a function outside this package.
        source = hashlib.blake2b(Path(code.co_filename).read_bytes()).digest()
        self._identity = code.co_filename, function.__qualname__, code.co_firstlineno, source
        self._head = _MAGIC + self._folder.name.encode()

    @property
    def cache_path(self) -> str:
        """The folder, for Numba's statistics."""
        return str(self._folder)

    def has(self, signature: Any, codegen: Any) -> bool:
        """Whether there is a file for arguments of these types, damaged or not."""
        return self._path(self._key(signature, codegen)).is_file()

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The compiled kernel for arguments of these types, a `CompileResult`; None where there is
        none, or its file is damaged and now deleted."""
        target_context.refresh()
        key = self._key(signature, target_context.codegen())
        path = self._path(key)
        try:
            kept, parts = pickle.loads(self._opened(path.read_bytes()))
            # Two classes of tuples may have the same name, and so the same file.
            return CompileResult._rebuild(target_context, *parts) if kept == key else None
        except FileNotFoundError:
            return None
        except Exception:  # unpickling raises whatever the damage leads to
            _delete(path)
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep a compiled kernel.  Where that fails, on a full disk for example, the next process
        compiles it again."""
        if compiled.lifted or compiled.library.has_dynamic_globals:
            return  # it holds addresses of this process
        key = self._key(signature, compiled.library.codegen)
        with suppress(OSError, ImageError):
            _make(self._folder)  # somebody may have emptied the cache
            with replacing(self._path(key)) as temporary:
                temporary.write_bytes(self._sealed(dumps((key, compiled._reduce()))))

    def flush(self) -> None:
        """Forget this function's kernels."""
        for path in self._folder.glob(f"{self._name}-*"):
            _delete(path)

    def _key(self, signature: Any, codegen: Any) -> tuple[Any, ...]:
        """All that the machine code depends on, but for what names the folder: types of arguments,
        processor, the function and what it closes over."""
        cells = tuple(cell.cell_contents for cell in self._function.__closure__ or ())
        function = (*self._identity, self._function.__code__.co_code, dumps(cells))
        digest = hashlib.blake2b(repr(function).encode()).hexdigest()
        return tuple(signature), codegen.magic_tuple(), digest

    def _path(self, key: tuple[Any, ...]) -> Path:
        digest = hashlib.blake2b(repr(key).encode(), digest_size=16).hexdigest()
        return self._folder / f"{self._name}-{digest}"

    def _sealed(self, payload: bytes) -> bytes:
        """What a file holds: what it is, for which version, a checksum of all, and the payload."""
        checksum = hashlib.blake2b(self._head + payload, digest_size=_CHECKSUM_BYTES).digest()
        return self._head + checksum + payload

    def _opened(self, data: bytes) -> bytes:
        """The payload.  Raises ValueError where not every bit is as `_sealed` made it."""
        payload = data[len(self._head) + _CHECKSUM_BYTES :]
        if self._sealed(payload) != data:
            raise ValueError("damaged, or of another version")
        return payload
