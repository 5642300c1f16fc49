"""`lane_kernel`: one text for eight numbers at once, as vector code and as plain Python.

LLVM does not turn the loops over a node's boxes or a leaf's triangles into vector instructions by
itself.  A lane kernel is written with `larger`, `smaller`, `both`, `either`, comparisons and the
operators + - * on values of LANES float64 lanes; called while a kernel compiles, its text emits
LLVM's vector operations, and with ``NUMBA_DISABLE_JIT=1`` it runs on NumPy arrays of LANES numbers.
Each operation rounds once, by IEEE's rules, in the order written: the results are the same bits.
Where the processor has no vectors that wide LLVM uses narrower ones.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LANES = 8

_F64, _I32, _I64 = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
_VECTOR = ir.VectorType(_F64, LANES)
_FIRST = ir.Constant(ir.VectorType(_I32, LANES), [0] * LANES)


class Emitted:
    """A value of the code that is being made: lanes of float64 or of truth, or one integer."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def __add__(self, other: Any) -> "Emitted":
        return self._operation("add", other)

    def __sub__(self, other: Any) -> "Emitted":
        return self._operation("sub", other)

    def __mul__(self, other: Any) -> "Emitted":
        return self._operation("mul", other)

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, other: Any) -> "Emitted":
        return self._like(other)._operation("sub", self)

    def __ge__(self, other: Any) -> "Emitted":
        return self._comparison(">=", other)

    def __le__(self, other: Any) -> "Emitted":
        return self._comparison("<=", other)

    def __gt__(self, other: Any) -> "Emitted":
        return self._comparison(">", other)

    def __lt__(self, other: Any) -> "Emitted":
        return self._comparison("<", other)

    def _operation(self, name: str, other: Any) -> "Emitted":
        integer = isinstance(self.value.type, ir.IntType)
        emit = getattr(self.builder, name if integer else "f" + name)
        return Emitted(self.builder, emit(self.value, self._like(other).value))

    def _comparison(self, sign: str, other: Any) -> "Emitted":
        emitted = self.builder.fcmp_ordered(sign, self.value, self._like(other).value)
        return Emitted(self.builder, emitted)

    def _like(self, other: Any) -> "Emitted":
        """`other`, where it is a number of Python: an integer, or the same in all lanes."""
        if isinstance(other, Emitted):
            return other
        if isinstance(self.value.type, ir.IntType):
            return Emitted(self.builder, ir.Constant(_I64, int(other)))
        return Emitted(self.builder, ir.Constant(_VECTOR, [float(other)] * LANES))


class _EmittedMemory:
    """An array whose elements are loaded and stored LANES at a time."""

    def __init__(self, builder: Any, data: Any, is_single: bool) -> None:
        self.builder, self.data, self.is_single = builder, data, is_single

    def load(self, start: Any) -> Emitted:
        element = ir.FloatType() if self.is_single else _F64
        value = self.builder.load(self._at(start, element))
        value.align = 4 if self.is_single else 8
        return Emitted(
            self.builder, self.builder.fpext(value, _VECTOR) if self.is_single else value
        )

    def store(self, start: Any, lanes: Emitted) -> None:
        stored = self.builder.store(lanes.value, self._at(start, _F64))
        stored.align = 8

    def _at(self, start: Any, element: Any) -> Any:
        offset = start.value if isinstance(start, Emitted) else ir.Constant(_I64, start)
        pointer = self.builder.gep(self.data, [offset])
        return self.builder.bitcast(pointer, ir.PointerType(ir.VectorType(element, LANES)))


class _PlainMemory:
    def __init__(self, array: Any) -> None:
        self.flat = array.reshape(-1)

    def load(self, start: int) -> Any:
        return self.flat[start : start + LANES].astype(np.float64)

    def store(self, start: int, lanes: Any) -> None:
        self.flat[start : start + LANES] = lanes


def larger(a: Any, b: Any) -> Any:
    """In each lane a where a > b, else b: where one is NaN, b."""
    return _chosen(a > b, a, b)


def smaller(a: Any, b: Any) -> Any:
    """In each lane a where a < b, else b: where one is NaN, b."""
    return _chosen(a < b, a, b)


def both(a: Any, b: Any) -> Any:
    """The lanes in which both are true."""
    if isinstance(a, Emitted):
        return Emitted(a.builder, a.builder.and_(a.value, b.value))
    return a & b


def either(a: Any, b: Any) -> Any:
    """The lanes in which one is true."""
    if isinstance(a, Emitted):
        return Emitted(a.builder, a.builder.or_(a.value, b.value))
    return a | b


def opposite(a: Any) -> Any:
    """The lanes in which it is false."""
    if isinstance(a, Emitted):
        return Emitted(a.builder, a.builder.not_(a.value))
    return ~a


def _chosen(condition: Any, a: Any, b: Any) -> Any:
    if isinstance(condition, Emitted):
        like = condition.builder
        of = a if isinstance(a, Emitted) else b
        values = (of._like(a).value, of._like(b).value)
        return Emitted(like, like.select(condition.value, *values))
    return np.where(condition, a, b)


def plain(function: Callable[..., Any]) -> Callable[..., int]:
    """A lane kernel as plain Python on NumPy's arrays."""

    @functools.wraps(function)
    def run(*arguments: Any) -> int:
        wrapped = (
            _PlainMemory(a)
            if isinstance(a, np.ndarray)
            else (np.full(LANES, a) if isinstance(a, float) else int(a))
            for a in arguments
        )
        lanes = function(*wrapped)
        return int(np.packbits(lanes, bitorder="little")[0])

    return run


def _emitted_argument(context: Any, builder: Any, numba_type: Any, value: Any) -> Any:
    if isinstance(numba_type, types.Array):
        data = context.make_array(numba_type)(context, builder, value).data
        return _EmittedMemory(builder, data, numba_type.dtype == types.float32)
    if isinstance(numba_type, types.Float):
        one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, _I32(0))
        everywhere = builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), _FIRST)
        return Emitted(builder, everywhere)
    return Emitted(builder, value)


def lane_kernel(function: Callable[..., Any]) -> Callable[..., int]:
    """Let kernels call `function`, which returns the lanes where something is true, as bits.

    Its arguments are C-contiguous arrays of float64 or float32, of which it loads LANES numbers
    from an index into all elements, and stores (float64 only); float64 numbers, which stand in
    every lane; and integers.
    """
    if numba.config.DISABLE_JIT:
        return plain(function)

    def typed(typing_context: Any, *arguments: Any) -> Any:
        taken = tuple(
            a
            if isinstance(a, types.Array)
            else (types.float64 if isinstance(a, types.Float) else types.int64)
            for a in arguments
        )

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            emitted = [
                _emitted_argument(context, builder, t, v)
                for t, v in zip(signature.args, values, strict=True)
            ]
            lanes = function(*emitted)
            bits = builder.bitcast(lanes.value, ir.IntType(LANES))
            return builder.zext(bits, _I64)

        return types.int64(*taken), generate

    # Numba asks how many arguments there are.
    names = list(inspect.signature(function).parameters)
    parameters = [
        inspect.Parameter(name, inspect.Parameter.POSITIONAL_ONLY)
        for name in ("typing_context", *names)
    ]
    typed.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    emitted_kernel: Callable[..., int] = intrinsic(typed)
    return emitted_kernel


if numba.config.DISABLE_JIT:

    def lowest(bits: int) -> int:
        """The number of the lowest bit that is set (one must be)."""
        return (bits & -bits).bit_length() - 1

    def prefetch(array: Any, start: int) -> None:
        """Ask for an array's element from memory, as it will be read soon."""

else:

    @intrinsic  # type: ignore[untyped-decorator]
    def lowest(typing_context: Any, bits: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

        return types.int64(types.int64), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def prefetch(typing_context: Any, array: Any, start: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            byte = ir.PointerType(ir.IntType(8))
            pointer = builder.bitcast(builder.gep(data, [arguments[1]]), byte)
            kind = ir.FunctionType(ir.VoidType(), [byte, _I32, _I32, _I32])
            function = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
            # For reading, to be kept in all caches, data.
            builder.call(function, [pointer, _I32(0), _I32(3), _I32(1)])
            return context.get_dummy_value()

        return types.void(array, types.int64), generate
