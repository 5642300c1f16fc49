"""Rays side by side: the plain kernels of shapes' distances, made into vector code.

The kernel `distance` of such a shape is one text for three uses: plain Python, compiled code for
one ray, and, called with `Lanes` in place of the ray's numbers, the writing of LLVM code for LANES
rays at once.  The operations are the same, in the same order, each rounded as IEEE says: the bits
are the same too.  LLVM makes narrower vectors of it for a processor that has no such wide ones.

Such a kernel has no branches.  Where it chooses, it calls `select`, `smaller` and `larger`; and the
square root and the sign are those below.
"""

import math
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from reference_rt.kernel import overload_kernel
from reference_rt.ray import BLOCK, Ray
from reference_rt.shapes.shape import LANES, FloatArray, IntArray
from reference_rt.vec3 import Vec3

_REALS = ir.VectorType(ir.DoubleType(), LANES)
_WORDS = ir.VectorType(ir.IntType(64), LANES)
_FIRST = ir.IntType(64)(0)


class Mask:
    """Which lanes fulfil a condition."""

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def __and__(self, other: "Mask") -> "Mask":
        return Mask(self.builder, self.builder.and_(self.value, other.value))


class Lanes:
    """A number in each lane, computed by code that is being written."""

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def of(self, x: Any) -> ir.Value:
        """The value of `x`: of lanes, or the same number in all."""
        return x.value if isinstance(x, Lanes) else ir.Constant(_REALS, [float(x)] * LANES)

    def call(self, name: str, *others: Any) -> "Lanes":
        """An instruction that LLVM writes as a function."""
        values = [self.value, *map(self.of, others)]
        of_type = ir.FunctionType(_REALS, [_REALS] * len(values))
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
    if not isinstance(condition, Mask):
        return a if condition else b
    builder = condition.builder
    lanes = Lanes(builder, condition.value)
    return Lanes(builder, builder.select(condition.value, lanes.of(a), lanes.of(b)))


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


def _compiled_as(function: Callable[..., Any], one: Callable[..., Any]) -> None:
    """What compiled code calls for numbers."""
    overload_kernel(function)(lambda *_: one)


_compiled_as(select, lambda condition, a, b: a if condition else b)
_compiled_as(smaller, lambda a, b: b if b < a else a)
_compiled_as(larger, lambda a, b: b if b > a else a)
_compiled_as(square_root, lambda x: math.sqrt(x))
_compiled_as(with_sign, lambda x, sign: math.copysign(x, sign))


class _Writer:
    """What the intrinsics below share."""

    def __init__(self, context: Any, builder: ir.IRBuilder) -> None:
        self.context, self.builder = context, builder

    def _place(self, array_type: Any, array: ir.Value, of: ir.Type, at: ir.Value) -> ir.Value:
        """Where item `at` of an array begins, as a pointer to `of`."""
        data = self.context.make_array(array_type)(self.context, self.builder, array).data
        return self.builder.bitcast(self.builder.gep(data, [at]), of.as_pointer())

    def load(self, array_type: Any, array: ir.Value, of: ir.Type, at: ir.Value = _FIRST) -> Any:
        return self.builder.load(self._place(array_type, array, of, at), align=8)

    def store(
        self, array_type: Any, array: ir.Value, value: ir.Value, at: ir.Value = _FIRST
    ) -> None:
        self.builder.store(value, self._place(array_type, array, value.type, at), align=8)

    def in_all_lanes(self, x: ir.Value, of: ir.Type) -> ir.Value:
        undefined = ir.Constant(of, ir.Undefined)
        one = self.builder.insert_element(undefined, x, ir.IntType(32)(0))
        which = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return self.builder.shuffle_vector(one, undefined, which)

    def lanes(self, value: ir.Value, *at: int) -> Lanes:
        """A number of a tuple, the same in all lanes."""
        number = self.builder.extract_value(value, at)
        return Lanes(self.builder, self.in_all_lanes(number, _REALS))

    def vector(self, value: ir.Value, k: int) -> Vec3:
        """Vector k of a tuple, the same in all lanes."""
        components: list[Any] = [self.lanes(value, k, axis) for axis in range(3)]
        return Vec3(*components)

    def column(self, array_type: Any, rays: ir.Value, column: int, at: ir.Value) -> Lanes:
        """A number of each of LANES rays."""
        place = self.builder.add(at, ir.IntType(64)(column * BLOCK))
        return Lanes(self.builder, self.load(array_type, rays, _REALS, place))


def nearer_by(distance: Callable[..., Any]) -> Callable[..., None]:
    """The kernel nearer(rays, at, shape, code, t, codes) of a `distance(ray, *shape)`.

    For each of LANES rays of `rays` (`streams.Rays.numbers`) from number `at` on: where the shape
    is nearer than t (LANES,), its distance there, and `code` into codes (LANES,).
    """
    if numba.config.DISABLE_JIT:
        return nearer_plainly(distance)

    @intrinsic  # type: ignore[untyped-decorator]
    def nearer(
        typing_context: Any, rays: Any, at: Any, shape: Any, code: Any, t: Any, codes: Any
    ) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            writer = _Writer(context, builder)
            rays_value, at_value, shape_value, code_value, t_value, codes_value = values
            numbers: list[Any] = [writer.column(rays, rays_value, k, at_value) for k in range(6)]
            arguments = [
                writer.vector(shape_value, k)
                if isinstance(part, types.BaseTuple)
                else writer.lanes(shape_value, k)
                for k, part in enumerate(shape)
            ]
            ray = Ray(Vec3(*numbers[:3]), Vec3(*numbers[3:]), math.inf)
            found = distance(ray, *arguments).value
            best = writer.load(t, t_value, _REALS)
            which = writer.load(codes, codes_value, _WORDS)
            is_nearer = builder.fcmp_ordered("<", found, best)
            own = writer.in_all_lanes(code_value, _WORDS)
            writer.store(t, t_value, builder.select(is_nearer, found, best))
            writer.store(codes, codes_value, builder.select(is_nearer, own, which))
            return context.get_dummy_value()

        number = types.int64
        return types.void(rays, number, shape, number, t, codes), generate

    made: Callable[..., None] = nearer
    return made


def nearer_plainly(distance: Callable[..., Any]) -> Callable[..., None]:
    """What `nearer_by` returns, as plain Python."""

    def nearer(
        rays: FloatArray, at: int, shape: Any, code: int, t: FloatArray, codes: IntArray
    ) -> None:
        for lane in range(LANES):
            x = [rays[k * BLOCK + at + lane] for k in range(6)]
            found = distance(Ray(Vec3(*x[:3]), Vec3(*x[3:]), math.inf), *shape)
            if found < t[lane]:
                t[lane], codes[lane] = found, code

    return nearer


def _begin(rays: FloatArray, at: int, t: FloatArray, codes: IntArray) -> None:
    """Nothing found by LANES rays from number `at` on: t their ends, codes -1."""
    t[:], codes[:] = rays[6 * BLOCK + at : 6 * BLOCK + at + LANES], -1


def _end(t: FloatArray, codes: IntArray, at: int, to: FloatArray, to_codes: IntArray) -> None:
    """What LANES rays have found, to where those from `at` on are kept."""
    to[at : at + LANES], to_codes[at : at + LANES] = t, codes


@intrinsic  # type: ignore[untyped-decorator]
def _begin_lanes(typing_context: Any, rays: Any, at: Any, t: Any, codes: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        writer = _Writer(context, builder)
        writer.store(t, values[2], writer.column(rays, values[0], 6, values[1]).value)
        writer.store(codes, values[3], ir.Constant(_WORDS, [-1] * LANES))
        return context.get_dummy_value()

    return types.void(rays, types.int64, t, codes), generate


@intrinsic  # type: ignore[untyped-decorator]
def _end_lanes(typing_context: Any, t: Any, codes: Any, at: Any, to: Any, to_codes: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        writer = _Writer(context, builder)
        writer.store(to, values[3], writer.load(t, values[0], _REALS), values[2])
        writer.store(to_codes, values[4], writer.load(codes, values[1], _WORDS), values[2])
        return context.get_dummy_value()

    return types.void(t, codes, types.int64, to, to_codes), generate


begin: Callable[..., None] = _begin if numba.config.DISABLE_JIT else _begin_lanes
end: Callable[..., None] = _end if numba.config.DISABLE_JIT else _end_lanes
