"""The perspective camera: all rays pass one point, the eye."""

from typing import ClassVar, Literal, NamedTuple

from reference_rt.cameras.camera import Clip, Seen, clipped_ray, seen_through
from reference_rt.cameras.view_rectangle import CentralCamera, place
from reference_rt.core.model import Examples
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
