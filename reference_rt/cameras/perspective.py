"""Perspective: all rays start at the eye and pass a view rectangle at distance 1."""

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from reference_rt import transform
from reference_rt.cameras.camera import Camera
from reference_rt.kernel import kernel
from reference_rt.ray import Ray
from reference_rt.vec3 import Vec3, normalize


class Perspective(Camera):
    """The simplified pinhole camera: d = s - e, with s on the view rectangle in front."""

    type: Literal["perspective"] = "perspective"
    fov: Annotated[float, Field(gt=0, lt=180)] = 45.0
    """Full angle of view in degrees along `fov_axis`."""
    fov_axis: Literal["x", "y", "smaller", "larger"] = "x"
    """The side of the picture that `fov` spans."""

    def view(self, width: int, height: int) -> "PerspectiveView":
        basis = transform.look_at(self.eye, self.target, self.up)
        half = math.tan(math.radians(self.fov) / 2.0)
        wide = width >= height
        spans_x = self.fov_axis == "x" or self.fov_axis == ("larger" if wide else "smaller")
        half_x = half if spans_x else half * width / height
        half_y = half * height / width if spans_x else half
        u, v, w = basis[:, 0], basis[:, 1], basis[:, 2]
        return PerspectiveView(
            Vec3(*self.eye),
            Vec3(*(-half_x * u + half_y * v - w).tolist()),
            Vec3(*(2.0 * half_x * u).tolist()),
            Vec3(*(-2.0 * half_y * v).tolist()),
        )


class PerspectiveView(NamedTuple):
    """eye; the direction to the top left corner of the view rectangle; its top and left edges."""

    eye: Vec3
    corner: Vec3
    right: Vec3
    down: Vec3


@kernel
def camera_ray(view: PerspectiveView, x: float, y: float) -> Ray:
    """From the eye through (x, y) of the rectangle; unit direction."""
    return Ray(view.eye, normalize(view.corner + view.right * x + view.down * y), math.inf)
