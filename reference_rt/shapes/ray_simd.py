"""A block of rays against one shape, VECTOR_WIDTH rays at a time, as vector instructions.

The shape's kernel `distance` is a generic function (`jit/simd.py`): it runs for one ray, and for
VECTOR_WIDTH rays at once.
"""

import math
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import BLOCK, Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.numba_codegen import data_of, nothing
from reference_rt.jit.simd import F64_VECTOR, I64, VECTOR_WIDTH, SimdVector, broadcast

_WORDS = ir.VectorType(I64, VECTOR_WIDTH)
_FIRST = I64(0)


class _Writer:
    """Loads, stores and broadcasts that the intrinsics below emit."""

    def __init__(self, context: Any, builder: ir.IRBuilder) -> None:
        self.context, self.builder = context, builder

    def _place(self, array_type: Any, array: ir.Value, of: ir.Type, at: ir.Value) -> ir.Value:
        """A pointer to item `at` of an array, of type `of`."""
        data = data_of(self.context, self.builder, array_type, array)
        return self.builder.bitcast(self.builder.gep(data, [at]), of.as_pointer())

    def load(self, array_type: Any, array: ir.Value, of: ir.Type, at: ir.Value = _FIRST) -> Any:
        return self.builder.load(self._place(array_type, array, of, at), align=8)

    def store(
        self, array_type: Any, array: ir.Value, value: ir.Value, at: ir.Value = _FIRST
    ) -> None:
        self.builder.store(value, self._place(array_type, array, value.type, at), align=8)

    def lanes(self, value: ir.Value, *at: int) -> SimdVector:
        """A number of a tuple, in every lane."""
        number = self.builder.extract_value(value, at)
        return SimdVector(self.builder, broadcast(self.builder, number))

    def tuple_of(self, value: ir.Value, k: int, of: Any) -> Any:
        """Item k of a tuple, a tuple of numbers itself such as a `Vec3`, in every lane."""
        numbers = [self.lanes(value, k, place) for place in range(len(of))]
        return of.instance_class(*numbers) if hasattr(of, "instance_class") else numbers

    def column(self, array_type: Any, rays: ir.Value, column: int, at: ir.Value) -> SimdVector:
        """One component (see `RayBlock.numbers`) of VECTOR_WIDTH rays."""
        place = self.builder.add(at, I64(column * BLOCK))
        return SimdVector(self.builder, self.load(array_type, rays, F64_VECTOR, place))


def make_nearer(distance: Callable[..., Any]) -> Callable[..., None]:
    """The kernel nearer(rays, at, shape, code, t, codes) of a `distance(ray, *shape)`.

    It tests VECTOR_WIDTH rays, from number `at` on, of `rays` (`RayBlock.numbers`) against a shape.
    For each that meets the shape before t (VECTOR_WIDTH,), it writes the distance to t and `code`
    to codes (VECTOR_WIDTH,).
    """
    if numba.config.DISABLE_JIT:
        return make_plain_nearer(distance)

    @intrinsic  # type: ignore[untyped-decorator]
    def nearer(
        typing_context: Any, rays: Any, at: Any, shape: Any, code: Any, t: Any, codes: Any
    ) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            writer = _Writer(context, builder)
            rays_value, at_value, shape_value, code_value, t_value, codes_value = values
            numbers: list[Any] = [writer.column(rays, rays_value, k, at_value) for k in range(6)]
            arguments = [
                writer.tuple_of(shape_value, k, part)
                if isinstance(part, types.BaseTuple)
                else writer.lanes(shape_value, k)
                for k, part in enumerate(shape)
            ]
            ray = Ray(Vec3(*numbers[:3]), Vec3(*numbers[3:]), math.inf)
            found = distance(ray, *arguments).value
            best = writer.load(t, t_value, F64_VECTOR)
            which = writer.load(codes, codes_value, _WORDS)
            is_nearer = builder.fcmp_ordered("<", found, best)
            own = broadcast(builder, code_value, _WORDS)
            writer.store(t, t_value, builder.select(is_nearer, found, best))
            writer.store(codes, codes_value, builder.select(is_nearer, own, which))
            return nothing(context)

        number = types.int64
        return types.void(rays, number, shape, number, t, codes), generate

    made: Callable[..., None] = nearer
    return made


def make_plain_nearer(distance: Callable[..., Any]) -> Callable[..., None]:
    """The kernel that `make_nearer` returns, as plain Python."""

    def nearer(
        rays: FloatArray, at: int, shape: Any, code: int, t: FloatArray, codes: IntArray
    ) -> None:
        for lane in range(VECTOR_WIDTH):
            x = [rays[k * BLOCK + at + lane] for k in range(6)]
            found = distance(Ray(Vec3(*x[:3]), Vec3(*x[3:]), math.inf), *shape)
            if found < t[lane]:
                t[lane], codes[lane] = found, code

    return nearer


def _load(
    from_t: FloatArray, from_codes: IntArray, at: int, t: FloatArray, codes: IntArray
) -> None:
    """Load the results so far of VECTOR_WIDTH rays from number `at` on."""
    t[:], codes[:] = from_t[at : at + VECTOR_WIDTH], from_codes[at : at + VECTOR_WIDTH]


def _store(t: FloatArray, codes: IntArray, at: int, to: FloatArray, to_codes: IntArray) -> None:
    """Store t and codes of VECTOR_WIDTH rays to the results of the rays from number `at` on."""
    to[at : at + VECTOR_WIDTH], to_codes[at : at + VECTOR_WIDTH] = t, codes


@intrinsic  # type: ignore[untyped-decorator]
def _load_lanes(
    typing_context: Any, from_t: Any, from_codes: Any, at: Any, t: Any, codes: Any
) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        writer = _Writer(context, builder)
        found = writer.load(from_t, values[0], F64_VECTOR, values[2])
        writer.store(t, values[3], found)
        writer.store(codes, values[4], writer.load(from_codes, values[1], _WORDS, values[2]))
        return nothing(context)

    return types.void(from_t, from_codes, types.int64, t, codes), generate


@intrinsic  # type: ignore[untyped-decorator]
def _store_lanes(typing_context: Any, t: Any, codes: Any, at: Any, to: Any, to_codes: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        writer = _Writer(context, builder)
        writer.store(to, values[3], writer.load(t, values[0], F64_VECTOR), values[2])
        writer.store(to_codes, values[4], writer.load(codes, values[1], _WORDS), values[2])
        return nothing(context)

    return types.void(t, codes, types.int64, to, to_codes), generate


load: Callable[..., None] = _load if numba.config.DISABLE_JIT else _load_lanes
store: Callable[..., None] = _store if numba.config.DISABLE_JIT else _store_lanes
