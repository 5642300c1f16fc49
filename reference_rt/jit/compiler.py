"""The compiler of kernels: ours, which replaces private parts of Numba, or Numba's own.

Ours (`jit/numba_pipeline.py`) compiles several times faster.  It is written for the private parts
of one release of Numba, and another may have renamed them.  Then Numba's own takes its place, with
a warning: pictures have the same bits, and the first render of a kind of scene takes longer.
"""

import os
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
from numba.core.compiler import CompilerBase
from numba.core.registry import cpu_target

from reference_rt.util.errors import UsageError

SUPPORTED = "0.68"
"""The release of Numba that `jit/numba_pipeline.py` is written for, as in pyproject.toml."""

CHOICE = "REFERENCE_RT_COMPILER"
"""The environment variable that names a compiler: `INLINING` or `STOCK`."""

INLINING, STOCK = "inlining", "stock"


class Compiler(NamedTuple):
    """Options for `numba.njit`, and how compiled code calls an entry kernel at an address.

    kernel, entry: the options of kernels, which are inlined, and of entry kernels;  invoke: as
    `inlining.invoke`.
    """

    name: str
    kernel: dict[str, Any]
    entry: dict[str, Any]
    invoke: Callable[..., Any]


def choose() -> Compiler:
    """The compiler that REFERENCE_RT_COMPILER names; by default ours where it fits Numba, else
    Numba's own and a warning."""
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
    # In one line: without a line of the source, which Python shows where it knows the file.
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


# Without _nrt=False, calls count references of every array of the scene, atomically: measured 5
# times slower on the Cornell box, with threads that contend.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}

# Nothing calls kernels from C.
_INSIDE = _OPTIONS | {"no_cfunc_wrapper": True, "forceinline": True}

_ENTRY = _OPTIONS | {"nogil": True}


def _inlining() -> Compiler:
    from reference_rt.jit.numba_pipeline import EntryCompiler, InlinedCompiler, invoke

    inside = _INSIDE | {"pipeline_class": InlinedCompiler}
    return Compiler(INLINING, inside, _ENTRY | {"pipeline_class": EntryCompiler}, invoke)


def _stock() -> Compiler:
    return Compiler(STOCK, _known(_INSIDE), _known(_ENTRY), _invoke)


def _known(options: dict[str, Any]) -> dict[str, Any]:
    """Those that this Numba has: all but error_model and nogil only save time."""
    return {name: value for name, value in options.items() if hasattr(cpu_target.options, name)}


def _invoke(
    context: Any, builder: Any, function: Any, returns: Any, types: Any, arguments: Any
) -> Any:
    """Write a call as Numba's own compiler does."""
    status, value = context.call_conv.call_function(builder, function, returns, types, arguments)
    with builder.if_then(status.is_error, likely=False):
        context.call_conv.return_status_propagate(builder, status)
    return value


def _refusing(named: str) -> Compiler:
    """Raises UsageError when the first kernel is to be compiled: at import it would be a traceback
    before any command could tell it in one line."""

    class Refusing(CompilerBase):  # type: ignore[misc]
        def __init__(self, *args: Any, **options: Any) -> None:
            raise UsageError(f"{CHOICE}={named}: unknown; expected {INLINING} or {STOCK}")

    refusing = {"pipeline_class": Refusing}
    return Compiler(named, _INSIDE | refusing, _ENTRY | refusing, _invoke)
