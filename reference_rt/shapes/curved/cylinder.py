"""Cylinder: around the z axis, closed or open."""

from fractions import Fraction
from typing import Literal, Self

from pydantic import model_validator

from reference_rt.core.model import Positive
from reference_rt.shapes.curved.quadric import tabulate
from reference_rt.shapes.curved.quadrics import Quadrics
from reference_rt.shapes.shape import Shape, TabulationContext


class Cylinder(Shape):
    """A cylinder about the z axis, from `z_min` to `z_max`; outward normals.

    Surface coordinates: u around from +x, v up from `z_min`, each from 0 to 1; on a cap x and y
    over the square around it.  Faces: 0 is the side, 3 the bottom, 6 the top.
    """

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
