"""Quadric: a surface of second degree, clipped to a box; how rows of the table are made.

Cylinders, cones and ellipsoids are rows of the same table.  The local coordinates of a row are
those of `fit`.
"""

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import combinations
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import BeforeValidator, Field, Strict, WithJsonSchema, model_validator

from reference_rt.core.model import Examples, Positive, Vector
from reference_rt.core.transform import Affine
from reference_rt.shapes.curved.quadrics import Quadrics
from reference_rt.shapes.placement import columns
from reference_rt.shapes.shape import Shape, TabulationContext

# Quadratic forms f(x, y, z) = A x² + B y² + C z² + D xy + E yz + F xz + G x + H y + I z + J,
# exactly.
#
# Decisions that are made once, when a scene is built, are made in exact arithmetic.


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


_fitted = lru_cache(maxsize=256)(fit)
"""A scene that is changed makes its tables anew, with the same quadrics in other places."""


def _determinant(rows: Rows) -> Fraction:
    """By expansion along the first row (Laplace)."""
    if not rows:
        return Fraction(1)
    total = Fraction(0)
    for k, entry in enumerate(rows[0]):
        total += (-1) ** k * entry * _determinant([row[:k] + row[k + 1 :] for row in rows[1:]])
    return total


class Quadric(Shape):
    """The surface f = 0 inside a box; the front is where f > 0.

    f(x, y, z) = A x² + B y² + C z² + D xy + E yz + F xz + G x + H y + I z + J.  Planes and pairs of
    planes are quadrics like any other.

    An f that does not change its sign bounds nothing, which is an error: a constant, a square, a
    sum of squares.  If `capped`, it is the whole box where f <= 0 everywhere, and nothing
    otherwise.
    """

    EXAMPLES: ClassVar[Examples] = tuple(
        {
            "coefficients": (1.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1),
            "lower": (-0.9, -0.8, -0.7),
            "upper": (0.8, 0.9, 1.0),
            "capped": capped,
        }
        for capped in (False, True)
    )
    type: Literal["quadric"] = "quadric"
    coefficients: Coefficients
    """The ten coefficients [A, B, C, D, E, F, G, H, I, J] of f, before the transform."""
    lower: Vector
    """The corner of the clip box with the smallest coordinates, before the transform."""
    upper: Vector
    """The corner of the clip box with the largest coordinates, before the transform."""
    capped: bool = False
    """Whether it is the solid f <= 0 in the box, closed by the box's faces.  Otherwise it is the
    surface alone."""

    @model_validator(mode="after")
    def _has_a_box(self) -> Self:
        if not all(a < b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ValueError(
                "expected each coordinate of 'lower' to be below that of 'upper', "
                f"got {list(self.lower)} and {list(self.upper)}"
            )
        return self

    def tabulate(self, context: TabulationContext) -> "Quadrics":
        form = tuple(Fraction(x) for x in self.coefficients)
        sign = definite_sign(form)
        if sign != 0:
            if not self.capped:
                raise ValueError(
                    "f does not change its sign, so that there is no surface; expected "
                    "coefficients for which f takes both"
                )
            form = (*[Fraction(0)] * 9, Fraction(sign))
        clipped = (True, True, True)
        m = self.map_in(context)
        return tabulate(context, m, form, self.lower, self.upper, clipped, self.capped)


_LARGEST = 1e140
"""The largest entry of a map and of its inverse: the square of ten times this is finite."""


def tabulate(
    context: TabulationContext,
    m: Affine,
    form: Form,
    lower: Point,
    upper: Point,
    clipped: Sequence[bool],
    capped: bool,
) -> Quadrics:
    """One row; `m` maps the coordinates of the form and the box to those of the context.

    The box must contain the whole surface along the axes that it does not clip.
    """
    try:
        fitted = _fitted(form, tuple(lower), tuple(upper))
    except OverflowError:
        raise ValueError("its size overflows; expected finite numbers") from None
    # In exact arithmetic: an origin far away and a map that brings it back would cancel.
    offset = [
        float(
            sum((Fraction(a) * Fraction(o) for a, o in zip(r[:3], fitted.origin, strict=True)), r3)
        )
        for r, r3 in zip(m, map(Fraction, m[:, 3]), strict=True)
    ]
    table = Quadrics(
        **columns(np.column_stack([m[:, :3] * fitted.unit, offset]), context),
        coefficients=np.array([fitted.form]),
        lower=np.array([fitted.lower]),
        upper=np.array([fitted.upper]),
        clipped=np.array([clipped], np.int64),
        capped=np.array([capped], np.int64),
    )
    if max(np.abs(table.edges).max(), np.abs(table.to_local).max()) > _LARGEST:
        raise ValueError(
            f"its size overflows; expected a scale from {1 / _LARGEST:.0e} to {_LARGEST:.0e}"
        )
    return table


def ellipsoid(context: TabulationContext, m: Affine, middle: Vector, radius: float) -> Quadrics:
    """The image under m of the sphere around `middle`."""
    unit_sphere = tuple(Fraction(k) for k in (1, 1, 1, 0, 0, 0, 0, 0, 0))
    form = seen_from((*unit_sphere, -(Fraction(radius) ** 2)), [-Fraction(x) for x in middle])
    lower = [Fraction(x) - Fraction(radius) for x in middle]
    upper = [Fraction(x) + Fraction(radius) for x in middle]
    return tabulate(context, m, form, lower, upper, (False, False, False), True)


class Cylinder(Shape):
    """A cylinder about the z axis, from `z_min` to `z_max`; outward normals.

    Surface coordinates: u around from +x, v up from `z_min`, each from 0 to 1; on a cap x and y
    over the square around it.  Faces: 0 is the side, 3 the bottom, 6 the top.
    """

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"radius": 0.5, "z_min": -0.3, "z_max": 0.7, "capped": False},
    )
    type: Literal["cylinder"] = "cylinder"
    radius: Positive = 1.0
    """Radius about the z axis, before the transform, in scene units."""
    z_min: float = 0.0
    """Lower end on the z axis, before the transform, in scene units."""
    z_max: float = 1.0
    """Upper end on the z axis, above `z_min`, before the transform."""
    capped: bool = True
    """Whether it is a solid, closed by two disks.  Otherwise it is the side alone, seen from both
    sides."""

    @model_validator(mode="after")
    def _has_a_height(self) -> Self:
        if not self.z_min < self.z_max:
            raise ValueError(
                f"expected 'z_min' below 'z_max', got {self.z_min:g} and {self.z_max:g}"
            )
        return self

    def tabulate(self, context: TabulationContext) -> Quadrics:
        r = self.radius
        form = (*map(Fraction, (1, 1, 0, 0, 0, 0, 0, 0, 0)), -(Fraction(r) ** 2))
        lower, upper = (-r, -r, self.z_min), (r, r, self.z_max)
        clipped = (False, False, True)
        return tabulate(context, self.map_in(context), form, lower, upper, clipped, self.capped)


class Cone(Shape):
    """A cone or truncated cone about the z axis, from z = 0 to z = `height`; outward normals, at an
    apex along the axis.

    Surface coordinates: u around from +x, v up from z = 0, each from 0 to 1; on a cap x and y over
    the square around the wider one.  Faces: 0 is the side, 3 the bottom, 6 the top.
    """

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"radius": 0.6, "height": 1.3, "capped": False},
        {"radius": 0.5, "top_radius": 0.3},
        {"radius": 0.3, "top_radius": 0.7, "capped": False},
    )
    type: Literal["cone"] = "cone"
    radius: Positive = 1.0
    """Radius at z = 0, before the transform, in scene units."""
    height: Positive = 1.0
    """Height along z, before the transform, in scene units."""
    top_radius: Annotated[float, Field(ge=0)] = 0.0
    """Radius at z = `height`, at least 0, before the transform; 0, the default, makes an apex."""
    capped: bool = True
    """Whether it is a solid, closed by disks.  Otherwise it is the side alone, seen from both
    sides."""

    def tabulate(self, context: TabulationContext) -> Quadrics:
        r, top = Fraction(self.radius), Fraction(self.top_radius)
        slope = (top - r) / Fraction(self.height)
        zero, one = Fraction(0), Fraction(1)
        form = (one, one, -slope * slope, zero, zero, zero, zero, zero, -2 * r * slope, -r * r)
        reach = max(self.radius, self.top_radius)
        lower, upper = (-reach, -reach, 0.0), (reach, reach, self.height)
        clipped = (False, False, True)
        return tabulate(context, self.map_in(context), form, lower, upper, clipped, self.capped)
