"""`reference-rt doctor`: what is installed, what works, and what to do about the rest."""

import importlib.metadata
import os
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numba

from reference_rt.jit.kernel import CACHE_FOLDER
from reference_rt.jit.kernel_cache import cache_root
from reference_rt.util.extras import extra_of

CHECKS = "reference_rt.checks"
"""The entry points of functions without arguments that return the checks of other packages."""


class Check(NamedTuple):
    """what: the part;  found: its state;  advice: what to do about it, "" if it is in order;
    works: whether one can do without following the advice."""

    what: str
    found: str
    advice: str = ""
    works: bool = True


def checks() -> Iterable[Check]:
    """All checks, those of other packages last.  A check of another package that fails is a check
    that does not work."""
    yield Check("reference_rt", importlib.metadata.version("reference-rt"))
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    machine = f"{platform.system()} {platform.machine()}, {threads} cores"
    yield Check("machine", f"{machine}, Python {platform.python_version()}")
    yield _compiler()
    yield from _caches()
    for entry in importlib.metadata.entry_points(group=CHECKS):
        try:
            yield from entry.load()()
        except ModuleNotFoundError as error:
            extra = extra_of(error.name)
            advice = f"pip install 'reference-rt[{extra}]'" if extra else "reinstall that package"
            yield Check(entry.name, f"{error.name} is not installed", advice, False)
        except Exception as error:  # another package's fault must not hide the other checks
            message = " ".join(str(error).split())
            advice = "reinstall that package"
            yield Check(entry.name, f"{type(error).__name__}: {message}", advice, False)


def _compiler() -> Check:
    version = f"Numba {numba.__version__}"
    if numba.config.DISABLE_JIT:
        advice = "unset NUMBA_DISABLE_JIT: plain Python is some hundred times slower"
        return Check("compiler", f"{version}, switched off", advice)
    return Check("compiler", version)


def _caches() -> Iterable[Check]:
    root = cache_root()
    if CACHE_FOLDER is None:
        advice = "set REFERENCE_RT_CACHE to a folder that can be written: kernels are not kept"
        yield Check("kernels", f"{root} cannot be written", advice)
        return
    kernels = [path for path in Path(CACHE_FOLDER).iterdir() if path.is_file()]
    advice = "" if kernels else "reference-rt warm-up compiles all kernels ahead of time"
    yield Check("kernels", f"{len(kernels)} compiled for these versions", advice)
    for folder in sorted(path for path in root.iterdir() if path.is_dir()):
        yield Check(f"cache of {folder.name}", f"{_megabytes(folder):,.0f} MB in {folder}")


def _megabytes(folder: Path) -> float:
    total = 0
    for place, _, files in os.walk(folder):
        for name in files:
            try:
                total += (Path(place) / name).stat().st_size
            except OSError:  # deleted meanwhile
                continue
    return total / 1e6


def page(found: Iterable[Check]) -> Iterable[str]:
    """Lines of text: one for each check, and one for its advice."""
    for check in found:
        mark = "ok" if not check.advice else "note" if check.works else "FAIL"
        yield f"{mark:4}  {check.what}: {check.found}"
        if check.advice:
            yield f"      -> {check.advice}"
