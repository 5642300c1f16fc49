"""Which compiler pipeline kernels use: ours, which replaces private parts of Numba, or Numba's.

Ours (`numba_pipeline.py`) compiles several times faster.  It depends on private parts of one
release of Numba, which another release may have renamed.  In that case Numba's own pipeline is
used, with a warning: images have the same bits, and the first render of a kind of scene takes
longer.
"""

import os
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
from numba.core.compiler import CompilerBase
from numba.core.registry import cpu_target

from reference_rt.jit.numba_codegen import SUPPORTED, call_checked
from reference_rt.util.errors import UsageError

CHOICE = "REFERENCE_RT_COMPILER"
"""The environment variable that names a compiler, `INLINING` or `STOCK`."""

INLINING, STOCK = "inlining", "stock"


class Compiler(NamedTuple):
    """Options for `numba.njit`, and how compiled code calls an entry kernel through a pointer.

    kernel, entry, callee: the options for kernels, which are inlined, for entry kernels, and for
    those entry kernels that only compiled code calls;  invoke: like `numba_pipeline.invoke`.
    """

    name: str
    kernel: dict[str, Any]
    entry: dict[str, Any]
    callee: dict[str, Any]
    invoke: Callable[..., Any]


def choose() -> Compiler:
    """The compiler that REFERENCE_RT_COMPILER names.  By default ours if it supports the installed
    Numba, else Numba's own, with a warning."""
    named = os.environ.get(CHOICE, "")
    if named == STOCK:
        return _stock()
    if named not in ("", INLINING):
        return _refusing(named)
    problem = None if named or _release() == SUPPORTED else "is another release"
    if problem is None:
        try:
            return _inlining()
        except (ImportError, AttributeError) as error:
            problem = f"lacks what it replaces ({error})"
    # warn() would add a line of source code; this keeps the warning on one line.
    warnings.warn_explicit(
        f"reference_rt's compiler is written for Numba {SUPPORTED}, and the installed Numba "
        f"{numba.__version__} {problem}: Numba's own compiler is used, which is slower and gives "
        f"the same bits; expected: pip install 'numba=={SUPPORTED}.*', or {CHOICE}={STOCK} to "
        "choose it without this warning",
        RuntimeWarning,
        "reference_rt",
        0,
    )
    return _stock()


def _release() -> str:
    return ".".join(numba.__version__.split(".")[:2])


# Without _nrt=False every call atomically counts references to every array of the scene, for which
# threads contend (measured: the Cornell box renders 5 times slower).
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}

# Kernels are never called from C.
_INSIDE = _OPTIONS | {"no_cfunc_wrapper": True, "forceinline": True}

_ENTRY = _OPTIONS | {"nogil": True}

# Without the wrappers that Python and C would call (measured: a small one compiles in 12 ms instead
# of 25).
_CALLEE = _OPTIONS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def _inlining() -> Compiler:
    from reference_rt.jit.numba_pipeline import EntryCompiler, InlinedCompiler, invoke

    entry = {"pipeline_class": EntryCompiler}
    inside = _INSIDE | {"pipeline_class": InlinedCompiler}
    return Compiler(INLINING, inside, _ENTRY | entry, _CALLEE | entry, invoke)


def _stock() -> Compiler:
    return Compiler(STOCK, _known(_INSIDE), _known(_ENTRY), _known(_CALLEE), call_checked)


def _known(options: dict[str, Any]) -> dict[str, Any]:
    """The options that this Numba supports.  All but error_model and nogil only save time."""
    return {name: value for name, value in options.items() if hasattr(cpu_target.options, name)}


def _refusing(named: str) -> Compiler:
    """A compiler that raises UsageError for its first kernel.  Raised at import, the error would be
    a traceback; this late, commands print it as one line."""

    class Refusing(CompilerBase):  # type: ignore[misc]
        def __init__(self, *args: Any, **options: Any) -> None:
            raise UsageError(f"{CHOICE}={named}: unknown; expected {INLINING} or {STOCK}")

    refusing = {"pipeline_class": Refusing}
    options = _INSIDE | refusing, _ENTRY | refusing, _CALLEE | refusing
    return Compiler(named, *options, call_checked)
