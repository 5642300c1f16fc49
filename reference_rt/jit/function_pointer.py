"""Calls of entry kernels through function pointers.

The caller is compiled without the callee's code.  So the two can be compiled in parallel
(`parallel_compile.py`), and the callee's cached code serves all callers with its argument types.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import types
from numba.extending import intrinsic

from reference_rt.jit.compiler import invoke
from reference_rt.jit.kernel import Signature
from reference_rt.jit.numba_codegen import function_at, items_of

FunctionPointer = npt.NDArray[np.intp]
"""(1,) the function pointer of an entry kernel, stored before the first call."""


def pointer_to(compiled: Callable[..., Any], signature: Signature) -> int:
    """The function pointer of an entry kernel that is compiled for arguments of these types."""
    taken = signature if isinstance(signature, tuple) else signature.args
    found = compiled.overloads[taken]  # type: ignore[attr-defined]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


@intrinsic  # type: ignore[untyped-decorator]
def call_pointer(typing_context: Any, address: Any, arguments: Any) -> Any:
    """Call the entry kernel at `address` with a tuple of arguments; it returns nothing.

    The arguments must have the types for which it was compiled.
    """
    declared = [types.unliteral(t) for t in arguments]

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        given = items_of(builder, values[1])
        return emit_call(context, builder, values[0], types.none, declared, arguments, given)

    return types.none(types.intp, arguments), generate


def emit_call(
    context: Any,
    builder: Any,
    address: Any,
    returns: Any,
    declared: Sequence[Any],
    given: Sequence[Any],
    values: Sequence[Any],
) -> Any:
    """Emit a call of the entry kernel at an address.  returns, declared: the types for which it was
    compiled;  given, values: the types and values of the arguments, which are cast."""
    function = function_at(context, builder, address, returns, declared)
    arguments = [
        context.cast(builder, value, a, b)
        for value, a, b in zip(values, given, declared, strict=True)
    ]
    return invoke(context, builder, function, returns, declared, arguments)
