"""Kernels that are compiled by themselves and called through their address.

A caller that takes an address is compiled without what stands there: both can be compiled at the
same time (`jit/parallel_compile.py`), and what is kept of one serves all callers of its types.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from reference_rt.jit.kernel import COMPILER, Signature

Address = npt.NDArray[np.intp]
"""(1,) where a kernel stands; what it holds is written before any call."""


def address_of(compiled: Callable[..., Any], signature: Signature) -> int:
    """Where the machine code of an entry kernel stands that is compiled for arguments of these
    types."""
    found = compiled.overloads[signature]  # type: ignore[attr-defined]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


@intrinsic  # type: ignore[untyped-decorator]
def call_at(typing_context: Any, address: Any, arguments: Any) -> Any:
    """Call the entry kernel at an address with a tuple of arguments; it returns nothing.

    The arguments must be of the types that it was compiled for.
    """
    declared = types.Tuple([types.unliteral(t) for t in arguments])

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        function_type = context.call_conv.get_function_type(types.none, declared.types)
        function = builder.inttoptr(values[0], function_type.as_pointer())
        given = [
            context.cast(builder, value, a, b)
            for value, a, b in zip(
                cgutils.unpack_tuple(builder, values[1]), arguments, declared, strict=True
            )
        ]
        return COMPILER.invoke(context, builder, function, types.none, declared.types, given)

    return types.none(types.intp, arguments), generate
