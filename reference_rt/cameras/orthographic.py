"""Orthographic camera: parallel rays that start on the view rectangle."""

from typing import ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from reference_rt.cameras.camera import Camera, Clip, Seen
from reference_rt.cameras.view_rectangle import Edges, Rectangle, by_width, place, vec3
from reference_rt.core.model import Examples, Positive
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, cross, dot, length
from reference_rt.jit.kernel import kernel


class Orthographic(Camera):
    """Parallel rays through a view rectangle at the eye, perpendicular to the view direction."""

    EXAMPLES: ClassVar[Examples] = ({}, {"width": 3.0}, {"view": (-1.0, 2.0, -0.5, 1.0)})
    type: Literal["orthographic"] = "orthographic"
    width: Positive | None = None
    """Width of the view rectangle, centred on the eye, in scene units; its height follows from the
    picture's shape.  Default, without `view`: 2."""
    view: Edges | None = None
    """Instead of `width`: the edges [left, right, bottom, top] of the view rectangle, relative to
    the eye, in scene units.  Where its shape is not the picture's, pixels are not square."""

    @model_validator(mode="after")
    def _one_of_width_and_view(self) -> Self:
        if self.width is not None and self.view is not None:
            raise ValueError("both 'width' and 'view'; expected one of them")
        return self

    def rectangle(self, n_x: int, n_y: int) -> Rectangle:
        """The view rectangle for a picture of n_x x n_y pixels."""
        if self.view is None:
            return by_width(2.0 if self.width is None else self.width, n_x, n_y)
        return Rectangle(*self.view)

    def setup(self, width: int, height: int) -> "OrthographicView":
        basis = self.basis
        corner, right, down = place(self.rectangle(width, height), basis, 0.0)
        start = Vec3(*self.eye) + corner
        return OrthographicView(start, right, down, vec3(-basis[2]), self.clip)


class OrthographicView(NamedTuple):
    """The top left corner of the view rectangle, its top and left edges, the unit direction, the
    clipping planes."""

    corner: Vec3
    right: Vec3
    down: Vec3
    forward: Vec3
    clip: Clip


@kernel
def camera_ray(view: OrthographicView, x: float, y: float, lens: tuple[float, float]) -> Ray:
    """The ray from (x, y) of the rectangle, forward (T2: u_s = l + (r - l)(i + 1/2) / n_x)."""
    start = view.corner + view.right * x + view.down * y
    return Ray(start + view.forward * view.clip.near, view.forward, view.clip.depth)


@kernel
def see(view: OrthographicView, p: Vec3, lens: tuple[float, float]) -> Seen:
    """The point `p` as the camera sees it: the film's area is that across the rays, over the
    rectangle's."""
    w, right, down = p - view.corner, view.right, view.down
    z = dot(w, view.forward)
    o = p - view.forward * (z - view.clip.near)
    x, y = dot(w, right) / dot(right, right), dot(w, down) / dot(down, down)
    is_seen = view.clip.near < z < view.clip.near + view.clip.depth
    weight = 1.0 / length(cross(right, down)) if is_seen else 0.0
    return Seen(x, y, weight, o, view.forward)
