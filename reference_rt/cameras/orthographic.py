"""Orthographic: parallel rays that start on the view rectangle."""

import math
from typing import Literal, NamedTuple

from reference_rt import transform
from reference_rt.cameras.camera import Camera
from reference_rt.description import Positive
from reference_rt.kernel import kernel
from reference_rt.ray import Ray
from reference_rt.vec3 import Vec3


class Orthographic(Camera):
    """A view rectangle around the eye, across the view direction; all rays are parallel."""

    type: Literal["orthographic"] = "orthographic"
    width: Positive = 2.0
    """Width of the view rectangle in scene units; its height follows from the picture's shape."""

    def view(self, width: int, height: int) -> "OrthographicView":
        basis = transform.look_at(self.eye, self.target, self.up)
        u, v, w = basis[:, 0], basis[:, 1], basis[:, 2]
        half_x = self.width / 2.0
        half_y = half_x * height / width
        return OrthographicView(
            Vec3(*(self.eye - half_x * u + half_y * v).tolist()),
            Vec3(*(2.0 * half_x * u).tolist()),
            Vec3(*(-2.0 * half_y * v).tolist()),
            Vec3(*(-w).tolist()),
        )


class OrthographicView(NamedTuple):
    """The top left corner of the view rectangle, its top and left edges, the unit direction."""

    corner: Vec3
    right: Vec3
    down: Vec3
    forward: Vec3


@kernel
def camera_ray(view: OrthographicView, x: float, y: float) -> Ray:
    """From (x, y) of the rectangle, forward (T2: u_s = l + (r - l)(i + 1/2) / n_x)."""
    return Ray(view.corner + view.right * x + view.down * y, view.forward, math.inf)
