"""Numbers side by side: one text for plain Python, compiled code and vector code.

LLVM does not turn the loops over a node's boxes, a leaf's triangles or a block's rays into vector
instructions by itself.  A text that works on LANES numbers at once is called, while a kernel
compiles, with `Lanes`, whose operators write LLVM's vector operations; with NumPy's arrays of LANES
numbers, or with single numbers, the same text runs as it stands.  Each operation rounds once, by
IEEE's rules, in the order written: the results are the same bits.  Where the processor has no
vectors that wide LLVM uses narrower ones.

Such a text has no branches.  Where it chooses, it calls `select`, `smaller` and `larger`; the
square root and the sign are those below; conditions are joined by &, | and ~.
"""

import functools
import inspect
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from reference_rt.kernel import overload_kernel

LANES = 8
"""Numbers of a vector: eight float64 are one register of AVX-512."""

I32, I64 = ir.IntType(32), ir.IntType(64)
REALS = ir.VectorType(ir.DoubleType(), LANES)


class Mask:
    """Which lanes fulfil a condition."""

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def __and__(self, other: "Mask") -> "Mask":
        return Mask(self.builder, self.builder.and_(self.value, other.value))

    def __or__(self, other: "Mask") -> "Mask":
        return Mask(self.builder, self.builder.or_(self.value, other.value))

    def __invert__(self) -> "Mask":
        return Mask(self.builder, self.builder.not_(self.value))


class Lanes:
    """A number in each lane, computed by code that is being written."""

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def of(self, x: Any) -> ir.Value:
        """The value of `x`: of lanes, or the same number in all."""
        return x.value if isinstance(x, Lanes) else ir.Constant(REALS, [float(x)] * LANES)

    def call(self, name: str, *others: Any) -> "Lanes":
        """An instruction that LLVM writes as a function."""
        values = [self.value, *map(self.of, others)]
        of_type = ir.FunctionType(REALS, [REALS] * len(values))
        name = f"llvm.{name}.v{LANES}f64"
        function = cgutils.get_or_insert_function(self.builder.module, of_type, name)
        return Lanes(self.builder, self.builder.call(function, values))

    def compared(self, how: str, other: Any) -> Mask:
        return Mask(self.builder, self.builder.fcmp_ordered(how, self.value, self.of(other)))

    def __add__(self, other: Any) -> "Lanes":
        return Lanes(self.builder, self.builder.fadd(self.value, self.of(other)))

    def __sub__(self, other: Any) -> "Lanes":
        return Lanes(self.builder, self.builder.fsub(self.value, self.of(other)))

    def __rsub__(self, other: Any) -> "Lanes":
        return Lanes(self.builder, self.builder.fsub(self.of(other), self.value))

    def __mul__(self, other: Any) -> "Lanes":
        return Lanes(self.builder, self.builder.fmul(self.value, self.of(other)))

    def __truediv__(self, other: Any) -> "Lanes":
        return Lanes(self.builder, self.builder.fdiv(self.value, self.of(other)))

    def __rtruediv__(self, other: Any) -> "Lanes":
        return Lanes(self.builder, self.builder.fdiv(self.of(other), self.value))

    def __neg__(self) -> "Lanes":
        return Lanes(self.builder, self.builder.fneg(self.value))

    def __abs__(self) -> "Lanes":
        return self.call("fabs")

    def __lt__(self, other: Any) -> Mask:
        return self.compared("<", other)

    def __le__(self, other: Any) -> Mask:
        return self.compared("<=", other)

    def __gt__(self, other: Any) -> Mask:
        return self.compared(">", other)

    def __ge__(self, other: Any) -> Mask:
        return self.compared(">=", other)


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition is fulfilled, else `b`."""
    if isinstance(condition, Mask):
        builder = condition.builder
        lanes = Lanes(builder, condition.value)
        return Lanes(builder, builder.select(condition.value, lanes.of(a), lanes.of(b)))
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    return a if condition else b


def smaller(a: Any, b: Any) -> Any:
    """Python's min(a, b): `a` where they do not compare."""
    return select(b < a, b, a)


def larger(a: Any, b: Any) -> Any:
    """Python's max(a, b): `a` where they do not compare."""
    return select(b > a, b, a)


def square_root(x: Any) -> Any:
    return x.call("sqrt") if isinstance(x, Lanes) else math.sqrt(x)


def with_sign(x: Any, sign: Any) -> Any:
    return x.call("copysign", sign) if isinstance(x, Lanes) else math.copysign(x, sign)


def product_error(x: Any, y: Any, product: Any) -> Any:
    """x y - product, exactly, for product = fl(x y): one instruction on most processors, which
    rounds the difference alone ("fused multiply-add"), here in rational numbers."""
    if isinstance(x, Lanes):
        return x.call("fma", y, -product)
    if isinstance(x, np.ndarray):
        return np.vectorize(product_error, otypes=[np.float64])(x, y, product)
    if not (math.isfinite(x) and math.isfinite(y)):
        return math.nan
    if math.isinf(product):
        return -product
    return float(Fraction(x) * Fraction(y) - Fraction(product))


@intrinsic  # type: ignore[untyped-decorator]
def _fused(typing_context: Any, x: Any, y: Any, z: Any) -> Any:
    """x y + z, rounded once."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.fma(*values)

    number = types.float64
    return number(number, number, number), generate


def _compiled_as(function: Callable[..., Any], one: Callable[..., Any]) -> None:
    """What compiled code calls for single numbers."""
    overload_kernel(function)(lambda *_: one)


_compiled_as(select, lambda condition, a, b: a if condition else b)
_compiled_as(smaller, lambda a, b: b if b < a else a)
_compiled_as(larger, lambda a, b: b if b > a else a)
_compiled_as(square_root, lambda x: math.sqrt(x))
_compiled_as(with_sign, lambda x, sign: math.copysign(x, sign))
_compiled_as(product_error, lambda x, y, product: _fused(x, y, -product))


def in_all_lanes(builder: ir.IRBuilder, x: ir.Value, of: ir.Type = REALS) -> ir.Value:
    """A vector of one number."""
    undefined = ir.Constant(of, ir.Undefined)
    one = builder.insert_element(undefined, x, I32(0))
    which = ir.Constant(ir.VectorType(I32, LANES), [0] * LANES)
    return builder.shuffle_vector(one, undefined, which)


class _Index:
    """An integer of the code that is being written."""

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
    """An array of which LANES numbers are loaded and stored at once."""

    def __init__(self, builder: ir.IRBuilder, data: ir.Value, is_single: bool) -> None:
        self.builder, self.data, self.is_single = builder, data, is_single

    def load(self, start: Any) -> Lanes:
        of = ir.VectorType(ir.FloatType(), LANES) if self.is_single else REALS
        value = self.builder.load(self._place(start, of), align=4 if self.is_single else 8)
        return Lanes(self.builder, self.builder.fpext(value, REALS) if self.is_single else value)

    def store(self, start: Any, lanes: Lanes) -> None:
        self.builder.store(lanes.value, self._place(start, REALS), align=8)

    def _place(self, start: Any, of: ir.Type) -> ir.Value:
        at = start.value if isinstance(start, _Index) else I64(start)
        return self.builder.bitcast(self.builder.gep(self.data, [at]), of.as_pointer())


class _PlainMemory:
    def __init__(self, array: Any) -> None:
        self.flat = array.reshape(-1)

    def load(self, start: int) -> Any:
        return self.flat[start : start + LANES].astype(np.float64)

    def store(self, start: int, lanes: Any) -> None:
        self.flat[start : start + LANES] = lanes


def plain(function: Callable[..., Any]) -> Callable[..., int]:
    """A lane kernel as plain Python on NumPy's arrays."""

    @functools.wraps(function)
    def run(*arguments: Any) -> int:
        wrapped: list[Any] = [
            _PlainMemory(a)
            if isinstance(a, np.ndarray)
            else (np.full(LANES, a) if isinstance(a, float) else int(a))
            for a in arguments
        ]
        return int(np.packbits(function(*wrapped), bitorder="little")[0])

    return run


def lane_kernel(function: Callable[..., Any]) -> Callable[..., int]:
    """Let kernels call `function`, which returns the lanes that fulfil a condition, as bits.

    Its arguments are C-contiguous arrays of float64 or float32, with load(i) of LANES numbers from
    number i on and store(i, lanes) (float64 only); float64 numbers, which stand in every lane; and
    integers, which may be added and multiplied.
    """
    if numba.config.DISABLE_JIT:
        return plain(function)

    def typed(typing_context: Any, *arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            written: list[Any] = []
            for of, value in zip(signature.args, values, strict=True):
                if isinstance(of, types.Array):
                    data = context.make_array(of)(context, builder, value).data
                    written.append(_Memory(builder, data, of.dtype == types.float32))
                elif of == types.float64:
                    written.append(Lanes(builder, in_all_lanes(builder, value)))
                else:
                    written.append(_Index(builder, value))
            bits = builder.bitcast(function(*written).value, ir.IntType(LANES))
            return builder.zext(bits, I64)

        return types.int64(*map(_taken_as, arguments)), generate

    # Numba asks how many arguments there are.
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
        """The number of the lowest bit that is set (one must be)."""
        return int(bits & -bits).bit_length() - 1

    def prefetch(array: Any, start: int) -> None:
        """Ask for a number of an array, which will be read soon."""

else:

    @intrinsic  # type: ignore[untyped-decorator]
    def lowest(typing_context: Any, bits: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.cttz(values[0], ir.IntType(1)(1))

        return types.int64(types.int64), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def prefetch(typing_context: Any, array: Any, start: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            data = context.make_array(array)(context, builder, values[0]).data
            byte = ir.IntType(8).as_pointer()
            of_type = ir.FunctionType(ir.VoidType(), [byte, I32, I32, I32])
            function = builder.module.declare_intrinsic("llvm.prefetch", [byte], of_type)
            place = builder.bitcast(builder.gep(data, [values[1]]), byte)
            # To be read, kept in all caches, data.
            builder.call(function, [place, I32(0), I32(3), I32(1)])
            return context.get_dummy_value()

        return types.void(array, types.int64), generate
