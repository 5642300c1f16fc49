"""`simd_kernel`: makes a generic function of `simd.py` callable from kernels."""

import functools
import inspect
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from reference_rt.jit.numba_codegen import data_of, nothing
from reference_rt.jit.simd import F64_VECTOR, I32, I64, VECTOR_WIDTH, SimdVector, broadcast


class _Index:
    """An integer in the code that is being generated."""

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def of(self, x: Any) -> ir.Value:
        return x.value if isinstance(x, _Index) else I64(x)

    def __add__(self, other: Any) -> "_Index":
        return _Index(self.builder, self.builder.add(self.value, self.of(other)))

    def __mul__(self, other: Any) -> "_Index":
        return _Index(self.builder, self.builder.mul(self.value, self.of(other)))

    def __rsub__(self, other: Any) -> "_Index":
        return _Index(self.builder, self.builder.sub(self.of(other), self.value))

    __radd__, __rmul__ = __add__, __mul__


class _Memory:
    """An array in the code that is being generated: loads and stores of vectors."""

    def __init__(self, builder: ir.IRBuilder, data: ir.Value, is_single: bool) -> None:
        self.builder, self.data, self.is_single = builder, data, is_single

    def load(self, start: Any) -> SimdVector:
        of = ir.VectorType(ir.FloatType(), VECTOR_WIDTH) if self.is_single else F64_VECTOR
        value = self.builder.load(self._place(start, of), align=4 if self.is_single else 8)
        return SimdVector(
            self.builder, self.builder.fpext(value, F64_VECTOR) if self.is_single else value
        )

    def everywhere(self, i: Any) -> SimdVector:
        value = self.builder.load(self._place(i, ir.DoubleType()))
        return SimdVector(self.builder, broadcast(self.builder, value))

    def load_index(self, i: Any) -> _Index:
        value = self.builder.load(self._place(i, I32))
        return _Index(self.builder, self.builder.zext(value, I64))

    def store(self, start: Any, lanes: SimdVector) -> None:
        self.builder.store(lanes.value, self._place(start, F64_VECTOR), align=8)

    def _place(self, start: Any, of: ir.Type) -> ir.Value:
        at = start.value if isinstance(start, _Index) else I64(start)
        return self.builder.bitcast(self.builder.gep(self.data, [at]), of.as_pointer())


class _PlainMemory:
    def __init__(self, array: Any) -> None:
        self.flat = array.reshape(-1)

    def load(self, start: int) -> Any:
        return self.flat[start : start + VECTOR_WIDTH].astype(np.float64)

    def everywhere(self, i: int) -> Any:
        return np.full(VECTOR_WIDTH, self.flat[i])

    def load_index(self, i: int) -> int:
        return int(self.flat[i])

    def store(self, start: int, lanes: Any) -> None:
        self.flat[start : start + VECTOR_WIDTH] = lanes


def _conditions(found: Any) -> tuple[Any, ...]:
    return found if isinstance(found, tuple) else (found,)


def plain(function: Callable[..., Any]) -> Callable[..., int]:
    """A SIMD kernel as plain Python on NumPy arrays of VECTOR_WIDTH numbers."""

    @functools.wraps(function)
    def run(*arguments: Any) -> int:
        wrapped: list[Any] = [
            _PlainMemory(a)
            if isinstance(a, np.ndarray)
            else (np.full(VECTOR_WIDTH, a) if isinstance(a, float) else int(a))
            for a in arguments
        ]
        lanes = np.concatenate(_conditions(function(*wrapped)))
        return int.from_bytes(np.packbits(lanes, bitorder="little").tobytes(), "little")

    return run


def simd_kernel(function: Callable[..., Any]) -> Callable[..., int]:
    """Make a generic function callable from kernels.

    `function` returns a condition, or several.  The kernel returns them as a bit mask, one bit per
    lane; the first condition's bits are the lowest.  Arguments of `function`:

    - C-contiguous arrays of float64 or float32: load(i) is the vector of VECTOR_WIDTH numbers from
      number i on, everywhere(i) is number i in every lane, store(i, lanes) (float64 only) stores a
      vector;
    - C-contiguous arrays of uint32: load_index(i) is number i, an integer;
    - float64 numbers: the same number in every lane;
    - integers, which may be added and multiplied.
    """
    if numba.config.DISABLE_JIT:
        return plain(function)

    def typed(typing_context: Any, *arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            written: list[Any] = []
            for of, value in zip(signature.args, values, strict=True):
                if isinstance(of, types.Array):
                    data = data_of(context, builder, of, value)
                    written.append(_Memory(builder, data, of.dtype == types.float32))
                elif of == types.float64:
                    written.append(SimdVector(builder, broadcast(builder, value)))
                else:
                    written.append(_Index(builder, value))
            bits = I64(0)
            for k, condition in enumerate(_conditions(function(*written))):
                of_lanes = builder.bitcast(condition.value, ir.IntType(VECTOR_WIDTH))
                bits = builder.or_(
                    bits, builder.shl(builder.zext(of_lanes, I64), I64(k * VECTOR_WIDTH))
                )
            return bits

        return types.int64(*map(_taken_as, arguments)), generate

    # Numba reads the number of arguments from the signature.
    names = ("typing_context", *inspect.signature(function).parameters)
    kind = inspect.Parameter.POSITIONAL_ONLY
    typed.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [inspect.Parameter(name, kind) for name in names]
    )
    made: Callable[..., int] = intrinsic(typed)
    return made


def _taken_as(of: Any) -> Any:
    if isinstance(of, types.Array):
        return of
    return types.float64 if isinstance(of, types.Float) else types.int64


if numba.config.DISABLE_JIT:

    def lowest(bits: int) -> int:
        """The index of the lowest set bit; at least one must be set."""
        return int(bits & -bits).bit_length() - 1

    def prefetch(array: Any, start: int) -> None:
        """Prefetch a number of an array, which will be read soon, into the cache."""

else:

    @intrinsic  # type: ignore[untyped-decorator]
    def lowest(typing_context: Any, bits: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.cttz(values[0], ir.IntType(1)(1))

        return types.int64(types.int64), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def prefetch(typing_context: Any, array: Any, start: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            data = data_of(context, builder, array, values[0])
            byte = ir.IntType(8).as_pointer()
            of_type = ir.FunctionType(ir.VoidType(), [byte, I32, I32, I32])
            function = builder.module.declare_intrinsic("llvm.prefetch", [byte], of_type)
            place = builder.bitcast(builder.gep(data, [values[1]]), byte)
            # For reading, in all cache levels, data not instructions.
            builder.call(function, [place, I32(0), I32(3), I32(1)])
            return nothing(context)

        return types.void(array, types.int64), generate
