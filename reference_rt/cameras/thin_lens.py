"""Thin-lens camera: perspective through a round lens, in focus in one plane."""

import math
from typing import ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from reference_rt.cameras.camera import Clip, Seen, clipped_ray, seen_through
from reference_rt.cameras.view_rectangle import STEEPEST, CentralCamera, place, vec3
from reference_rt.core.model import Examples, Positive
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, cross, dot
from reference_rt.jit.kernel import kernel
from reference_rt.sampling.warp import concentric_disk

HAS_LENS = True


class ThinLens(CentralCamera):
    """A perspective camera with an ideal lens: what is not in the plane of focus is blurred (Cook
    et al. 1984).

    Where no random numbers are drawn (by ray casting, and on a `grid`) every ray passes the lens's
    centre, and everything is sharp.
    """

    EXAMPLES: ClassVar[Examples] = (
        {"aperture_radius": 0.1},
        {"aperture_radius": 0.2, "focus_distance": 3.0, "fov": 60.0, "fov_axis": "y"},
        {"aperture_radius": 0.2, "view": (-1.0, 2.0, -0.5, 1.0), "distance": 2.0},
    )
    type: Literal["thin_lens"] = "thin_lens"
    aperture_radius: Positive
    """Radius of the lens in scene units: larger ones blur more out of focus."""
    focus_distance: Positive | None = None
    """Distance from the lens to the plane in focus, along the view direction, in scene units.
    Default: the plane through `target`."""

    @model_validator(mode="after")
    def _check_focus(self) -> Self:
        if not self.aperture_radius / self.focus <= STEEPEST:
            raise ValueError(
                "the lens is too wide for its focus; expected a larger 'focus_distance' or a "
                "smaller 'aperture_radius'"
            )
        return self

    @property
    def focus(self) -> float:
        """The focus distance, or its default."""
        return self.focus_distance or math.dist(self.eye, self.target)

    def setup(self, width: int, height: int) -> "ThinLensView":
        u, v, _ = basis = self.basis
        return ThinLensView(
            Vec3(*self.eye),
            *place(self.rectangle(width, height), basis, 1.0),
            vec3(u),
            vec3(v),
            self.aperture_radius,
            self.aperture_radius / self.focus,
            0.0,
            self.clip,
        )


class ThinLensView(NamedTuple):
    """eye, corner, right, down: as in `PerspectiveView`, at distance 1;  u, v: unit axes of the
    lens;  radius: its radius;  slope: radius / focus distance, below 0 for a focus behind the
    lens;  exposure: what a pixel shows of a radiance that fills the lens is this times cos^4 of the
    angle to the axis, or the radiance itself for 0;  clip: the clipping planes."""

    eye: Vec3
    corner: Vec3
    right: Vec3
    down: Vec3
    u: Vec3
    v: Vec3
    radius: float
    slope: float
    exposure: float
    clip: Clip


@kernel
def _on_lens(view: ThinLensView, lens: tuple[float, float]) -> Vec3:
    """A point of the lens from its centre, over its radius."""
    a, b = concentric_disk(lens[0], lens[1])
    return view.u * a + view.v * b


@kernel
def camera_ray(view: ThinLensView, x: float, y: float, lens: tuple[float, float]) -> Ray:
    """The ray from a lens point q to the point where the ray through the lens's centre meets the
    plane of focus.

    With s of length 1 along the axis, that point is e + f s and the direction f s - q.  Divided by
    f, s - q / f, it needs no sum with the eye, and does not overflow however far the focus is.
    """
    q = _on_lens(view, lens)
    s = view.corner + view.right * x + view.down * y
    return clipped_ray(view.clip, view.eye + q * view.radius, s - q * view.slope)


@kernel
def see(view: ThinLensView, p: Vec3, lens: tuple[float, float]) -> Seen:
    """The point `p` as the lens point for `lens` sees it.  Lens points are uniform, and a pixel is
    the mean over the lens, or what the film's exposure shows of it."""
    q = _on_lens(view, lens)
    o, shift = view.eye + q * view.radius, q * view.slope
    seen = seen_through(view.clip, o, view.corner, view.right, view.down, shift, p)
    if view.exposure == 0.0:
        return seen
    cosine = dot(seen.d, cross(view.v, view.u))
    shown = view.exposure * (cosine * cosine) * (cosine * cosine)
    return Seen(seen.x, seen.y, seen.weight * shown, seen.o, seen.d)
