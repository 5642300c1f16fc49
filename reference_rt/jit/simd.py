"""Numbers side by side: one text for plain Python, compiled code and vector code.

LLVM does not turn the loops over a node's boxes, a leaf's triangles or a block's rays into vector
instructions by itself.  A text that works on LANES numbers at once is called, while a kernel
compiles, with `Lanes`, whose operators write LLVM's vector operations; with NumPy's arrays of LANES
numbers, or with single numbers, the same text runs as it stands.  Each operation rounds once, by
IEEE's rules, in the order written: the results are the same bits.  Where the processor has no
vectors that wide LLVM uses narrower ones.

Such a text has no branches.  Where it chooses, it calls `select`, `smaller` and `larger`; the
square root and the sign are those below; conditions are joined by &, | and ~.  How kernels call it
is in `lane_kernels`.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from reference_rt.jit.kernel import overload_kernel

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

    def moved(self, by: int) -> "Lanes":
        """In each lane the number of that whose index differs in the bits of `by`."""
        which = ir.Constant(ir.VectorType(I32, LANES), [lane ^ by for lane in range(LANES)])
        undefined = ir.Constant(REALS, ir.Undefined)
        return Lanes(self.builder, self.builder.shuffle_vector(self.value, undefined, which))

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


def least(x: Any) -> Any:
    """The smallest of the lanes, of which none may be NaN, in all of them."""
    if not isinstance(x, Lanes):
        return np.full(LANES, np.min(x))
    for half in (4, 2, 1):
        x = smaller(x, x.moved(half))
    return x


def square_root(x: Any) -> Any:
    return x.call("sqrt") if isinstance(x, Lanes) else math.sqrt(x)


def with_sign(x: Any, sign: Any) -> Any:
    if isinstance(x, Lanes):
        return x.call("copysign", sign)
    return np.copysign(x, sign) if isinstance(x, np.ndarray) else math.copysign(x, sign)


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
