"""Pinhole camera: the physical one, a box with a film behind a hole."""

from typing import Literal, Self

from pydantic import model_validator

from reference_rt.cameras.camera import Camera
from reference_rt.cameras.perspective import PerspectiveView
from reference_rt.cameras.view_rectangle import at_distance_1, by_width, place
from reference_rt.core.model import Positive
from reference_rt.core.vec3 import Vec3


class Pinhole(Camera):
    """A film behind the hole at `eye`: the picture is what light draws on it, upside down and with
    left and right exchanged.

    It shows the film as one sees it from behind, looking forward: pixels to the right lie to the
    right in space.  It is the picture of `perspective` with the same angle, turned by 180 degrees.

    Rays start at the hole, not on the film.  Around the film is a box, which lets light in at the
    hole alone: whatever a scene has between film and hole, or behind, is not seen.
    """

    type: Literal["pinhole"] = "pinhole"
    film_width: Positive = 1.0
    """Width of the film in scene units; its height follows from the picture's shape."""
    film_distance: Positive = 1.0
    """From the hole back to the film, in scene units."""

    @model_validator(mode="after")
    def _check_angle(self) -> Self:
        at_distance_1(by_width(self.film_width, 1, 1), self.film_distance)
        return self

    def setup(self, width: int, height: int) -> PerspectiveView:
        # Only the direction counts: a film of another size at distance 1 gives the same.
        film = by_width(self.film_width / self.film_distance, width, height)
        corner, right, down = place(film, self.basis, -1.0)
        # d = e - s: on from the film's point s through the hole.
        return PerspectiveView(Vec3(*self.eye), -corner, -right, -down)
