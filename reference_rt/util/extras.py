"""Packages that only some commands need: which of them are not installed, and how to get them."""

import importlib.metadata
import re
from collections.abc import Iterator

_REQUIREMENT = re.compile(r"""([\w.-]+)[^;]*;\s*extra\s*==\s*["']([\w-]+)["']""")

_DISTRIBUTIONS = {"flint": "python-flint", "ruamel": "ruamel.yaml", "skimage": "scikit-image"}
"""Modules whose packages have other names."""


def requirements() -> Iterator[tuple[str, str]]:
    """Each extra of this package, and a package that it brings.  One with a condition besides, such
    as a platform, is left out: nothing stops without it."""
    try:
        required = importlib.metadata.requires("reference-rt") or ()
    except importlib.metadata.PackageNotFoundError:  # a source tree that is not installed
        return
    for requirement in required:
        if found := _REQUIREMENT.fullmatch(requirement.strip()):
            yield found[2], found[1]


def _is_missing(package: str) -> bool:
    try:
        importlib.metadata.distribution(package)
    except importlib.metadata.PackageNotFoundError:
        return True
    return False


def missing(extra: str) -> list[str]:
    """The packages of an extra that are not installed."""
    return [package for of, package in requirements() if of == extra and _is_missing(package)]


def needs(doing: str, extra: str, module: str | None) -> str:
    """One line: what `doing` needs, and how to install it.  module: that could not be imported; all
    packages of the extra that are not installed are named with it."""
    names = missing(extra) or [str(module).partition(".")[0]]
    listed = ", ".join(names[:-1]) + " and " + names[-1] if names[1:] else names[0]
    return f"{doing} needs {listed}: pip install 'reference-rt[{extra}]'"


def extra_of(module: str | None) -> str | None:
    """The extra that brings a module; None for one that no extra brings."""
    name = str(module).partition(".")[0]
    package = _DISTRIBUTIONS.get(name, name.replace("_", "-")).lower()
    return next((of for of, brought in requirements() if brought.lower() == package), None)
