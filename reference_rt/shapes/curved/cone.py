"""Cone, or frustum of a cone: around the z axis, closed or open."""

from fractions import Fraction
from typing import Annotated, Literal

from pydantic import Field

from reference_rt.core.model import Positive
from reference_rt.shapes.curved.quadric import tabulate
from reference_rt.shapes.curved.quadrics import Quadrics
from reference_rt.shapes.shape import Shape, TabulationContext


class Cone(Shape):
    """A cone or truncated cone about the z axis, from z = 0 to z = `height`; outward normals, at an
    apex along the axis.

    Surface coordinates: u around from +x, v up from z = 0, each from 0 to 1; on a cap x and y over
    the square around the wider one.  Faces: 0 is the side, 3 the bottom, 6 the top.
    """

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
