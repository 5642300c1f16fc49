"""Links: tables and the operations on them, which compiled code reaches through addresses.

A kernel that takes a scene's tables is typed by all of them: one more type of shape, and all of its
code is compiled again.  A kernel that takes a `Link` is not.  A link is the address of a list: for
each type of table the address of the table's content, and the function pointer of each operation,
which is compiled for that type alone.  So all code of a scene's kernels comes from a finite set,
and what a scene does not have is neither compiled nor called.

- `ByCode` (`by_code.py`) and `Linkable` make groups of operations: the first on one of several
  tables, the second on one table.
- `Linker` makes the lists of a scene, and collects which operations must be compiled.

What is compiled for `surface` of spheres, and what stands in the list for it, is the entry kernel

    def surface_0(table, ray, hit):  # 0 is the code of spheres
        return kernel(table_at(table), ray, hit)  # sphere.surface

Both sides of a call take the types of arguments and result from the operation's annotations, since
neither knows the other.  `by_code.py` shows the caller's side.
"""

import functools
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar

import numba
import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from reference_rt.jit.compiler import invoke
from reference_rt.jit.kernel import (
    Signature,
    callee_kernel,
    is_named_tuple,
    kernel,
    overload_kernel,
)
from reference_rt.jit.numba_codegen import (
    call_llvm,
    define,
    function_at,
    items_of,
    nothing,
    parameters_of,
    signature,
)
from reference_rt.jit.table_words import table_at, type_of_table, word_at, words_of

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
    """From now on, arguments with this annotation have this type in calls of operations."""
    _TYPE_OF[annotation] = numba_type


def type_of(annotation: Any) -> Any:
    """Numba's type of an operation's argument or result, by its annotation.

    Arrays have one dimension, or as many as they are `Annotated` with.  Raises TypeError for an
    annotation that means more than one type.
    """
    with suppress(TypeError):  # not hashable
        if annotation in _TYPE_OF:
            return _TYPE_OF[annotation]
    if typing.get_origin(annotation) is Annotated:
        of, dimensions = typing.get_args(annotation)
        if isinstance(array := type_of(of), types.Array):
            return array.copy(ndim=dimensions)
    if typing.get_origin(annotation) is tuple:
        parts = [type_of(part) for part in typing.get_args(annotation)]
        return types.BaseTuple.from_types(parts)
    if isinstance(annotation, type) and hasattr(annotation, "_fields"):
        hints = typing.get_type_hints(annotation, include_extras=True)
        parts = [type_of(hints[field]) for field in annotation._fields]
        return types.BaseTuple.from_types(parts, annotation)
    raise TypeError(
        f"{annotation}: not one type; expected float, int, bool, a NumPy array, a tuple or a "
        "NamedTuple of these, or what is declared"
    )


F = TypeVar("F", bound=Callable[..., Any])
Words = npt.NDArray[np.int64]

STRIDE = 32
"""Words of a type in a link's list: the address of its table, then function pointers."""

NOT_LINKED = -1
"""In place of the function pointer of an operation that a link lacks, though its type has one; 0:
the type has none, or there is no table of the type."""


class Link(NamedTuple):
    """The address of a list of tables and operations; 0 for none: no operation may be called."""

    address: int


LINK = types.NamedUniTuple(types.int64, 1, Link)
"""Numba's type of a `Link`."""


_IN_TEXTS = {
    "call",
    "code",
    "kernel",
    "otherwise",
    "pointer",
    "stop",
    "table",
    "table_at",
    "word_at",
}
"""Names that generated text uses."""


def pointer_to(compiled: Callable[..., Any], signature: Signature) -> int:
    """The function pointer of an entry kernel that is compiled for arguments of these types."""
    taken = signature if isinstance(signature, tuple) else signature.args
    found = compiled.overloads[taken]  # type: ignore[attr-defined]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


def _emit_call(
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


@dataclass(eq=False)
class Callee:
    """What stands behind links for an operation and a type of table.

    table: Numba's type;  call: the entry kernel, and the signature to compile it for;  pointer: to
    the function once it is compiled in this process, else 0.  It is found by identity: to hash the
    types of a table takes as long as to trace some rays.
    """

    table: Any
    call: tuple[Any, Any]
    pointer: int = 0


class Row(NamedTuple):
    """A type of table in a group: its code, the field of its table, its kernel."""

    code: int
    field: str
    kernel: Callable[..., Any]


class Operation:
    """An operation of a group of tables: one kernel for each type that has it."""

    of: ClassVar[dict[Callable[..., Any], "Operation"]] = {}
    """By the function that kernels call."""

    def __init__(
        self, group: "Group", function: Callable[..., Any], number: int, rows: Sequence[Row]
    ) -> None:
        self.group, self.function = group, function
        self.name, self.number, self.module = function.__name__, number, function.__module__
        self.rows = {row.code: row.kernel for row in rows}
        self.parameters = parameters_of(function)[1:]
        self._entries: dict[int, Any] = {}
        self._callees: dict[tuple[int, int], Callee] = {}

    @cached_property
    def arguments(self) -> tuple[Any, ...]:
        """The types of the arguments after the table."""
        hints = typing.get_type_hints(self.function, include_extras=True)
        return tuple(type_of(hints[name]) for name in self.parameters)

    @cached_property
    def returns(self) -> Any:
        """The type of the result."""
        return type_of(typing.get_type_hints(self.function, include_extras=True)["return"])

    def call_for(self, code: int, table: Any) -> tuple[Any, Any]:
        """The entry kernel for a type of table, and the signature to compile it for.  table:
        Numba's type of it."""
        if code not in self._entries:
            self._entries[code] = self._entry(code)
        pointer = types.CPointer(table)
        return self._entries[code], signature(self.returns, pointer, *self.arguments)

    def callee_for(self, code: int, table: Any) -> Callee:
        """`call_for`, made once in a process."""
        key = code, id(table)  # of an object that lives as long as the callee
        if key not in self._callees:
            self._callees[key] = Callee(table, self.call_for(code, table))
        return self._callees[key]

    def _entry(self, code: int) -> Any:
        # The code is part of the name, because all compiled code of a process shares one table of
        # symbols, and two types may have tables of one class: what two other processes compiled for
        # them may then differ in the name alone.
        of_row, name = self.rows[code], f"{self.name}_{code}"
        taken = ", ".join(["table_at(table)", *parameters_of(of_row)[1:]])
        text = (
            f"def {name}({', '.join(['table', *self.parameters])}):\n    return kernel({taken})\n"
        )
        known = {"kernel": of_row, "table_at": table_at}
        made = define(text, self.module, name, f"by {of_row.__module__}", known)
        return callee_kernel(made, of_row, f"{self.module}.{name}")

    def through_link(
        self, tables: str, code: str = "", otherwise: Callable[..., Any] | None = None
    ) -> Callable[..., Any]:
        """The kernel for a link: it calls the operation through its function pointer.

        tables: the name of its first parameter;  code: an expression of its parameters, and
        otherwise: the kernel for codes without table or operation;  neither in a group of one type.
        """
        given = ", ".join([tables, *self.parameters])
        at = f"{STRIDE} * code + " if code else ""
        pointer = f"word_at({tables}.address, {at}{self.number})"
        arguments = "".join(f"{name}, " for name in self.parameters)
        call = f"call(pointer, word_at({tables}.address, {at}0), ({arguments}))"
        if code:
            lines = [
                f"code = {code}",
                f"if 0 <= code <= {max(self.rows, default=-1)}:",
                f"    pointer = {pointer}",
                "    if pointer < 0:",
                "        stop()",
                "    if pointer != 0:",
                f"        return {call}",
                f"return otherwise({given})",
            ]
        else:
            lines = [f"pointer = {pointer}", "if pointer <= 0:", "    stop()", f"return {call}"]
        text = f"def {self.name}({given}):\n"
        text += "".join(f"    {line}\n" for line in lines)
        known = {"word_at": word_at, "stop": stop, "call": self._call(), "otherwise": otherwise}
        return define(text, self.module, self.name, "through a link", known)

    def _call(self) -> Callable[..., Any]:
        """call(pointer, table, arguments): calls the operation; table: the address of its words."""
        returns, declared = self.returns, [types.int64, *self.arguments]

        @intrinsic  # type: ignore[untyped-decorator]
        def call(typing_context: Any, pointer: Any, table: Any, arguments: Any) -> Any:
            def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
                given = [values[1], *items_of(builder, values[2])]
                types_of = [table, *arguments]
                return _emit_call(context, builder, values[0], returns, declared, types_of, given)

            return returns(pointer, table, arguments), generate

        made: Callable[..., Any] = call
        return made


class Group:
    """A group of tables.  operations: those on them, by name."""

    def __init__(self) -> None:
        self.operations: dict[str, Operation] = {}

    def tables(self, of_all: Any) -> dict[int, Any]:
        """The tables in what kernels take in place of a link, by code."""
        raise NotImplementedError

    def _add(self, function: Callable[..., Any], rows: Sequence[Row]) -> Operation:
        number = len(self.operations) + 1
        operation = Operation(self, function, number, rows)
        where = f"{operation.module}.{operation.name}"
        if operation.name in self.operations:
            raise TypeError(f"{where}: an operation of this name exists; expected another name")
        if taken := _IN_TEXTS & {*operation.parameters}:
            raise TypeError(f"{where}: parameters {taken} have names of the generated text")
        if number >= STRIDE:
            raise TypeError(f"{where}: too many operations; expected at most {STRIDE - 1}")
        self.operations[operation.name] = operation
        return operation


class Linkable(Group):
    """Decorates kernels whose first argument is one table, or a link to it:

        geometries = Linkable()

        @geometries.operation
        def closest_hit(geometry: Geometry, ray: Ray) -> Hit: ...

    Given the table, the kernel is inlined; given a link, it is called through the link.
    """

    def tables(self, of_all: Any) -> dict[int, Any]:
        return {0: of_all}

    def operation(self, function: F) -> F:
        """Decorates an operation."""
        body = kernel(function)
        operation = self._add(function, [Row(0, "table", body)])
        first = parameters_of(function)[0]

        @functools.wraps(function)
        def choose(table: Any, *rest: Any) -> Any:
            return body(table, *rest)

        @overload_kernel(choose)
        def _compiled(table: Any, *rest: Any) -> Callable[..., Any]:
            return operation.through_link(first) if is_named_tuple(table, Link) else body

        Operation.of[choose] = operation
        return choose  # type: ignore[return-value]


class Linker:
    """Makes the links of a scene.  They are valid as long as the linker lives.

    callees: what it links, with the places of its function pointers.
    """

    def __init__(self, is_plain: bool = bool(numba.config.DISABLE_JIT)) -> None:
        """is_plain: for kernels that run as plain Python, which take the tables themselves."""
        self.callees: dict[Callee, list[tuple[Words, int]]] = {}
        self.nothing: Any = None if is_plain else Link(0)
        self._is_plain, self._kept = is_plain, list[Any]()

    @property
    def calls(self) -> list[tuple[Any, Any]]:
        """The entry kernels behind the links, with their signatures."""
        return [callee.call for callee in self.callees]

    @property
    def missing(self) -> list[tuple[Any, Any]]:
        """Those of `calls` that this process has not linked before."""
        return [callee.call for callee in self.callees if not callee.pointer]

    def link(
        self,
        group: Group,
        wanted: Iterable[str],
        of_all: Any,
        only: Mapping[str, Collection[int]] | None = None,
    ) -> Any:
        """A link to the tables of a group, with the operations `wanted`;  only: the codes of those
        tables that need an operation, where not all do.  Calls of other operations stop the
        process."""
        if self._is_plain:
            return of_all
        operations, tables = group.operations, group.tables(of_all)
        found = [operations[name] for name in wanted]
        codes = [code for operation in operations.values() for code in operation.rows]
        words = np.zeros(STRIDE * (max([*tables, *codes]) + 1), np.int64)
        for operation in operations.values():
            for code in operation.rows.keys() & tables.keys():
                words[STRIDE * code + operation.number] = NOT_LINKED
        for code, table in tables.items():
            content = np.array(words_of(table), np.int64)
            self._kept += [table, content]
            words[STRIDE * code] = content.ctypes.data
            of_table = type_of_table(table)
            for operation in found:
                if code in operation.rows and code in (only or {}).get(operation.name, tables):
                    callee = operation.callee_for(code, of_table)
                    place = words, STRIDE * code + operation.number
                    self.callees.setdefault(callee, []).append(place)
        self._kept.append(words)
        return Link(words.ctypes.data)

    def resolve(self) -> None:
        """Write the function pointers, once all calls are compiled."""
        for callee, places in self.callees.items():
            callee.pointer = callee.pointer or pointer_to(*callee.call)
            for words, k in places:
                words[k] = callee.pointer


@intrinsic  # type: ignore[untyped-decorator]
def stop(typing_context: Any) -> Any:
    """Stops the process: a wrong picture would be worse.  Only an operation that `Linker.link` was
    not asked for comes here."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        call_llvm(builder, "llvm.trap", ir.VoidType(), [])
        return nothing(context)

    return types.none(), generate


@kernel
def _no_link(link: Link) -> bool:
    return link.address == 0


@kernel
def _never(table: Any) -> bool:
    return False


def is_absent(table: Any) -> bool:
    """Whether there is no table: a link to nothing, or None in plain Python."""
    return table is None


@overload_kernel(is_absent)
def _is_absent(table: Any) -> Callable[..., bool]:
    return _no_link if is_named_tuple(table, Link) else _never
