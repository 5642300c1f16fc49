"""Quadric: a surface of second degree, clipped to a box; how rows of the table are made.

Cylinders, cones and ellipsoids are rows of the same table.  The local coordinates of a row are
those of `quadratic_form.fit`.
"""

from collections.abc import Sequence
from fractions import Fraction
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from reference_rt.core.model import Vector
from reference_rt.core.transform import Affine
from reference_rt.shapes.curved.quadratic_form import (
    Coefficients,
    Form,
    Point,
    definite_sign,
    fit,
    seen_from,
)
from reference_rt.shapes.curved.quadrics import Quadrics
from reference_rt.shapes.placement import columns
from reference_rt.shapes.shape import Shape, TabulationContext


class Quadric(Shape):
    """The surface f = 0 inside a box; the front is where f > 0.

    f(x, y, z) = A x² + B y² + C z² + D xy + E yz + F xz + G x + H y + I z + J.  Planes and pairs of
    planes are quadrics like any other.

    An f that does not change its sign bounds nothing, which is an error: a constant, a square, a
    sum of squares.  If `capped`, it is the whole box where f <= 0 everywhere, and nothing
    otherwise.
    """

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
        fitted = fit(form, lower, upper)
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
