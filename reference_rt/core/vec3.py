"""`Vec3`: a point, a direction, a normal or an RGB triple, with the usual vector operators."""

import math
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from reference_rt.jit.kernel import is_named_tuple, kernel, overload_kernel
from reference_rt.jit.simd import larger


class Vec3(NamedTuple):
    """Three float64 components.  `a * b` of two vectors is componentwise (colours)."""

    x: float
    y: float
    z: float

    def __add__(self, other: "Vec3") -> "Vec3":  # type: ignore[override]
        return Vec3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: "Vec3") -> "Vec3":
        return Vec3(self.x - other.x, self.y - other.y, self.z - other.z)

    def __neg__(self) -> "Vec3":
        return Vec3(-self.x, -self.y, -self.z)

    def __mul__(self, other: Any) -> "Vec3":
        if isinstance(other, Vec3):
            return _times_vec3(self, other)
        return _times_scalar(self, other)

    def __truediv__(self, other: float) -> "Vec3":
        return Vec3(self.x / other, self.y / other, self.z / other)


def _times_vec3(self: Vec3, other: Vec3) -> Vec3:
    return Vec3(self.x * other.x, self.y * other.y, self.z * other.z)


def _times_scalar(self: Vec3, other: float) -> Vec3:
    return Vec3(self.x * other, self.y * other, self.z * other)


def _compile_operator(symbols: tuple[Callable[..., Any], ...], scalar: Any, vector: Any) -> None:
    """Overloads the operators `symbols` for Vec3 in compiled code, with the functions that Python
    runs."""
    for symbol in symbols:

        @overload_kernel(symbol)
        def _implementation(self: Any, other: Any) -> Any:
            if not is_named_tuple(self, Vec3):
                return None
            if is_named_tuple(other, Vec3):
                return vector
            return scalar if isinstance(other, types.Number) else None


_compile_operator((operator.add, operator.iadd), None, Vec3.__add__)
_compile_operator((operator.sub, operator.isub), None, Vec3.__sub__)
_compile_operator((operator.mul, operator.imul), _times_scalar, _times_vec3)
_compile_operator((operator.truediv, operator.itruediv), Vec3.__truediv__, None)


@overload_kernel(operator.neg)
def _negative(self: Any) -> Any:
    return Vec3.__neg__ if is_named_tuple(self, Vec3) else None


@kernel
def row(array: Any, i: int) -> Vec3:
    """Row `i` of an (n, 3) array.

    The index is unsigned: for signed ones each access tests for negative indices, which count from
    the end (measured: 4 % of the Cornell box).
    """
    k = np.uint64(i)
    return Vec3(array[k, 0], array[k, 1], array[k, 2])


@kernel
def triple(array: Any, i: int, k: int) -> Vec3:
    """Vector k, 0 to 2, of the three in row `i` of an (n, 9) array."""
    r = np.uint64(i)
    return Vec3(array[r, 3 * k], array[r, 3 * k + 1], array[r, 3 * k + 2])


@kernel
def component(a: Vec3, axis: int) -> float:
    """The x, y or z of `a` for axis 0, 1 or 2."""
    if axis == 0:
        return a.x
    if axis == 1:
        return a.y
    return a.z


@kernel
def dot(a: Vec3, b: Vec3) -> float:
    return a.x * b.x + a.y * b.y + a.z * b.z


@kernel
def cross(a: Vec3, b: Vec3) -> Vec3:
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@kernel
def length(a: Vec3) -> float:
    return math.sqrt(dot(a, a))


@kernel
def normalize(a: Vec3) -> Vec3:
    """The unit vector along `a`, which must not be zero."""
    return a * (1.0 / length(a))


@kernel
def max_abs(a: Vec3) -> float:
    """The largest magnitude of a component: the infinity norm."""
    largest: float = larger(abs(a.x), larger(abs(a.y), abs(a.z)))
    return largest


@kernel
def is_finite(a: Vec3) -> bool:
    return a.x - a.x == 0.0 and a.y - a.y == 0.0 and a.z - a.z == 0.0


@kernel
def max_component(a: Vec3) -> float:
    return max(a.x, max(a.y, a.z))


@kernel
def luminance(a: Vec3) -> float:
    """The luminance of a linear sRGB colour (Y of IEC 61966-2-1)."""
    return 0.2126 * a.x + 0.7152 * a.y + 0.0722 * a.z


@kernel
def is_black(a: Vec3) -> bool:
    return a.x == 0.0 and a.y == 0.0 and a.z == 0.0


@kernel
def reflect(wo: Vec3, n: Vec3) -> Vec3:
    """The mirror direction of `wo` about the unit normal; both point away: 2 (wo·n) n - wo."""
    return n * (2.0 * dot(wo, n)) - wo


class Frame(NamedTuple):
    """An orthonormal basis: `s`, `t`, and `n` as its z axis."""

    s: Vec3
    t: Vec3
    n: Vec3


@kernel
def frame_from_normal(n: Vec3) -> Frame:
    """A basis around a unit normal (Duff et al. 2017, "Building an Orthonormal Basis,
    Revisited")."""
    sign = math.copysign(1.0, n.z)
    a = -1.0 / (sign + n.z)
    b = n.x * n.y * a
    return Frame(
        Vec3(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vec3(b, sign + n.y * n.y * a, -n.y),
        n,
    )


@kernel
def to_world(frame: Frame, v: Vec3) -> Vec3:
    """`v` from the frame's coordinates to the world's."""
    return frame.s * v.x + frame.t * v.y + frame.n * v.z


@kernel
def to_local(frame: Frame, v: Vec3) -> Vec3:
    """`v` from the world's coordinates to the frame's."""
    return Vec3(dot(v, frame.s), dot(v, frame.t), dot(v, frame.n))
