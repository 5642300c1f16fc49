"""SIMD vectors: functions that run as vector instructions, as scalar code and as plain Python.

LLVM does not vectorise the loops over a node's boxes, a leaf's triangles or a block's rays by
itself.  Instead a generic function is traced: it is called while a kernel compiles, with
`SimdVector` operands, whose operators emit LLVM vector instructions.  With NumPy arrays of
VECTOR_WIDTH numbers, or with single numbers, the same function runs as it is.  Each operation
rounds once, by IEEE's rules, in the order written: all results have the same bits.  On processors
with narrower vectors LLVM splits the instructions.

A generic function has no branches.  It uses `select`, `smaller` and `larger` instead, the square
root and the other functions below, and &, | and `negated` for conditions; `only_where` for what few
lanes need.  `simd_kernel` makes such a function callable from kernels."""

import functools
import inspect
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from reference_rt.jit.kernel import kernel, overload_kernel
from reference_rt.jit.numba_codegen import call_llvm, data_of, nothing

VECTOR_WIDTH = 8
"""The vector width: eight float64 are one AVX-512 register."""

LANES = range(VECTOR_WIDTH)

TINY = 2.0**-1022
"""The smallest normal number: what generic functions divide by in place of 0."""

I32, I64 = ir.IntType(32), ir.IntType(64)
F64_VECTOR = ir.VectorType(ir.DoubleType(), VECTOR_WIDTH)


class Mask:
    """A condition of each lane: an LLVM vector of booleans."""

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def __and__(self, other: "Mask") -> "Mask":
        return Mask(self.builder, self.builder.and_(self.value, other.value))

    def __or__(self, other: "Mask") -> "Mask":
        return Mask(self.builder, self.builder.or_(self.value, other.value))

    def __invert__(self) -> "Mask":
        return Mask(self.builder, self.builder.not_(self.value))


def _arithmetic(
    instruction: str, is_reflected: bool = False
) -> Callable[["SimdVector", Any], "SimdVector"]:
    """The method of an operator: it emits `self` op `other`, or, reflected, `other` op `self`."""

    def emit(self: "SimdVector", other: Any) -> "SimdVector":
        a, b = self.value, self.of(other)
        if is_reflected:
            a, b = b, a
        return SimdVector(self.builder, getattr(self.builder, instruction)(a, b))

    return emit


class SimdVector:
    """A vector of VECTOR_WIDTH float64 in the code that is being generated."""

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def of(self, x: Any) -> ir.Value:
        """The LLVM value of `x`, a vector or a number that is the same in all lanes."""
        if isinstance(x, SimdVector):
            return x.value
        return ir.Constant(F64_VECTOR, [float(x)] * VECTOR_WIDTH)

    def call(self, name: str, *others: Any) -> "SimdVector":
        """Emit a call of an LLVM intrinsic."""
        values = [self.value, *map(self.of, others)]
        name = f"llvm.{name}.v{VECTOR_WIDTH}f64"
        return SimdVector(self.builder, call_llvm(self.builder, name, F64_VECTOR, values))

    def moved(self, by: int) -> "SimdVector":
        """A shuffle: lane k gets the number of lane k ^ by."""
        which = ir.Constant(ir.VectorType(I32, VECTOR_WIDTH), [lane ^ by for lane in LANES])
        undefined = ir.Constant(F64_VECTOR, ir.Undefined)
        return SimdVector(self.builder, self.builder.shuffle_vector(self.value, undefined, which))

    def lanes_where(self, chosen: Sequence[bool]) -> Mask:
        bits = ir.Constant(ir.VectorType(ir.IntType(1), VECTOR_WIDTH), chosen)
        return Mask(self.builder, bits)

    def compared(self, how: str, other: Any) -> Mask:
        return Mask(self.builder, self.builder.fcmp_ordered(how, self.value, self.of(other)))

    __add__, __mul__ = _arithmetic("fadd"), _arithmetic("fmul")
    __radd__, __rmul__ = __add__, __mul__
    __sub__, __rsub__ = _arithmetic("fsub"), _arithmetic("fsub", is_reflected=True)
    __truediv__, __rtruediv__ = _arithmetic("fdiv"), _arithmetic("fdiv", is_reflected=True)

    def __neg__(self) -> "SimdVector":
        return SimdVector(self.builder, self.builder.fneg(self.value))

    def __abs__(self) -> "SimdVector":
        return self.call("fabs")

    __lt__ = functools.partialmethod(compared, "<")
    __le__ = functools.partialmethod(compared, "<=")
    __gt__ = functools.partialmethod(compared, ">")
    __ge__ = functools.partialmethod(compared, ">=")


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` in lanes where the condition is true, else `b`."""
    if isinstance(condition, Mask):
        builder = condition.builder
        lanes = SimdVector(builder, condition.value)
        return SimdVector(builder, builder.select(condition.value, lanes.of(a), lanes.of(b)))
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    return a if condition else b


def lanes_where(chosen: Sequence[bool], x: Any) -> Any:
    """The condition that holds in the chosen lanes of the vector x."""
    return x.lanes_where(chosen) if isinstance(x, SimdVector) else np.array(chosen)


def negated(condition: Any) -> Any:
    return ~condition if isinstance(condition, Mask) else not condition


def only_where(function: Callable[..., Any]) -> Callable[..., Any]:
    """f(condition, otherwise, ...): function(...) in lanes where the condition holds, in others
    `otherwise`.  A branch: the function, generic itself, runs if any lane needs it.

    The function returns a number or a tuple of numbers, and `otherwise` is as many.
    """

    one = kernel(function)

    def chosen(condition: Any, otherwise: Any, *arguments: Any) -> Any:
        if isinstance(condition, Mask):
            return _in_some_lanes(condition, otherwise, function, arguments)
        return function(*arguments) if condition else otherwise

    def compiled(condition: Any, otherwise: Any, *arguments: Any) -> Any:
        return one(*arguments) if condition else otherwise

    _compiled_as(chosen, compiled)
    return chosen


def _in_some_lanes(
    condition: Mask, otherwise: Any, function: Callable[..., Any], arguments: Any
) -> Any:
    builder, word = condition.builder, ir.IntType(VECTOR_WIDTH)
    before = builder.block
    needed = builder.icmp_unsigned("!=", builder.bitcast(condition.value, word), word(0))
    with builder.if_then(needed):
        found = function(*arguments)
        end = builder.block
    lanes = SimdVector(builder, condition.value)
    merged = []
    for a, b in zip(_items(found), _items(otherwise), strict=True):
        value = builder.phi(F64_VECTOR)
        value.add_incoming(lanes.of(a), end)
        value.add_incoming(lanes.of(b), before)
        merged.append((SimdVector(builder, value), b))
    chosen = tuple(select(condition, a, b) for a, b in merged)
    return chosen if isinstance(found, tuple) else chosen[0]


def smaller(a: Any, b: Any) -> Any:
    """Python's min(a, b): `a` if either is NaN."""
    return select(b < a, b, a)


def larger(a: Any, b: Any) -> Any:
    """Python's max(a, b): `a` if either is NaN."""
    return select(b > a, b, a)


def least(x: Any) -> Any:
    """The minimum over the lanes, in every lane; none may be NaN."""
    if not isinstance(x, SimdVector):
        return np.full(VECTOR_WIDTH, np.min(x))
    for half in (4, 2, 1):
        x = smaller(x, x.moved(half))
    return x


def square_root(x: Any) -> Any:
    if isinstance(x, SimdVector):
        return x.call("sqrt")
    return np.sqrt(x) if isinstance(x, np.ndarray) else math.sqrt(x)


def with_sign(x: Any, sign: Any) -> Any:
    if isinstance(sign, SimdVector):
        return SimdVector(sign.builder, sign.of(x)).call("copysign", sign)
    return np.copysign(x, sign) if isinstance(x, np.ndarray) else math.copysign(x, sign)


def whole_part(x: Any) -> Any:
    """The largest whole number that is at most x."""
    if isinstance(x, SimdVector):
        return x.call("floor")
    return np.floor(x) if isinstance(x, np.ndarray) else float(math.floor(x))


def number_at(array: Any, i: Any, k: int) -> Any:
    """Number i + k of a C-contiguous array of float64, for a whole number i of each lane."""
    return array.gather(i, k) if hasattr(array, "gather") else array.item(int(i) + k)


def product_error(x: Any, y: Any, product: Any) -> Any:
    """The rounding error x y - product, exactly, for product = fl(x y).  Compiled it is one fused
    multiply-add; plain Python computes it in rational numbers."""
    if isinstance(x, SimdVector):
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
    """The fused multiply-add x y + z, rounded once."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.fma(*values)

    number = types.float64
    return number(number, number, number), generate


@intrinsic  # type: ignore[untyped-decorator]
def _number_at(typing_context: Any, array: Any, i: Any, k: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        at = builder.add(builder.fptosi(values[1], I64), values[2])
        return builder.load(builder.gep(data_of(context, builder, array, values[0]), [at]))

    return types.float64(array, types.float64, types.int64), generate


def _compiled_as(function: Callable[..., Any], one: Callable[..., Any]) -> None:
    """Compiled code calls `one` in place of `function`, with single numbers."""
    overload_kernel(function)(lambda *_: one)


_compiled_as(negated, lambda condition: not condition)
_compiled_as(select, lambda condition, a, b: a if condition else b)
_compiled_as(smaller, lambda a, b: b if b < a else a)
_compiled_as(larger, lambda a, b: b if b > a else a)
_compiled_as(square_root, lambda x: math.sqrt(x))
_compiled_as(with_sign, lambda x, sign: math.copysign(x, sign))
_compiled_as(whole_part, lambda x: np.floor(x))
_compiled_as(number_at, lambda array, i, k: _number_at(array, i, k))
_compiled_as(product_error, lambda x, y, product: _fused(x, y, -product))


def broadcast(builder: ir.IRBuilder, x: ir.Value, of: ir.Type = F64_VECTOR) -> ir.Value:
    """A vector with `x` in every lane."""
    undefined = ir.Constant(of, ir.Undefined)
    one = builder.insert_element(undefined, x, I32(0))
    which = ir.Constant(ir.VectorType(I32, VECTOR_WIDTH), [0] * VECTOR_WIDTH)
    return builder.shuffle_vector(one, undefined, which)


# ---- `simd_kernel` and `simd_lanes`: make generic functions callable from kernels ----------------


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

    def gather(self, i: SimdVector, k: int) -> SimdVector:
        builder, found = self.builder, ir.Constant(F64_VECTOR, ir.Undefined)
        whole = builder.fptosi(i.value, ir.VectorType(I64, VECTOR_WIDTH))
        for lane in LANES:
            at = builder.add(builder.extract_element(whole, I32(lane)), I64(k))
            one = builder.load(builder.gep(self.data, [at]))
            found = builder.insert_element(found, one, I32(lane))
        return SimdVector(builder, found)

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

    def gather(self, i: Any, k: int) -> Any:
        return self.flat[i.astype(np.int64) + k]

    def load_index(self, i: int) -> int:
        return int(self.flat[i])

    def store(self, start: int, lanes: Any) -> None:
        self.flat[start : start + VECTOR_WIDTH] = lanes


def _items(found: Any) -> tuple[Any, ...]:
    return found if isinstance(found, tuple) else (found,)


def _as_lanes(arguments: Any) -> list[Any]:
    """A SIMD kernel's arguments in plain Python: NumPy arrays of VECTOR_WIDTH numbers."""
    return [
        _PlainMemory(a)
        if isinstance(a, np.ndarray)
        else (np.full(VECTOR_WIDTH, a) if isinstance(a, float) else int(a))
        for a in arguments
    ]


def plain(function: Callable[..., Any]) -> Callable[..., int]:
    """A SIMD kernel as plain Python on NumPy arrays of VECTOR_WIDTH numbers."""

    @functools.wraps(function)
    def run(*arguments: Any) -> int:
        lanes = np.concatenate(_items(function(*_as_lanes(arguments))))
        return int.from_bytes(np.packbits(lanes, bitorder="little").tobytes(), "little")

    return run


def simd_kernel(function: Callable[..., Any]) -> Callable[..., int]:
    """Make a generic function callable from kernels.

    `function` returns a condition, or several.  The kernel returns them as a bit mask, one bit per
    lane; the first condition's bits are the lowest.  Arguments of `function`:

    - C-contiguous arrays of float64 or float32: load(i) is the vector of VECTOR_WIDTH numbers from
      number i on, everywhere(i) is number i in every lane, store(i, lanes) (float64 only) stores a
      vector, and `number_at` (float64 only) gathers one number for each lane;
    - C-contiguous arrays of uint32: load_index(i) is number i, an integer;
    - float64 numbers: the same number in every lane;
    - integers, which may be added and multiplied.
    """
    if numba.config.DISABLE_JIT:
        return plain(function)

    def bits_of(context: Any, builder: Any, found: Any) -> Any:
        bits = I64(0)
        for k, condition in enumerate(_items(found)):
            of_lanes = builder.bitcast(condition.value, ir.IntType(VECTOR_WIDTH))
            bits = builder.or_(
                bits, builder.shl(builder.zext(of_lanes, I64), I64(k * VECTOR_WIDTH))
            )
        return bits

    return _as_intrinsic(function, types.int64, bits_of)


def simd_lanes(function: Callable[..., Any]) -> Callable[..., tuple[float, ...]]:
    """The same for a generic function that returns a vector: the kernel returns a tuple of its
    VECTOR_WIDTH numbers."""
    if numba.config.DISABLE_JIT:

        @functools.wraps(function)
        def run(*arguments: Any) -> tuple[float, ...]:
            return tuple(function(*_as_lanes(arguments)).tolist())

        return run
    lanes = types.UniTuple(types.float64, VECTOR_WIDTH)

    def tuple_of(context: Any, builder: Any, found: Any) -> Any:
        numbers = [builder.extract_element(found.value, I32(k)) for k in range(VECTOR_WIDTH)]
        return context.make_tuple(builder, lanes, numbers)

    return _as_intrinsic(function, lanes, tuple_of)


def _as_intrinsic(function: Callable[..., Any], returns: Any, finish: Any) -> Callable[..., Any]:
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
            return finish(context, builder, function(*written))

        return returns(*map(_taken_as, arguments)), generate

    # Numba reads the number of arguments from the signature.
    names = ("typing_context", *inspect.signature(function).parameters)
    kind = inspect.Parameter.POSITIONAL_ONLY
    typed.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [inspect.Parameter(name, kind) for name in names]
    )
    made: Callable[..., Any] = intrinsic(typed)
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
