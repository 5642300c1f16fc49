"""Quadratic forms f(x, y, z) = A x² + B y² + C z² + D xy + E yz + F xz + G x + H y + I z + J,
exactly.

Decisions that are made once, when a scene is built, are made in exact arithmetic.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, Strict, WithJsonSchema

Form = tuple[Fraction, ...]
"""The ten coefficients (A, B, C, D, E, F, G, H, I, J)."""

Point = Sequence[Fraction | float]
Rows = list[list[Fraction]]


def _ten_numbers(value: Any) -> Any:
    items = list(value) if isinstance(value, list | tuple) else []
    is_number = [isinstance(x, int | float) and not isinstance(x, bool) for x in items]
    if len(is_number) != 10 or not all(is_number):
        raise ValueError("expected ten numbers [A, B, C, D, E, F, G, H, I, J]")
    try:
        return tuple(float(x) for x in items)
    except OverflowError:
        raise ValueError("expected finite numbers") from None


_TEN = {"type": "array", "items": {"type": "number"}, "minItems": 10, "maxItems": 10}
Ten = tuple[float, float, float, float, float, float, float, float, float, float]
Coefficients = Annotated[
    Annotated[Ten, Strict(False)], BeforeValidator(_ten_numbers), WithJsonSchema(_TEN)
]
"""[A, B, C, D, E, F, G, H, I, J] of a description."""


def definite_sign(form: Form) -> int:
    """-1 if f <= 0 everywhere, else 1 if f >= 0 everywhere, else 0: f changes its sign.

    f is the quadratic form of a symmetric 4x4 matrix at (x, y, z, 1).  Such a form is nowhere
    negative if and only if no principal minor of its matrix is negative (Sylvester).
    """
    a, b, c, d, e, f, g, h, i, j = form
    rows = [
        [2 * a, d, f, g],
        [d, 2 * b, e, h],
        [f, e, 2 * c, i],
        [g, h, i, 2 * j],
    ]
    for sign in (-1, 1):
        minors = (
            _determinant([[sign * rows[r][s] for s in chosen] for r in chosen])
            for k in range(1, 5)
            for chosen in combinations(range(4), k)
        )
        if all(minor >= 0 for minor in minors):
            return sign
    return 0


def center(form: Form) -> list[Fraction] | None:
    """The point where the gradient vanishes; None if that is not a single point."""
    a, b, c, d, e, f, g, h, i, _ = form
    rows = [[2 * a, d, f], [d, 2 * b, e], [f, e, 2 * c]]
    determinant = _determinant(rows)
    if determinant == 0:
        return None
    right = [-g, -h, -i]
    # Cramer's rule.
    return [
        _determinant([[*row[:k], right[r], *row[k + 1 :]] for r, row in enumerate(rows)])
        / determinant
        for k in range(3)
    ]


def seen_from(form: Form, origin: Point) -> Form:
    """The coefficients in coordinates whose origin is `origin`."""
    a, b, c, d, e, f, g, h, i, j = form
    x, y, z = (Fraction(v) for v in origin)
    gradient = (
        2 * a * x + d * y + f * z + g,
        d * x + 2 * b * y + e * z + h,
        f * x + e * y + 2 * c * z + i,
    )
    value = x * (a * x + d * y + f * z + g) + y * (b * y + e * z + h) + z * (c * z + i) + j
    return (*form[:6], *gradient, value)


def scaled(form: Form, unit: Point) -> Form:
    """The coefficients in coordinates whose units have the lengths `unit` in the old ones."""
    x, y, z = (Fraction(v) for v in unit)
    factors = (x * x, y * y, z * z, x * y, y * z, x * z, x, y, z, Fraction(1))
    return tuple(value * factor for value, factor in zip(form, factors, strict=True))


def power_of_two(x: Fraction | float) -> Fraction:
    """The smallest power of two that is at least |x|, which is not zero: scaling by it is exact."""
    x = abs(Fraction(x))
    power = Fraction(2) ** (x.numerator.bit_length() - x.denominator.bit_length())
    return power if power >= x else 2 * power


class Fitted(NamedTuple):
    """A form and its box in coordinates (p - origin) / unit: see `fit`."""

    form: list[float]
    lower: list[float]
    upper: list[float]
    origin: list[float]
    unit: list[float]


def fit(form: Form, lower: Point, upper: Point) -> Fitted:
    """The form, up to a factor, and the box in coordinates in which f rounds least.

    The box is within [-1, 1]³ and extends beyond 1/2 along each axis, the largest coefficient is in
    (1/2, 1], and the origin is the point of the box closest to where the gradient vanishes (the
    middle of an ellipsoid, the apex of a cone), around which f rounds least.  Units are powers of
    two: they do not round.
    """
    pairs = [(Fraction(a), Fraction(b)) for a, b in zip(lower, upper, strict=True)]
    middle = center(form) or [Fraction(0)] * 3
    origin = [float(min(max(x, a), b)) for x, (a, b) in zip(middle, pairs, strict=True)]
    pairs = [(a - Fraction(o), b - Fraction(o)) for o, (a, b) in zip(origin, pairs, strict=True)]
    unit = [power_of_two(max(-a, b)) for a, b in pairs]
    form = scaled(seen_from(form, origin), unit)
    largest = power_of_two(max(abs(value) for value in form))
    return Fitted(
        form=[float(value / largest) for value in form],
        lower=[float(a / u) for u, (a, _) in zip(unit, pairs, strict=True)],
        upper=[float(b / u) for u, (_, b) in zip(unit, pairs, strict=True)],
        origin=origin,
        unit=[float(u) for u in unit],
    )


def _determinant(rows: Rows) -> Fraction:
    """By expansion along the first row (Laplace)."""
    if not rows:
        return Fraction(1)
    total = Fraction(0)
    for k, entry in enumerate(rows[0]):
        total += (-1) ** k * entry * _determinant([row[:k] + row[k + 1 :] for row in rows[1:]])
    return total
