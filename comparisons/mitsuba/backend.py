"""Chooses the Mitsuba variant: llvm_ad_rgb if an LLVM works on this machine, else scalar_rgb; where
the fastest is asked for, cuda_ad_rgb before these if a GPU is present.

An unsuitable libLLVM aborts the process instead of raising an exception, so each library is first
tried in a child process.
"""

import contextlib
import ctypes.util
import functools
import importlib
import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import platformdirs

from comparisons.mitsuba import llvm_libraries
from comparisons.mitsuba.llvm_libraries import LIBRARY
from comparisons.mitsuba.uses import lacking
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.files import read_text
from reference_rt.util.processes import tied

FORCE = "REFERENCE_RT_MITSUBA_VARIANT"

SCALAR, LLVM, CUDA = "scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb"

VARIANTS = (SCALAR, LLVM, CUDA)
"""Those that compute colours as we do."""

FASTEST = "fastest"
"""In place of a variant's name: CUDA if a GPU is present and it works, else what is usual."""

_PROOF_SECONDS = 120.0
"""Time limit of a trial, which takes 1 to 3 s on an idle machine."""

_MOST_PROOFS = 4
"""Most libraries that are tried: each takes seconds."""

_PROOF = """
import ctypes
import sys
for library in sys.argv[2:]:
    ctypes.CDLL(library)
import numpy as np
import mitsuba as mi
mi.set_variant(sys.argv[1])
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "path", "max_depth": 3},
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 8, "height": 8}},
    "ball": {"type": "sphere", "center": [0, 0, 3], "bsdf": {"type": "dielectric"}},
    "wall": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, 9])},
    "sky": {"type": "constant"},
})
image = np.array(mi.render(scene, spp=4))
sys.exit(0 if np.isfinite(image).all() and image.max() > 0 else 3)
"""


@dataclass(frozen=True)
class Backend:
    """The Mitsuba that comparisons run against.

    variant: the argument of `mitsuba.set_variant`;  version: of the mitsuba package;  reason: why
    this variant, in one line;  llvm_path: the library it needs, None for variants without LLVM.
    """

    variant: str
    version: str
    reason: str
    llvm_path: str | None

    @property
    def doubt(self) -> str:
        """What is doubtful about its version, "" for the one that this package requires."""
        if (expected := _expected_version()) in (None, self.version):
            return ""
        return (
            f"Mitsuba {self.version} is installed, but what is known of its limits and errors was "
            f"measured with {expected}; expected `pip install mitsuba=={expected}`"
        )


def _expected_version() -> str | None:
    """The version of Mitsuba that this package requires; None where it is not installed."""
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        for requirement in importlib.metadata.requires("reference-rt") or ():
            if match := re.match(r"mitsuba *== *([^\s;]+)", requirement):
                return match[1]
    return None


def choose(asked: str | None = None) -> Backend:
    """Find the best variant that works, without loading Mitsuba into this process.

    asked: a variant, or FASTEST; None: what the environment variable REFERENCE_RT_MITSUBA_VARIANT
    says.  Libraries are tried in
    the order of `llvm_libraries.candidates`; in a process that has imported Dr.Jit, only the one
    that it loaded then.  Raises ReferenceUnavailableError: Mitsuba is not installed, or the forced
    variant does not run.
    """
    version = _version()
    forced, slower = asked or os.environ.get(FORCE), ""
    if forced == FASTEST:
        problem = no_gpu() or prove(CUDA, None)
        if problem is None:
            return Backend(CUDA, version, "the fastest variant that works here", None)
        forced, slower = None, f"; {CUDA}: {problem}"
    if forced and "llvm" not in forced:
        problem = None if forced.startswith("scalar") else prove(forced, None)
        if problem:
            raise ReferenceUnavailableError(f"{FORCE}={forced}: {problem}")
        return Backend(forced, version, f"asked for by --variant or {FORCE}", None)
    variant = forced or LLVM
    tried = []
    for path in _libraries():
        problem = (
            prove(variant, None) if path is None else _remembered_proof(version, variant, path)
        )
        name = path or "the LLVM that Dr.Jit had loaded"
        if problem is None:
            why = (
                f"asked for by --variant or {FORCE}"
                if forced
                else "the fastest variant that works here"
            )
            return Backend(variant, version, f"{why}, with {name}{slower}", path)
        tried.append(f"{name} {problem}")
    reasons = "; ".join(tried) or "no libLLVM was found"
    advice = f"to get llvm: {llvm_libraries.ADVICE}"
    if forced:
        raise ReferenceUnavailableError(f"{FORCE}={forced}: {reasons}; {advice}")
    return Backend(SCALAR, version, f"{reasons}; {advice}{slower}", None)


@contextlib.contextmanager
def asked_for(variant: str) -> Iterator[None]:
    """A context in which `choose` takes this variant, here and in child processes; FASTEST leaves
    what the environment says."""
    before = os.environ.get(FORCE)
    if variant != FASTEST or not before:
        os.environ[FORCE] = variant
    try:
        yield
    finally:
        os.environ.pop(FORCE, None)
        if before is not None:
            os.environ[FORCE] = before


def no_gpu() -> str | None:
    """That there is no driver of an NVIDIA GPU, which variants of CUDA need; None if there is."""
    named = os.environ.get("DRJIT_LIBCUDA_PATH")
    found = named or ctypes.util.find_library("cuda") or ctypes.util.find_library("nvcuda")
    return None if found else "no GPU (no driver library libcuda was found)"


def _libraries() -> list[str | None]:
    """The libraries to try.

    Dr.Jit loads its LLVM when it is imported, and keeps it.  If the user's code has imported it,
    only that LLVM counts: None stands for what Dr.Jit's own search finds, here and in a child.
    """
    if "drjit" in sys.modules:
        return [os.environ.get(LIBRARY) or None]
    return [*llvm_libraries.candidates()[:_MOST_PROOFS]]


@functools.cache
def backend() -> Backend:
    """`choose`, once per process; whoever imports Mitsuba from now on gets that library.

    Raises ReferenceUnavailableError, also for a library whose own ones are missing.
    """
    chosen = choose()
    if chosen.llvm_path is not None:
        os.environ[LIBRARY] = chosen.llvm_path
        try:
            llvm_libraries.load_needed(chosen.llvm_path)
        except OSError as error:
            raise ReferenceUnavailableError(f"{chosen.llvm_path}: {error}") from None
    return chosen


def imported() -> Any:
    """The module `mitsuba` in any variant or none, with the LLVM of `backend`.  Nothing else may
    import Mitsuba first: Dr.Jit keeps the LLVM that it finds when it is imported.

    Raises ReferenceUnavailableError.
    """
    backend()
    try:
        import drjit
        import mitsuba as mi
    except (ImportError, RuntimeError, OSError) as error:
        raise ReferenceUnavailableError(f"Mitsuba does not start: {error}") from None
    use_threads(drjit.thread_count())
    return mi


def use_threads(count: int) -> None:
    """Let Mitsuba have so many threads, but at least two.

    With one, as on a machine or in a container of one core, Mitsuba 3.9.1 waits for ever for the
    thread that decodes an .exr file.
    """
    import drjit

    if (count := max(count, 2)) != drjit.thread_count():
        drjit.set_thread_count(count)


@functools.cache
def mitsuba() -> Any:
    """The module `mitsuba`, its variant set and our plugins registered.

    Raises ReferenceUnavailableError.
    """
    mi, chosen = imported(), backend()
    try:
        mi.set_variant(chosen.variant)
    except (ImportError, AttributeError, RuntimeError) as error:
        raise ReferenceUnavailableError(f"Mitsuba does not start: {error}") from None
    # In scalar variants every loaded plugin logs a warning ("terrible performance"), which
    # `Backend.reason` states already.
    mi.set_log_level(mi.LogLevel.Error)
    if chosen.doubt and (names := lacking(mi)):
        raise ReferenceUnavailableError(f"{chosen.doubt}; it has no {', '.join(names)}")
    _register_once(chosen.variant)
    return mi


@contextlib.contextmanager
def variant(name: str) -> Iterator[Any]:
    """A context with Mitsuba in another variant, our plugins registered there too."""
    mi = mitsuba()
    chosen = mi.variant()
    try:
        switch(name)
        yield mi
    finally:
        switch(chosen)


def switch(name: str) -> None:
    """Set the variant, our plugins registered there too."""
    mi = mitsuba()
    set_variant(mi, name)
    _register_once(name)


def set_variant(mi: Any, name: str) -> None:
    """`mi.set_variant`, but Mitsuba's integrators in Python stay if they are of that variant: to
    define them again takes 50 ms of 51 (measured), and the old ones are never freed."""
    if mi.variant() == name:
        return
    reload = importlib.reload

    def reloaded(module: ModuleType) -> ModuleType:
        common = sys.modules.get(f"{module.__name__}.common")
        made_of = getattr(common, "ADIntegrator", object)
        return module if issubclass(made_of, getattr(mi, "CppADIntegrator", ())) else reload(module)

    importlib.reload = reloaded  # what Mitsuba calls; of any other module it is the usual one
    try:
        with warnings.catch_warnings():
            # After a thousand definitions Dr.Jit warns each time that this is slow.
            warnings.simplefilter("ignore", RuntimeWarning)
            mi.set_variant(name)
    finally:
        importlib.reload = reload


@functools.cache
def _register_once(name: str) -> None:
    import mitsuba as mi

    from comparisons.mitsuba.plugins import register

    assert mi.variant() == name
    register(mi)


def scalar() -> contextlib.AbstractContextManager[Any]:
    """A context with Mitsuba in its scalar variant."""
    return variant(SCALAR)


def prove(variant: str, llvm_path: str | None) -> str | None:
    """Render a small scene in a child process: None if it works, else the problem."""
    environment = dict(os.environ)
    needed: list[str] = []
    if llvm_path is not None:
        environment[LIBRARY] = llvm_path
        needed = llvm_libraries.needed_by(llvm_path)
    try:
        run = subprocess.run(
            [sys.executable, "-c", _PROOF, variant, *needed],
            env=environment,
            capture_output=True,
            text=True,
            timeout=_PROOF_SECONDS,
            **tied(),
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"did not answer within {_PROOF_SECONDS:.0f} s"
    if run.returncode == 0:
        return None
    if run.returncode < 0:
        return f"ends the process by signal {-run.returncode}"
    lines = [line.strip() for line in run.stderr.splitlines() if line.strip()]
    return f"fails: {lines[-1][:200]}" if lines else "renders a wrong picture"


def _version() -> str:
    """Mitsuba's version, from its metadata: importing it takes half a second."""
    if importlib.util.find_spec("mitsuba") is None:
        raise ReferenceUnavailableError(
            "Mitsuba is not installed; expected: pip install 'reference-rt[compare]'"
        )
    return importlib.metadata.version("mitsuba")


# ---- results of earlier trials ------------------------------------------------------------------


def cache_folder() -> Path:
    """The folder of what is kept between runs."""
    return Path(os.environ.get("REFERENCE_RT_CACHE") or platformdirs.user_cache_dir("reference_rt"))


def _memory_file() -> Path:
    return cache_folder() / "mitsuba_llvm.json"


def _remembered_proof(version: str, variant: str, path: str) -> str | None:
    """`prove`, remembered for this machine, Mitsuba and file."""
    try:
        modified = Path(path).stat().st_mtime_ns
    except OSError:
        modified = 0
    key = "|".join((platform.node(), platform.machine(), version, variant, path, str(modified)))
    memory = _read_memory()
    if key in memory:
        return memory[key]
    problem = prove(variant, path)
    # A time-out may be a busy machine, and a library that fails may only lack another one: what is
    # remembered is what depends on the file alone.
    if problem is None or "by signal" in problem:
        _write_memory(_read_memory() | {key: problem})
    return problem


def _read_memory() -> dict[str, str | None]:
    try:
        memory = json.loads(read_text(_memory_file()))
    except (OSError, ValueError):
        return {}
    if not isinstance(memory, dict):
        return {}
    return {
        key: version
        for key, version in memory.items()
        if version is None or isinstance(version, str)
    }


def _write_memory(memory: dict[str, str | None]) -> None:
    """Write by renaming, so that no other process reads half a file; does nothing if the folder
    cannot be written."""
    file = _memory_file()
    part = file.with_suffix(f".{os.getpid()}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps(memory, indent=1), encoding="utf-8")
        part.replace(file)
    except OSError:
        part.unlink(missing_ok=True)
