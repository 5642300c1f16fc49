"""Provenance: versions, machine and date, which a reader needs to repeat a run."""

import datetime
import functools
import hashlib
import importlib.metadata
import os
import platform
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt
from comparisons.mitsuba.backend import backend
from reference_rt.util.errors import SceneWarning

# ---- the code fingerprint: a change of any line of the sources invalidates stored results --------


_COMPARISONS = Path(__file__).parents[1]


@functools.cache
def code_fingerprint(*excluded: str) -> str:
    """SHA-256 of the sources of both packages, without the `excluded` modules and packages of
    `comparisons`."""
    digest = hashlib.sha256()
    for root in (Path(reference_rt.__path__[0]), _COMPARISONS):
        for source in sorted(root.rglob("*.py")):
            name = source.relative_to(root)
            if root == _COMPARISONS and name.parts[0] in excluded:
                continue
            digest.update(name.as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(source.read_bytes()).digest())
    return digest.hexdigest()


_PACKAGES = ("reference-rt", "numpy", "numba", "mitsuba", "drjit", "python-flint")
"""What computes verdicts."""


def package_versions() -> dict[str, str]:
    """The versions of the packages that verdicts depend on; "" for one that is not installed."""
    versions = {}
    for name in _PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = ""
    return versions


@functools.cache
def everything_fingerprint() -> str:
    """The hash of all sources, and of the versions of packages."""
    return hashlib.sha256(f"{code_fingerprint()} {package_versions()}".encode()).hexdigest()


def provenance(**more: Any) -> dict[str, Any]:
    """Versions, machine and date, and `more`.  Warns of another version of Mitsuba than the one
    that is expected.  Raises ReferenceUnavailableError."""
    chosen = backend()
    if chosen.doubt:
        warnings.warn(chosen.doubt, SceneWarning, stacklevel=2)
    return {
        **ours(),
        "mitsuba": f"{chosen.version}, {chosen.variant}: {chosen.reason}",
        **more,
    }


def ours() -> dict[str, Any]:
    """The same without Mitsuba, for runs that do not use it."""
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "reference_rt": importlib.metadata.version("reference-rt"),
        "numpy": np.__version__,
        "numba": importlib.metadata.version("numba"),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {_processor()}",
        "cores": os.cpu_count(),
    }


def _processor() -> str:
    """The processor's name, if the system reports it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else "unknown processor"
