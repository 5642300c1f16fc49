"""A cache of compiled kernels for sources with a mistake: those that it cannot concern are kept.

Compiling is most of the work of a mistake in a kernel.  A compiled kernel holds the code of modules
that its own imports, directly or not, and, in `rendering` and `integrators`, of what is registered
there by class.  One that is kept by mistake leaves the right picture, which the self-test tells.
"""

import ast
from collections.abc import Iterable
from pathlib import Path

from comparisons.experiments.selftest.fault import PACKAGE
from reference_rt.jit.kernel import CACHE_FOLDER

REGISTERING = ("integrators/", "rendering/")


def link_kept(files: Iterable[str], root: Path) -> None:
    """Make `root` a REFERENCE_RT_CACHE that has the kernels which changes of these files of the
    package do not concern."""
    if CACHE_FOLDER is None:
        return
    concerned = dependents(files)
    stems = {Path(file).stem for file in concerned}
    folder = root / "kernels" / Path(CACHE_FOLDER).name
    folder.mkdir(mode=0o700, parents=True)
    folder.parent.chmod(0o700)
    for kernel in Path(CACHE_FOLDER).iterdir():
        if not kernel.name.startswith(".") and kernel.name.partition(".")[0] not in stems:
            (folder / kernel.name).symlink_to(kernel)


def dependents(files: Iterable[str]) -> set[str]:
    """These files of the package, those of REGISTERING, and all that import one that is changed."""
    importers: dict[str, set[str]] = {}
    sources = {path.relative_to(PACKAGE).as_posix(): path for path in PACKAGE.rglob("*.py")}
    for file, path in sources.items():
        for imported in _imported(path.read_text(encoding="utf-8")):
            importers.setdefault(imported, set()).add(file)
    found, waiting = {file for file in sources if file.startswith(REGISTERING)}, list(files)
    while waiting:
        file = waiting.pop()
        if file not in found or file.startswith(REGISTERING):
            found.add(file)
            name = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
            waiting += importers.pop(name, ())
    return found


def _imported(text: str) -> set[str]:
    """The modules of the package that a source imports, without the package's name."""
    names = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return {
        name.removeprefix("reference_rt.") for name in names if name.startswith("reference_rt.")
    }
