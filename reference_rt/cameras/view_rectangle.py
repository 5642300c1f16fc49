"""The view rectangle [l, r, b, t], given by its edges, by its width, or by an angle of view."""

import math
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import BeforeValidator, Field, Strict, WithJsonSchema, model_validator

from reference_rt.cameras.camera import Camera
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Positive
from reference_rt.core.vec3 import Vec3


class Rectangle(NamedTuple):
    """Left, right, bottom and top edge: coordinates along u and v from the axis of view."""

    l: float
    r: float
    b: float
    t: float


class PlacedRectangle(NamedTuple):
    """A rectangle in space as three vectors: from the eye to its top left corner, along its top
    edge, and along its left edge."""

    corner: Vec3
    right: Vec3
    down: Vec3


def _edges(value: Any) -> Any:
    edges = list(value) if isinstance(value, list | tuple) else []
    if len(edges) != 4 or any(isinstance(x, bool) or not isinstance(x, int | float) for x in edges):
        raise ValueError("expected four numbers [l, r, b, t]")
    try:
        l, r, b, t = map(float, edges)
    except OverflowError:
        raise ValueError("expected finite numbers") from None
    for low, high, order in ((l, r, "l < r"), (b, t, "b < t")):
        if not low < high:  # also refuses NaN
            raise ValueError(f"expected [l, r, b, t] with {order}, got {low:g} and {high:g}")
        if high - low == math.inf:
            raise ValueError("expected a rectangle of finite size")
    return l, r, b, t


Edges = Annotated[
    tuple[float, float, float, float],
    Strict(False),
    BeforeValidator(_edges),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 4, "maxItems": 4}),
]
"""[l, r, b, t] in scene units, l < r and b < t; (0, 0) is where the axis of view passes."""

FovAxis = Literal["x", "y", "diagonal", "smaller", "larger"]


def by_width(width: float, n_x: int, n_y: int) -> Rectangle:
    """Centred, `width` wide, in the shape of a picture of n_x x n_y pixels."""
    return _centred(width / 2.0, width / 2.0 * (n_y / n_x))


def by_angle(fov: float, axis: FovAxis, n_x: int, n_y: int) -> Rectangle:
    """Centred at distance 1, in the picture's shape; `fov` degrees span `axis` of the picture."""
    spanned = {
        "x": n_x,
        "y": n_y,
        "diagonal": math.hypot(n_x, n_y),
        "smaller": min(n_x, n_y),
        "larger": max(n_x, n_y),
    }[axis]
    half = math.tan(math.radians(fov) / 2.0)
    return _centred(half * (n_x / spanned), half * (n_y / spanned))


def _centred(half_x: float, half_y: float) -> Rectangle:
    return Rectangle(-half_x, half_x, -half_y, half_y)


STEEPEST = 2.0**53
"""1/u: in a steeper direction the component along the axis is below the rounding error of the
others, so that the angle of view is 180 degrees.  Its square is far from overflow."""


def at_distance_1(rectangle: Rectangle, distance: float) -> Rectangle:
    """The rectangle at distance 1 that looks the same from the eye.

    Raises ValueError where it degenerates in float64.
    """
    near = Rectangle(*(edge / distance for edge in rectangle))
    if not (near.l < near.r and near.b < near.t):
        raise ValueError("the distance makes the rectangle a point; expected a smaller distance")
    if max(map(abs, near)) > STEEPEST:
        raise ValueError("the rectangle fills all 180 degrees; expected a larger distance")
    return near


def place(rectangle: Rectangle, basis: FloatArray, distance: float) -> PlacedRectangle:
    """The rectangle across the view direction at `distance` before the eye."""
    u, v, w = basis
    l, r, b, t = rectangle
    return PlacedRectangle(vec3(l * u + t * v - distance * w), vec3((r - l) * u), vec3((b - t) * v))


def vec3(array: FloatArray) -> Vec3:
    return Vec3(*array.tolist())


class CentralCamera(Camera):
    """What `perspective` and `thin_lens` share: a view rectangle in front of the eye, by an angle
    (`fov`) or by its edges (`view`)."""

    fov: Annotated[float, Field(gt=0, lt=180)] | None = None
    """Full angle of view in degrees along `fov_axis`, above 0 and below 180.  Default, without
    `view`: 45."""
    fov_axis: FovAxis | None = None
    """The side of the picture that `fov` spans: width, height, diagonal, the smaller or the larger
    side.  Default: x."""
    view: Edges | None = None
    """Instead of `fov`: the edges [left, right, bottom, top] of the view rectangle at `distance`,
    in scene units.  Where its shape is not the picture's, pixels are not square.  Where it is off
    the axis, the view is sheared (shifted)."""
    distance: Positive | None = None
    """Distance from the eye to the rectangle `view`, along the view direction, in scene units.
    Default: 1."""

    @model_validator(mode="after")
    def _one_of_fov_and_view(self) -> Self:
        by_angle = [name for name in ("fov", "fov_axis") if getattr(self, name) is not None]
        if self.view is None:
            if self.distance is not None:
                raise ValueError("'distance' is that of 'view'; expected 'view' too")
        elif by_angle:
            raise ValueError(f"both '{by_angle[0]}' and 'view'; expected one of them")
        else:
            at_distance_1(Rectangle(*self.view), self.distance or 1.0)
        return self

    @property
    def angle(self) -> tuple[float, FovAxis]:
        """fov and fov_axis, or their defaults; meaningless beside `view`."""
        return 45.0 if self.fov is None else self.fov, self.fov_axis or "x"

    def rectangle(self, n_x: int, n_y: int) -> Rectangle:
        """The view rectangle at distance 1 for a picture of n_x x n_y pixels."""
        if self.view is None:
            return by_angle(*self.angle, n_x, n_y)
        return at_distance_1(Rectangle(*self.view), self.distance or 1.0)
