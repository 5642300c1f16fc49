"""Links: tables and the operations on them, which compiled code reaches through addresses.

A kernel that takes a scene's tables is typed by all of them: one more type of shape, and all of its
code is compiled again.  A kernel that takes a `Link` is not.  A link is the address of a list: for
each type of table the address of the table's content, and the function pointer of each operation,
which is compiled for that type alone.  So all code of a scene's kernels comes from a finite set,
and what a scene does not have is neither compiled nor called.

- `Linker` makes the lists of a scene.  It collects which operations must be compiled.
- `Operation` is one operation of a group: `by_code.ByCode` and `Linkable` define them.
- `words_of` and `table_at` write and read the content of a table: eight bytes for each number, and
  for each array its address and its shape.

Both sides of a call take the types of arguments and result from the operation's annotations, since
neither knows the other.
"""

import functools
import inspect
import struct
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Any, NamedTuple, TypeVar

import numba
import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core import typing as numba_typing
from numba.extending import intrinsic
from numba.np import arrayobj

from reference_rt.jit.kernel import (
    CACHE_FOLDER,
    COMPILER,
    is_named_tuple,
    kernel,
    overload_kernel,
)
from reference_rt.jit.kernel_cache import KernelCache

F = TypeVar("F", bound=Callable[..., Any])
Words = npt.NDArray[np.int64]

STRIDE = 32
"""Words of a type in a link's list: the address of its table, then function pointers."""


NOT_LINKED = -1
"""In place of the function pointer of an operation that a link lacks, though its type has one; 0:
the type has none, or there is no table of the type."""


class Link(NamedTuple):
    """The address of a list of tables and operations; 0 for none, on which nothing may be called.
    """

    address: int


LINK = types.NamedUniTuple(types.int64, 1, Link)
"""Numba's type of a `Link`."""

_WORD, _REAL = ir.IntType(64), ir.DoubleType()

_TYPE_OF: dict[Any, Any] = {
    float: types.float64,
    int: types.int64,
    bool: types.boolean,
    None: types.none,
    type(None): types.none,
    npt.NDArray[np.float64]: types.Array(types.float64, 1, "C"),
    npt.NDArray[np.int64]: types.Array(types.int64, 1, "C"),
}


def declare(annotation: Any, numba_type: Any) -> None:
    """Arguments with this annotation have this type in calls of operations."""
    _TYPE_OF[annotation] = numba_type


def type_of(annotation: Any) -> Any:
    """Numba's type of an operation's argument or result, by its annotation.  Arrays are
    one-dimensional, or `Annotated` with the number of their dimensions.  Raises TypeError for what has no single type."""
    with suppress(TypeError):  # not hashable
        if annotation in _TYPE_OF:
            return _TYPE_OF[annotation]
    if typing.get_origin(annotation) is Annotated:
        of, dimensions = typing.get_args(annotation)
        return type_of(of).copy(ndim=dimensions)
    if typing.get_origin(annotation) is tuple:
        parts = [type_of(part) for part in typing.get_args(annotation)]
        return types.BaseTuple.from_types(parts)
    if isinstance(annotation, type) and issubclass(annotation, tuple):
        hints = typing.get_type_hints(annotation, include_extras=True)
        parts = [type_of(hints[field]) for field in annotation._fields]  # type: ignore[attr-defined]
        return types.BaseTuple.from_types(parts, annotation)
    raise TypeError(f"{annotation}: no single type; expected a number, an array or a NamedTuple")


class Row(NamedTuple):
    """A type of table in a group: its code, the field of its table, its kernel."""

    code: int
    field: str
    kernel: Callable[..., Any]


class Operation:
    """An operation of a group of tables: one kernel for each type that has it."""

    def __init__(
        self, function: Callable[..., Any], number: int, rows: Sequence[Row], module: str
    ) -> None:
        self.name, self.number, self.module = function.__name__, number, module
        self.rows = {row.code: row.kernel for row in rows}
        self.parameters = _parameters(function)[1:]
        self._function = function
        self._entries: dict[int, Any] = {}
        if not 1 <= number < STRIDE:
            raise TypeError(f"{module}: too many operations; expected at most {STRIDE - 1}")

    @functools.cached_property
    def arguments(self) -> tuple[Any, ...]:
        """The types of the arguments after the table."""
        hints = typing.get_type_hints(self._function, include_extras=True)
        return tuple(type_of(hints[name]) for name in self.parameters)

    @functools.cached_property
    def returns(self) -> Any:
        return type_of(typing.get_type_hints(self._function, include_extras=True)["return"])

    def call_for(self, code: int, table: Any) -> tuple[Any, Any]:
        """The entry kernel for a type of table, and the signature to compile it for.  table:
        Numba's type of it."""
        if code not in self._entries:
            self._entries[code] = self._entry(code)
        signature = numba_typing.signature(
            self.returns, types.CPointer(table), *self.arguments
        )
        return self._entries[code], signature

    def _entry(self, code: int) -> Any:
        """operation(table, ...), whose table is a pointer; only code calls it, so that it has no
        wrapper for Python (measured: 12 ms to compile instead of 25)."""
        of_row = self.rows[code]
        taken = _parameters(of_row)[1:]
        text = f"def {self.name}({', '.join(['table', *self.parameters])}):\n"
        text += f"    return kernel({', '.join(['table_at(table)', *taken])})\n"
        known = {"__name__": self.module, "kernel": of_row, "table_at": table_at}
        exec(compile(text, f"<{self.module}.{self.name} {code}>", "exec"), known)
        unwrapped = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        compiled = njit(**{**COMPILER.entry, **unwrapped})(known[self.name])
        if CACHE_FOLDER is not None:
            name = f"{of_row.__module__}.{of_row.__name__} as {self.module}.{self.name}"
            with suppress(OSError):  # a kernel typed into a console
                compiled._cache = KernelCache(of_row, CACHE_FOLDER, name)
        return compiled

    def caller(self) -> Callable[..., Any]:
        """call(pointer, table, arguments): calls the operation through its function pointer."""
        declared = types.Tuple([types.int64, *self.arguments])
        returns = self.returns

        @intrinsic  # type: ignore[untyped-decorator]
        def call(typing_context: Any, pointer: Any, table: Any, given: Any) -> Any:
            def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
                function_type = context.call_conv.get_function_type(returns, declared.types)
                function = builder.inttoptr(values[0], function_type.as_pointer())
                arguments = [values[1]]
                for k, (a, b) in enumerate(zip(given.types, declared.types[1:], strict=True)):
                    value = builder.extract_value(values[2], k)
                    arguments.append(context.cast(builder, value, a, b))
                return COMPILER.invoke(
                    context, builder, function, returns, declared.types, arguments
                )

            return returns(types.int64, types.int64, given), generate

        made: Callable[..., Any] = call
        return made


class Linkable:
    """Decorates kernels whose first argument is one table, or a link to it:

        geometries = Linkable("geometries")

        @geometries.operation
        def closest_hit(geometry: Geometry, ray: Ray) -> Hit: ...

    Given the table, the kernel is inlined; given a link, it is called through the link.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.operations: dict[str, Operation] = {}

    def operation(self, function: F) -> F:
        body = kernel(function)
        row = Row(0, "table", body)
        operation = Operation(function, len(self.operations) + 1, [row], function.__module__)
        self.operations[function.__name__] = operation
        given = ", ".join(operation.parameters)
        comma = "," if len(operation.parameters) == 1 else ""

        def choose(table: Any, *rest: Any) -> Any:
            return body(table, *rest)

        @overload_kernel(choose)
        def _compiled(table: Any, *rest: Any) -> Callable[..., Any]:
            if not is_named_tuple(table, Link):
                return body
            text = f"def {operation.name}(table, {given}):\n"
            text += f"    pointer = word(table.address, {operation.number})\n"
            text += "    if pointer <= 0:\n        stop()\n"
            text += f"    return call(pointer, word(table.address, 0), ({given}{comma}))\n"
            return executed(text, operation, call=operation.caller(), word=word, stop=stop)

        _name_as(choose, function)
        return choose  # type: ignore[return-value]


def _name_as(made: Any, function: Callable[..., Any]) -> None:
    made.__name__, made.__doc__ = function.__name__, function.__doc__
    made.__module__, made.__wrapped__ = function.__module__, function
    made.__annotations__ = function.__annotations__


def executed(text: str, operation: Operation, **names: Any) -> Any:
    """The kernel that a text defines for an operation; names: those that the text uses."""
    known = {"__name__": operation.module, **names}
    exec(compile(text, f"<{operation.module}.{operation.name} of a link>", "exec"), known)
    return known[operation.name]


def _parameters(function: Callable[..., Any]) -> list[str]:
    return [*inspect.signature(function).parameters]


class Linker:
    """Makes the links of a scene.  They are valid as long as the linker lives.

    calls: the entry kernels to be compiled, with their signatures.
    """

    def __init__(self) -> None:
        self.calls: dict[tuple[Any, Any], list[tuple[Words, int]]] = {}
        self._kept: list[Any] = []

    def link(
        self, operations: Mapping[str, Operation], wanted: Iterable[str], tables: Mapping[int, Any]
    ) -> Link:
        """A link to tables, by code, with the operations `wanted` of a group's `operations`.  Calls
        of its other operations stop the process."""
        found = [operations[name] for name in wanted]
        codes = [code for operation in operations.values() for code in operation.rows]
        most = max([*tables, *codes])
        words = np.zeros(STRIDE * (most + 1), np.int64)
        for operation in operations.values():
            for code in operation.rows.keys() & tables.keys():
                words[STRIDE * code + operation.number] = NOT_LINKED
        for code, table in tables.items():
            content = np.array(words_of(table) or [0], np.int64)
            self._kept += [table, content]
            words[STRIDE * code] = content.ctypes.data
            of_table = numba.typeof(table)  # once: it takes up to 1 ms
            for operation in found:
                if code in operation.rows:
                    call = operation.call_for(code, of_table)
                    place = words, STRIDE * code + operation.number
                    self.calls.setdefault(call, []).append(place)
        self._kept.append(words)
        return Link(words.ctypes.data)

    def resolve(self) -> None:
        """Write the function pointers, once all calls are compiled."""
        for (compiled, signature), places in self.calls.items():
            found = compiled.overloads[signature.args]
            pointer = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
            for words, k in places:
                words[k] = pointer


def words_of(value: Any) -> list[int]:
    """The content of a table: numbers, arrays, and tuples of these.  None has no words."""
    if value is None:
        return []
    if isinstance(value, tuple):
        return [word for part in value for word in words_of(part)]
    if isinstance(value, np.ndarray):
        if not value.flags.c_contiguous:
            raise TypeError("an array of a table is not C-contiguous")
        return [value.ctypes.data, *value.shape]
    if isinstance(value, float):
        return [int(struct.unpack("<q", struct.pack("<d", value))[0])]
    return [int(value)]


class _Reader:
    """Emits the code that reads a table's words."""

    def __init__(self, context: Any, builder: Any, start: Any) -> None:
        self.context, self.builder, self.start, self.at = context, builder, start, 0

    def word(self, of: ir.Type = _WORD) -> Any:
        place = self.builder.gep(self.start, [_WORD(self.at)])
        self.at += 1
        return self.builder.load(self.builder.bitcast(place, of.as_pointer()))

    def value(self, numba_type: Any) -> Any:
        context, builder = self.context, self.builder
        if isinstance(numba_type, types.NoneType):
            return context.get_dummy_value()
        if isinstance(numba_type, types.BaseTuple):
            parts = [self.value(part) for part in numba_type.types]
            return context.make_tuple(builder, numba_type, parts)
        if isinstance(numba_type, types.Array):
            return self._array(numba_type)
        if isinstance(numba_type, types.Float):
            return self.word(_REAL)
        if isinstance(numba_type, types.Boolean):
            return builder.icmp_signed("!=", self.word(), _WORD(0))
        return self.word()

    def _array(self, numba_type: Any) -> Any:
        context, builder = self.context, self.builder
        item = context.get_data_type(numba_type.dtype)
        size = context.get_constant(types.intp, context.get_abi_sizeof(item))
        data = self.word(item.as_pointer())
        shape = [self.word() for _ in range(numba_type.ndim)]
        strides = [size]
        for length in shape[:0:-1]:
            strides.insert(0, builder.mul(strides[0], length))
        array = context.make_array(numba_type)(context, builder)
        arrayobj.populate_array(
            array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None
        )
        return array._getvalue()


@intrinsic  # type: ignore[untyped-decorator]
def table_at(typing_context: Any, pointer: Any) -> Any:
    """The table whose content (`words_of`) begins at a pointer."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        start = builder.bitcast(values[0], _WORD.as_pointer())
        return _Reader(context, builder, start).value(pointer.dtype)

    return pointer.dtype(pointer), generate


@intrinsic  # type: ignore[untyped-decorator]
def word(typing_context: Any, address: Any, k: Any) -> Any:
    """Word k of a list at an address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        start = builder.inttoptr(values[0], _WORD.as_pointer())
        return builder.load(builder.gep(start, [values[1]]))

    return types.int64(types.int64, types.int64), generate


@intrinsic  # type: ignore[untyped-decorator]
def stop(typing_context: Any) -> Any:
    """Stops the process: a wrong picture would be worse.  Only an operation that `Linker.link` was
    not asked for comes here."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        of_type = ir.FunctionType(ir.VoidType(), [])
        trap = cgutils.get_or_insert_function(builder.module, of_type, "llvm.trap")
        builder.call(trap, [])
        return context.get_dummy_value()

    return types.none(), generate


@kernel
def _no_link(link: Link) -> bool:
    return link.address == 0


@kernel
def _never(table: Any) -> bool:
    return False


def is_absent(table: Any) -> bool:
    """Whether a link in place of a table is a link to nothing; False for tables."""
    return False


@overload_kernel(is_absent)
def _is_absent(table: Any) -> Callable[..., bool]:
    return _no_link if is_named_tuple(table, Link) else _never
