"""Pinhole camera: the physical one, a box with a film behind a hole."""

from typing import Literal, Self

from pydantic import model_validator

from reference_rt.cameras.camera import Camera
from reference_rt.cameras.perspective import PerspectiveView
from reference_rt.cameras.view_rectangle import at_distance_1, by_width, place
from reference_rt.core.model import Positive
from reference_rt.core.vec3 import Vec3


class Pinhole(Camera):
    """A real pinhole camera: a film behind the hole at `eye`, on which the image is upside down and
    mirrored.

    The film is shown as seen from behind, looking forward: pixels to the right lie to the right in
    space.  The picture is that of `perspective` with the same angle, turned by 180 degrees.

    Rays start at the hole.  A box around the film lets light in at the hole alone, so that no shape
    between film and hole is seen.
    """

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
