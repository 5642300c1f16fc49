"""The real pinhole camera: its rays are those of a `PerspectiveView`, or with a hole that has a
size those of a `ThinLensView`."""

import math
from typing import ClassVar, Literal, Self

from pydantic import model_validator

from reference_rt.cameras.camera import Camera
from reference_rt.cameras.perspective import PerspectiveView
from reference_rt.cameras.thin_lens import ThinLensView
from reference_rt.cameras.view_rectangle import STEEPEST, at_distance_1, by_width, place, vec3
from reference_rt.core.model import Examples, Positive
from reference_rt.core.vec3 import Vec3


class Pinhole(Camera):
    """A real pinhole camera: a film behind the hole at `eye`, on which the image is upside down and
    mirrored.

    The film is shown as seen from behind, looking forward: pixels to the right lie to the right in
    space.  The picture is that of `perspective` with the same angle, turned by 180 degrees.

    Rays start at the hole.  A box around the film lets light in at the hole alone, so that no shape
    between film and hole is seen.

    A hole of radius r blurs: a point of the film sees at distance z a disk of radius
    r (1 + z / film_distance).  As with a lens, where no random numbers are drawn (by ray casting,
    and on a `grid`) every ray passes the hole's centre, and everything is sharp.
    """

    EXAMPLES: ClassVar[Examples] = (
        {},
        {"film_width": 2.0, "film_distance": 1.5},
        {"hole_radius": 0.05, "exposure": 40.0},
    )
    type: Literal["pinhole"] = "pinhole"
    film_width: Positive = 1.0
    """Width of the film in scene units; its height follows from the picture's shape."""
    film_distance: Positive = 1.0
    """Distance from the hole back to the film, in scene units."""
    hole_radius: Positive | None = None
    """Radius of the hole in scene units: larger ones let in more light and blur more.  Default: a
    point."""
    exposure: Positive | None = None
    """With `hole_radius`: pixels are `exposure` times the irradiance of the film, which grows with
    the square of the radius and falls towards the corners.  Default: pixels are the mean radiance
    that arrives through the hole, whatever its size."""

    @model_validator(mode="after")
    def _check_angle(self) -> Self:
        at_distance_1(by_width(self.film_width, 1, 1), self.film_distance)
        return self

    @model_validator(mode="after")
    def _check_hole(self) -> Self:
        if self.hole_radius is None:
            if self.exposure is not None:
                raise ValueError("a point lets in no light; expected 'hole_radius' too")
        elif not self.hole_radius / self.film_distance <= STEEPEST:
            raise ValueError(
                "the hole is too wide for its film; expected a larger 'film_distance' or a smaller "
                "'hole_radius'"
            )
        return self

    def setup(self, width: int, height: int) -> PerspectiveView | ThinLensView:
        # Only the direction counts: a film of another size at distance 1 gives the same.
        film = by_width(self.film_width / self.film_distance, width, height)
        u, v, _ = basis = self.basis
        corner, right, down = place(film, basis, -1.0)
        # d = e - s: on from the film's point s through the hole.
        eye, corner, right, down = Vec3(*self.eye), -corner, -right, -down
        if self.hole_radius is None:
            return PerspectiveView(eye, corner, right, down, self.clip)
        # All rays of a film point pass that point, as if a lens had its focus there, behind it.
        radius, slope = self.hole_radius, self.hole_radius / self.film_distance
        light = math.pi * slope**2 * (self.exposure or 0.0)
        return ThinLensView(
            eye, corner, right, down, vec3(-u), vec3(-v), radius, -slope, light, self.clip
        )
