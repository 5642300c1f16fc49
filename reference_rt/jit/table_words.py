"""The content of a table in memory, as code reads it that knows the table's type.

`words_of` writes it, `table_at` reads it.

A word has eight bytes.  A number is one word; an array is its address and its shape, a word each; a
tuple is its parts one after another; None has no words.
"""

import struct
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from reference_rt.jit.numba_codegen import array_at, nothing

_WORD, _REAL = ir.IntType(64), ir.DoubleType()

_types: dict[Any, Any] = {}
"""Numba's types of tables, by `_kind`."""


def type_of_table(table: Any) -> Any:
    """`numba.typeof`, which takes up to 1 ms for a table; once for all tables of a kind."""
    kind = _kind(table)
    if kind not in _types:
        _types[kind] = numba.typeof(table)
    return _types[kind]


def _kind(value: Any) -> Any:
    """What Numba's type of a part of a table depends on: of an array the type and number of its
    indices and how it lies in memory, of a number its class and whether 63 bits hold it."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num
    if isinstance(value, tuple):
        return type(value), *map(_kind, value)
    if isinstance(value, int):
        return type(value), value.bit_length() < 64
    return type(value)


def words_of(value: Any) -> list[int]:
    """The words of a table.  They hold addresses of its arrays, which must outlive them.  Raises
    TypeError for an array that is not C-contiguous, and for what has no words."""
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
    if isinstance(value, bool | np.bool_ | int | np.int64):
        return [int(value)]
    raise TypeError(f"a table holds a {type(value).__name__}; expected numbers, arrays and tuples")


@intrinsic  # type: ignore[untyped-decorator]
def table_at(typing_context: Any, pointer: Any) -> Any:
    """The table whose words begin at a pointer."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        start = builder.bitcast(values[0], _WORD.as_pointer())
        return _Reader(context, builder, start).value(pointer.dtype)

    return pointer.dtype(pointer), generate


@intrinsic  # type: ignore[untyped-decorator]
def word_at(typing_context: Any, address: Any, k: Any) -> Any:
    """Word k from an address on."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        start = builder.inttoptr(values[0], _WORD.as_pointer())
        return builder.load(builder.gep(start, [values[1]]))

    return types.int64(types.int64, types.int64), generate


class _Reader:
    """Emits the code that reads words one after another."""

    def __init__(self, context: Any, builder: Any, start: Any) -> None:
        self.context, self.builder, self.start, self.at = context, builder, start, 0

    def word(self, of: ir.Type = _WORD) -> Any:
        place = self.builder.gep(self.start, [_WORD(self.at)])
        self.at += 1
        return self.builder.load(self.builder.bitcast(place, of.as_pointer()))

    def value(self, numba_type: Any) -> Any:
        context, builder = self.context, self.builder
        if isinstance(numba_type, types.NoneType):
            return nothing(context)
        if isinstance(numba_type, types.BaseTuple):
            parts = [self.value(part) for part in numba_type.types]
            return context.make_tuple(builder, numba_type, parts)
        if isinstance(numba_type, types.Array):
            return self._array(numba_type)
        if numba_type == types.float64:
            return self.word(_REAL)
        if numba_type == types.boolean:
            return builder.icmp_signed("!=", self.word(), _WORD(0))
        if numba_type == types.int64:
            return self.word()
        raise TypeError(f"{numba_type}: no words")

    def _array(self, numba_type: Any) -> Any:
        data = self.word(self.context.get_data_type(numba_type.dtype).as_pointer())
        shape = [self.word() for _ in range(numba_type.ndim)]
        return array_at(self.context, self.builder, numba_type, data, shape)
