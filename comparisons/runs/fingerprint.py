"""The code fingerprint: a change of any line of the sources invalidates stored results."""

import functools
import hashlib
import importlib.metadata
from pathlib import Path

import reference_rt

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
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = ""
    return found


@functools.cache
def everything_fingerprint() -> str:
    """The hash of all sources, and of the versions of packages."""
    return hashlib.sha256(f"{code_fingerprint()} {package_versions()}".encode()).hexdigest()
