"""The base of all shapes: descriptions, points on lights, tangents, spans."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from reference_rt.core.arrays import Bounds, FloatArray
from reference_rt.core.model import Description, Examples
from reference_rt.core.transform import FLAT, IDENTITY, Affine, Transform, affine, compose, flattens
from reference_rt.core.vec3 import Vec3, dot, frame_from_normal
from reference_rt.jit.kernel import kernel


def _ignore_warning(owner: int, message: str) -> None:
    """Ignores a warning: of a shape that is tabulated once more, after the scene has warned."""


class TabulationContext(NamedTuple):
    """The context in which a shape is tabulated.

    owner: the shape id, its index in the scene (in its group);  material: the row of its material;
    folder: what file names are relative to;  outer: the map that is applied after its own
    transform;  warn: takes the owner and a warning for the user.
    """

    owner: int = 0
    material: int = 0
    folder: Path = Path()
    outer: Affine = IDENTITY
    warn: Callable[[int, str], None] = _ignore_warning


class Shape(Description):
    """A shape of the scene: what it is made of and where it stands."""

    material: str | None = None
    """Name of the material.  Default: that of the group or the solid that the shape is in, else
    diffuse grey of reflectance 0.5."""
    transform: Transform = ()
    """Steps from the shape's own coordinates to the world's (in a group: to the group's), the first
    one first.  Default: none."""
    interior: str | None = None
    """Name of the medium behind the surface, where its normal does not point: within a closed
    shape.  Default: the shape changes no medium, or none if it has an `exterior`."""
    exterior: str | None = None
    """Name of the medium in front of the surface, where its normal points.  Default: likewise."""

    def tabulate(self, context: TabulationContext) -> Any:
        """This shape as rows of its table.  Raises ValueError (what is wrong, what was
        expected)."""
        raise NotImplementedError

    def __and__(self, other: "Shape") -> "Shape":
        """The points that both solids share."""
        return Intersection(of=(self, other))

    def __or__(self, other: "Shape") -> "Shape":
        """The points of either solid."""
        return Union(of=(self, other))

    def __sub__(self, other: "Shape") -> "Shape":
        """The points of the first solid that are not in the second."""
        return Difference(of=(self, other))

    def map_in(self, context: TabulationContext) -> Affine:
        """The map from the shape's own coordinates to those of the context: its transform, then
        `context.outer`.  Raises ValueError for one that flattens space."""
        if not self.transform and context.outer is IDENTITY:
            return IDENTITY  # the fast path: most shapes of a large scene
        m = compose(affine(self.transform), context.outer)
        if flattens(m):
            raise ValueError(FLAT)
        return m


class Solid(Shape):
    """What union, intersection and difference share: operands, which may be solids themselves.

    Operands without a material have that of the solid, so that a cut face looks as what cuts it.
    """

    EXAMPLES: ClassVar[Examples] = ({"of": ({"type": "box"}, {"type": "sphere", "radius": 1.2})},)
    of: Annotated[tuple["AnyOperand", ...], Field(strict=False, min_length=1)]  # type: ignore[name-defined]  # noqa: F821
    """The operands, at least one: shapes that enclose space, or solids again."""
    # `AnyOperand` names every type of shape: `shapes/csg.py` completes the models.


class Union(Solid):
    """The solid of all points that are in any operand."""

    type: Literal["union"] = "union"


class Intersection(Solid):
    """The solid of the points that are in all operands."""

    type: Literal["intersection"] = "intersection"


class Difference(Solid):
    """The solid of the points of the first operand that are in none of the others."""

    type: Literal["difference"] = "difference"


@kernel
def in_column(column: Any, i: int) -> int:
    """Number i of a column of integers of any size; a column of one row has that one for all."""
    return int(np.int64(column[min(i, len(column) - 1)]))


class LightPoint(NamedTuple):
    """A point sampled on a light: position, unit normal, the error bound of the position (see
    `SurfacePoint.error`) and the density per solid angle at the receiver; pdf = 0 means that no
    light arrives from there;  u, v: as in `Crossing`."""

    p: Vec3
    n: Vec3
    error: float
    pdf: float
    u: float
    v: float


NO_LIGHT_POINT = LightPoint(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
"""No light arrives."""


@kernel
def lift(w: Vec3, reach: Vec3, error: float) -> float:
    """The height above a flat shape to which rounding may have lifted a point of the shape itself:
    `error`, or 0 for a point outside of the shape's bounding box, which cannot be one.

    w: from the middle of that box to the point;  reach: half the box's size;  error: the bound of
    `SurfacePoint.error` there.
    """
    is_inside = (
        (abs(w.x) <= reach.x + error)
        & (abs(w.y) <= reach.y + error)
        & (abs(w.z) <= reach.z + error)
    )
    return error if is_inside else 0.0


@kernel
def solid_angle_pdf(p: Vec3, q: Vec3, n: Vec3, area: float, lifted: float) -> float:
    """The density 1 / area, at the point `q` with unit normal `n`, per solid angle at `p`:
    distance² / (cos area) (e.g. Veach 1997, eq. 8.2).

    0 for a receiver behind the surface, and for a point of the flat surface itself, from which none
    of the surface is visible, even if rounding has lifted it above the plane: by at most 2
    `lifted`, see `lift`.  Half of that bound is p's distance from the plane; q's own distance is at
    most twice as much, since |q| <= |anchor| + size; the product with n rounds by less than the
    other half.
    """
    w = p - q
    height = dot(w, n)
    if height <= 2.0 * lifted:
        return 0.0
    distance2 = dot(w, w)
    # In this order nothing overflows or underflows where the area is an ordinary float64.
    return (distance2 / area) * (math.sqrt(distance2) / height)


class Tangents(NamedTuple):
    """dp/du and dp/dv: the derivatives of the point by the coordinates that a shape's `uv` returns,
    neither unit nor orthogonal."""

    dpdu: Vec3
    dpdv: Vec3


@kernel
def any_tangents(n: Vec3) -> Tangents:
    """Any tangents, where u and v are no coordinates, as at a pole: a unit basis of the tangent
    plane."""
    frame = frame_from_normal(n)
    return Tangents(frame.s, frame.t)


class Spans(NamedTuple):
    """The parts of a line inside a solid: from t0 to t1 and from t2 to t3, in order, over all t,
    also below 0; inf for parts that do not exist.  u0 to u3: as `Crossing.u` for these points.  A
    line that comes from inside has t0 = -inf."""

    t0: float
    u0: float
    t1: float
    u1: float
    t2: float
    u2: float
    t3: float
    u3: float


@kernel
def no_spans() -> Spans:
    """A line that stays outside."""
    return one_span(math.inf, 0.0, math.inf, 0.0)


@kernel
def one_span(t0: float, u0: float, t1: float, u1: float) -> Spans:
    return Spans(t0, u0, t1, u1, math.inf, 0.0, math.inf, 0.0)


def outward(lower: FloatArray, upper: FloatArray) -> Bounds:
    """Bounds enlarged by one float on each side, so that their own rounding cannot cut the
    shape."""
    return np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)
