"""Perspective cameras: all rays pass one point, the eye or the hole of a `Pinhole`."""

from typing import ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from reference_rt.cameras.camera import Camera, Clip, Seen, clipped_ray, seen_through
from reference_rt.cameras.view_rectangle import CentralCamera, at_distance_1, by_width, place
from reference_rt.core.model import Examples, Positive
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel


class Perspective(CentralCamera):
    """The ideal pinhole camera: rays from the eye through a view rectangle in front of it."""

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"eye": (0.0, 1.0, 5.0), "up": (0.1, 1.0, 0.0), "fov": 60.0, "fov_axis": "smaller"},
        {"view": (-1.0, 2.0, -0.5, 1.0), "distance": 2.0, "near": 0.5, "far": 9.0},
    )
    type: Literal["perspective"] = "perspective"

    def setup(self, width: int, height: int) -> "PerspectiveView":
        return PerspectiveView(
            Vec3(*self.eye), *place(self.rectangle(width, height), self.basis, 1.0), self.clip
        )


class PerspectiveView(NamedTuple):
    """eye: the origin of all rays, if nothing is clipped;  corner: the picture's top left corner at
    distance 1, from the eye;  right, down: its change across the picture, and down."""

    eye: Vec3
    corner: Vec3
    right: Vec3
    down: Vec3
    clip: Clip


@kernel
def camera_ray(view: PerspectiveView, x: float, y: float, lens: tuple[float, float]) -> Ray:
    """d = s - e through (x, y) of the rectangle (T3), made unit."""
    return clipped_ray(view.clip, view.eye, view.corner + view.right * x + view.down * y)


@kernel
def see(view: PerspectiveView, p: Vec3, lens: tuple[float, float]) -> Seen:
    """The point `p` as the camera sees it."""
    none = Vec3(0.0, 0.0, 0.0)
    return seen_through(view.clip, view.eye, view.corner, view.right, view.down, none, p)


class Pinhole(Camera):
    """A real pinhole camera: a film behind the hole at `eye`, on which the image is upside down and
    mirrored.

    The film is shown as seen from behind, looking forward: pixels to the right lie to the right in
    space.  The picture is that of `perspective` with the same angle, turned by 180 degrees.

    Rays start at the hole.  A box around the film lets light in at the hole alone, so that no shape
    between film and hole is seen.
    """

    EXAMPLES: ClassVar[Examples] = ({}, {"film_width": 2.0, "film_distance": 1.5})
    type: Literal["pinhole"] = "pinhole"
    film_width: Positive = 1.0
    """Width of the film in scene units; its height follows from the picture's shape."""
    film_distance: Positive = 1.0
    """Distance from the hole back to the film, in scene units."""

    @model_validator(mode="after")
    def _check_angle(self) -> Self:
        at_distance_1(by_width(self.film_width, 1, 1), self.film_distance)
        return self

    def setup(self, width: int, height: int) -> PerspectiveView:
        # Only the direction counts: a film of another size at distance 1 gives the same.
        film = by_width(self.film_width / self.film_distance, width, height)
        corner, right, down = place(film, self.basis, -1.0)
        # d = e - s: on from the film's point s through the hole.
        return PerspectiveView(Vec3(*self.eye), -corner, -right, -down, self.clip)
