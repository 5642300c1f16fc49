"""What functions that generate LLVM code need from inside Numba, in one place.

Numba documents `intrinsic`, but little of what an intrinsic's generator may use.  All modules that
generate code get the rest from here, except `compiler.py`.  `docs/numba.md` lists everything
in this package that depends on undocumented parts of Numba, and why."""

import inspect
import linecache
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils, typing
from numba.core.base import BaseContext
from numba.core.callconv import CPUCallConv
from numba.core.codegen import JITCodeLibrary
from numba.np import arrayobj

# Kernels made of generated text: `by_code.py` and `links.py` write it, and tracebacks show it.


def parameters_of(function: Callable[..., Any]) -> list[str]:
    """The names of a function's parameters."""
    return [*inspect.signature(function).parameters]


def define(
    text: str, module: str, name: str, label: str, known: Mapping[str, Any]
) -> Callable[..., Any]:
    """The function `name` that a text defines.

    module: in which it is said to be;  label: what tells it apart, in tracebacks, from others of
    the same name;  known: the values of all other names in the text.
    """
    file = f"<{module}.{name} {label}>"
    linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file
    names = {"__name__": module, **known}
    exec(compile(text, file, "exec"), names)
    made: Callable[..., Any] = names[name]
    return made


SUPPORTED = "0.68"
"""The release of Numba that `jit/` is written for, as in pyproject.toml."""

NEEDED: tuple[tuple[Any, str], ...] = (
    (JITCodeLibrary, "get_pointer_to_function"),
    (CPUCallConv, "get_function_type"),
    (CPUCallConv, "call_function"),
    (CPUCallConv, "return_status_propagate"),
    (BaseContext, "make_tuple"),
    (BaseContext, "make_array"),
    (BaseContext, "get_abi_sizeof"),
    (BaseContext, "get_dummy_value"),
    (BaseContext, "cast"),
    (arrayobj, "populate_array"),
    (cgutils, "unpack_tuple"),
    (cgutils, "get_or_insert_function"),
    (cgutils, "global_constant"),
    (cgutils, "alloca_once_value"),
    (typing, "signature"),
    (types, "CPointer"),
    (types.BaseTuple, "from_types"),
)
"""Parts of Numba that are used below and by callers, whichever compiler is chosen."""

for _owner, _part in NEEDED:
    if not hasattr(_owner, _part):
        raise ImportError(
            f"Numba {numba.__version__}: {_owner.__name__} has no {_part}; "
            f"expected: pip install 'numba=={SUPPORTED}.*'"
        )


def signature(returns: Any, *arguments: Any) -> Any:
    """The signature of a function, from Numba types."""
    return typing.signature(returns, *arguments)


def nothing(context: Any) -> Any:
    """What the generator of a function without a result returns."""
    return context.get_dummy_value()


def data_of(context: Any, builder: ir.IRBuilder, array_type: Any, array: ir.Value) -> ir.Value:
    """A pointer to the first item of an array."""
    return context.make_array(array_type)(context, builder, array).data


def array_at(
    context: Any, builder: ir.IRBuilder, array_type: Any, data: ir.Value, shape: Sequence[ir.Value]
) -> ir.Value:
    """The C-contiguous array of this shape over the items from the pointer `data` on.  It does not
    own them."""
    size = item_size(context, array_type.dtype)
    strides = [size]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    array = context.make_array(array_type)(context, builder)
    arrayobj.populate_array(
        array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None
    )
    return array._getvalue()


def item_size(context: Any, dtype: Any) -> ir.Value:
    """The size of a number in bytes."""
    return context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(dtype)))


def call_llvm(
    builder: ir.IRBuilder, name: str, returns: ir.Type, arguments: Sequence[ir.Value]
) -> ir.Value:
    """Emit a call of a function of LLVM."""
    of_type = ir.FunctionType(returns, [value.type for value in arguments])
    function = cgutils.get_or_insert_function(builder.module, of_type, name)
    return builder.call(function, arguments)


def constant(builder: ir.IRBuilder, name: str, values: ir.Constant) -> ir.Value:
    """A pointer to a constant in the program's memory."""
    return cgutils.global_constant(builder, name, values)


def variable(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """A pointer to a variable on the stack, with its first value."""
    return cgutils.alloca_once_value(builder, value)


def items_of(builder: ir.IRBuilder, values: ir.Value) -> list[ir.Value]:
    """The items of a tuple."""
    return list(cgutils.unpack_tuple(builder, values))


def function_at(
    context: Any, builder: ir.IRBuilder, address: ir.Value, returns: Any, arguments: Sequence[Any]
) -> ir.Value:
    """The function at an address, which was compiled for these Numba types."""
    function_type = context.call_conv.get_function_type(returns, arguments)
    return builder.inttoptr(address, function_type.as_pointer())


def call_checked(
    context: Any, builder: ir.IRBuilder, function: Any, returns: Any, types: Any, arguments: Any
) -> ir.Value:
    """Emit a call of a compiled function as Numba does: an exception that it raises is passed
    on."""
    status, value = context.call_conv.call_function(builder, function, returns, types, arguments)
    with builder.if_then(status.is_error, likely=False):
        context.call_conv.return_status_propagate(builder, status)
    return value
