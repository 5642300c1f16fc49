"""Exact arithmetic on arrays of dyadic rationals: floats are integers times powers of two."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Integers = npt.NDArray[np.object_]
BoolArray = npt.NDArray[np.bool_]

_bits = np.frompyfunc(lambda n: n.bit_length(), 1, 1)
_root = np.frompyfunc(math.isqrt, 1, 1)
_shifted = np.frompyfunc(lambda n, k: n << k if k >= 0 else n >> -k, 2, 1)


class Dyadic:
    """Numbers n 2^e: an array `n` of Python's integers, which never overflow, and one common `e`.

    Sums, differences and products are exact.
    """

    def __init__(self, n: Integers, e: int) -> None:
        self.n, self.e = n, e

    @classmethod
    def of(cls, values: npt.ArrayLike) -> "Dyadic":
        """The exact values of floats, which must be finite."""
        array = np.asarray(values, dtype=np.float64)
        mantissa, exponent = np.frexp(array)
        exponent = np.where(array == 0.0, 0, exponent - 53)
        integers = np.ldexp(mantissa, 53).astype(np.int64).astype(object)
        used = exponent[array != 0.0]
        e = int(used.min()) if used.size else 0
        shift = np.where(array == 0.0, 0, exponent - e).astype(object)
        return cls(np.asarray(_shifted(integers, shift), dtype=object).reshape(array.shape), e)

    def to(self, e: int) -> "Dyadic":
        """The same numbers with a smaller exponent."""
        return Dyadic(self.n * (1 << (self.e - e)), e)

    def __add__(self, other: "Dyadic") -> "Dyadic":
        e = min(self.e, other.e)
        return Dyadic(self.to(e).n + other.to(e).n, e)

    def __sub__(self, other: "Dyadic") -> "Dyadic":
        return self + -other

    def __neg__(self) -> "Dyadic":
        return Dyadic(-self.n, self.e)

    def __mul__(self, other: "Dyadic") -> "Dyadic":
        return Dyadic(self.n * other.n, self.e + other.e)

    def __getitem__(self, index: Any) -> "Dyadic":
        return Dyadic(np.asarray(self.n[index], dtype=object), self.e)

    def sum(self) -> "Dyadic":
        """Along the last axis."""
        return Dyadic(np.asarray(self.n.sum(axis=-1), dtype=object), self.e)

    def sign(self) -> npt.NDArray[np.int64]:
        """-1, 0 or 1."""
        return np.asarray(self.n > 0, np.int64) - np.asarray(self.n < 0, np.int64)

    def where(self, condition: BoolArray, other: "Dyadic") -> "Dyadic":
        """These numbers where the condition holds, elsewhere the others."""
        e = min(self.e, other.e)
        return Dyadic(np.where(condition, self.to(e).n, other.to(e).n), e)

    def floats(self) -> FloatArray:
        """The nearest floats."""
        one = 1 << max(0, -self.e)
        factor = 1 << max(0, self.e)
        values = [n * factor / one for n in self.n.ravel().tolist()]
        return np.array(values, dtype=np.float64).reshape(self.n.shape)


def dot(a: Dyadic, b: Dyadic) -> Dyadic:
    """Of vectors (..., 3)."""
    return (a * b).sum()


def cross(a: Dyadic, b: Dyadic) -> Dyadic:
    """Of vectors (..., 3)."""
    parts = [
        a[..., (k + 1) % 3] * b[..., (k + 2) % 3] - a[..., (k + 2) % 3] * b[..., (k + 1) % 3]
        for k in range(3)
    ]
    return stack(parts)


def stack(parts: list[Dyadic]) -> Dyadic:
    """Along a new last axis."""
    e = min(part.e for part in parts)
    arrays = np.broadcast_arrays(*(part.to(e).n for part in parts))
    return Dyadic(np.stack(arrays, axis=-1), e)


def apply(rows: Dyadic, vectors: Dyadic) -> Dyadic:
    """Matrices given by their rows (..., 9), times vectors (..., 3)."""
    return stack([dot(rows[..., 3 * k : 3 * k + 3], vectors) for k in range(3)])


# ---- roots and quotients, as fixed-point numbers ------------------------------------------------

FRACTION = 384
"""Fractional bits of a `Fixed`."""

DIGITS = 192
"""Additional bits of a square root, compared with its argument."""

CERTAIN = 96
"""Relative precision of a `Fixed` in bits: its error is at most 2^-CERTAIN of itself, or SLACK
units of the last bit if that is more."""

SLACK = 16

NEVER: Any = np.array(1 << 4096, dtype=object)
"""The t of a miss: larger than any other."""

Fixed = Integers
"""t 2^FRACTION, rounded, with the error of CERTAIN and SLACK."""


def quotient(a: Dyadic, b: Dyadic) -> Fixed:
    """a / b; NEVER where b is 0."""
    shift = FRACTION + a.e - b.e
    zero = b.n == 0
    numerator = a.n << shift if shift >= 0 else a.n
    denominator = np.where(zero, 1, b.n if shift >= 0 else b.n << -shift)
    return np.asarray(np.where(zero, NEVER, numerator // denominator))


def square_root(a: Dyadic) -> Dyadic:
    """Square roots, rounded down; those of negative numbers are 0."""
    shift = 2 * DIGITS + (a.e % 2)
    n = np.asarray(_root(np.where(a.n > 0, a.n, 0) << shift), dtype=object)
    return Dyadic(n, (a.e - shift) // 2)


def roots(a: Dyadic, b: Dyadic, c: Dyadic) -> tuple[npt.NDArray[np.int64], Fixed, Fixed]:
    """(sign of the discriminant, both roots in order) of a t² + 2 b t + c.

    If a is 0 and b is not: the sign is 1, one root is -c / 2b, the other is -NEVER or NEVER.  If
    both are 0: the sign is that of -c, and there are no roots: (-NEVER, NEVER).
    """
    discriminant = b * b - a * c
    sign = discriminant.sign()
    root = square_root(discriminant)
    positive = b.sign() >= 0
    q = -(b + root).where(positive, b - root)
    flat = a.n == 0
    first, second = quotient(q, a), quotient(c, q)
    # With a = 0 only c / q is finite; the other root is infinite, with the sign of q / 0.
    first = np.where(flat, np.where(q.n < 0, -NEVER, NEVER), first)
    # q = 0 means that b and the discriminant are 0: a double root at 0, or a constant.
    second = np.where(q.n == 0, first, second)
    near, far = np.where(first < second, first, second), np.where(first < second, second, first)
    constant = flat & (b.n == 0)
    sign = np.where(constant, -c.sign(), sign)
    return sign, np.where(constant, -NEVER, near), np.where(constant, NEVER, far)


def tied(a: Fixed, b: Fixed) -> BoolArray:
    """Whether two numbers may be equal, within their errors."""
    slack = np.where(abs(a) > abs(b), abs(a), abs(b)) >> CERTAIN
    return np.asarray(abs(a - b) <= slack + SLACK, dtype=bool)


def nearest(t: Fixed) -> FloatArray:
    """As floats; infinite for ±NEVER."""
    one = 1 << FRACTION
    largest = one << 1023
    values = [_float(n, one, largest) for n in t.ravel().tolist()]
    return np.array(values, dtype=np.float64).reshape(t.shape)


def _float(n: int, one: int, largest: int) -> float:
    if -largest < n < largest:
        return n / one  # rounded to nearest
    return math.inf if n > 0 else -math.inf
