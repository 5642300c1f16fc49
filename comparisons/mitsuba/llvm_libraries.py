"""Finds a libLLVM for Mitsuba's llvm variants: named by the user, in a wheel, or in the system.

The extra `compare` installs the wheel `karellen-llvm-core` where there is one (Linux, x86_64).  Its
libLLVM needs the libc++ of the same wheel, which the system's loader finds only through links that
the wheel creates when Python first starts, if it may write there.  So these libraries are loaded
first, by their own paths.
"""

import ctypes.util
import importlib.metadata
import os
import re
from collections.abc import Iterable
from pathlib import Path

LIBRARY = "DRJIT_LIBLLVM_PATH"
"""The environment variable with the library that Dr.Jit loads."""

ADVICE = (
    "pip install 'reference-rt[compare]' brings it on Linux x86_64; elsewhere install LLVM with "
    f"the system's package manager (Debian: libllvm19), or set {LIBRARY}"
)

_WHEEL = "karellen-llvm-core"

_NEEDED = ("libunwind", "libc++abi", "libc++")
"""Libraries that the wheel's libLLVM needs, in the order of their own dependencies."""

_PLACES = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/llvm*/lib*/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
)


def candidates() -> list[str]:
    """Paths of libraries in the order to try them: only the one that the user names, if any; else
    the wheel's, which is the same on every machine, then the system's, the newest first."""
    own = os.environ.get(LIBRARY)
    if own:
        return [own]
    files = [*_newest_first(_files_of_wheel()), *_newest_first(_files_of_system())]
    if not files:
        elsewhere = ctypes.util.find_library("LLVM")
        files = [elsewhere] if elsewhere else []
    return list(dict.fromkeys(files))


def needed_by(path: str) -> list[str]:
    """Libraries to load before the libLLVM at `path`, in this order; only the wheel's needs any."""
    files = list(_files_of_wheel())
    if Path(path).resolve() not in files:
        return []
    newest = []
    for name in _NEEDED:
        versions = [str(file) for file in files if re.match(rf"{re.escape(name)}\.so\.", file.name)]
        newest += versions[:1]
    return newest


def load_needed(path: str) -> None:
    """Load the libraries that the libLLVM at `path` needs.  Raises OSError."""
    for library in needed_by(path):
        ctypes.CDLL(library)


def _files_of_wheel() -> Iterable[Path]:
    """Libraries that the wheel has installed, each by its real path; none if it is absent."""
    try:
        files = importlib.metadata.files(_WHEEL) or ()
    except importlib.metadata.PackageNotFoundError:
        return ()
    paths = (Path(str(file.locate())).resolve() for file in files if ".so" in file.name)
    return dict.fromkeys(path for path in paths if path.is_file())


def _files_of_system() -> Iterable[Path]:
    places = list(_PLACES)
    if "CONDA_PREFIX" in os.environ:
        places.append(os.environ["CONDA_PREFIX"].lstrip("/") + "/lib/libLLVM*")
    root = Path("/")
    # A file has several links; the real name has the full version.
    return {p.resolve() for place in places for p in root.glob(place.lstrip("/")) if p.is_file()}


def _newest_first(files: Iterable[Path]) -> list[str]:
    return sorted((str(f) for f in files if version_of(str(f))), key=version_of, reverse=True)


def version_of(path: str) -> tuple[int, ...]:
    """(19, 1) for .../libLLVM.so.19.1 or .../libLLVM-19.so.1; on macOS from the folder's name, (0,)
    if that has none; () for a file that is not the whole LLVM."""
    if not re.match(r"libLLVM[-.]\w", Path(path).name):
        return ()
    for part in reversed(Path(path).parts):
        match = re.match(r"(?:libLLVM(?:-|\.so\.)|llvm[-@]?)(\d+(?:\.\d+)*)", part)
        if match:
            return tuple(int(n) for n in match.group(1).split("."))
    return (0,)
