"""Cameras, and the film: picture size, layers and reconstruction filters.

A camera has a `Camera` description, in scene units and degrees, with
`setup(width, height)` for a picture of that many pixels, which returns a NamedTuple (a *view*); the
kernel camera_ray(view, x, y, lens) -> `Ray` with a unit direction and no end, for the film point
(x, y), each in [0, 1] across the picture from its top left corner; and, for a camera with a lens,
lens_sample(view, sampler), which draws the lens point.

To add a camera: its description and kernel, in a module that has no other `camera_ray`; `AnyCamera`
and the registrations below; a translator function in `comparisons.translator`; a scene; a
row in the tests' tuple.
"""

from typing import Annotated, Any

from pydantic import Field

from reference_rt.cameras import orthographic, perspective, thin_lens
from reference_rt.cameras.camera import LENS_CENTRE, no_lens
from reference_rt.cameras.orthographic import Orthographic, OrthographicView
from reference_rt.cameras.perspective import Perspective, PerspectiveView, Pinhole
from reference_rt.cameras.thin_lens import ThinLens, ThinLensView
from reference_rt.core.ray import Ray
from reference_rt.jit.kernel import ByClass
from reference_rt.jit.links import Linkable

AnyCamera = Annotated[Perspective | Orthographic | Pinhole | ThinLens, Field(discriminator="type")]

VIEWS = (PerspectiveView, OrthographicView, ThinLensView)
"""The classes that `setup` returns.  `Pinhole` has no own one: its rays are those of a
`PerspectiveView`."""

_ray = ByClass("camera_ray")
_ray.register(PerspectiveView, perspective.camera_ray)
_ray.register(OrthographicView, orthographic.camera_ray)
_ray.register(ThinLensView, thin_lens.camera_ray)
_ray_of = _ray.function

views = Linkable()
"""The operation `camera_ray`, on a view or on a link to one."""


@views.operation
def camera_ray(view: Any, x: float, y: float, lens: tuple[float, float]) -> Ray:
    """The ray of the film point (x, y), x to the right and y down, each from 0 to 1 across the
    picture, through the lens point for `lens`, a pair in [0, 1); LENS_CENTRE gives the centre of
    the lens."""
    ray: Ray = _ray_of(view, x, y, lens)
    return ray


_lens = ByClass("lens_sample")
_lens.register(PerspectiveView, no_lens)
_lens.register(OrthographicView, no_lens)
_lens.register(ThinLensView, thin_lens.lens_sample)
lens_sample = _lens.function
"""lens_sample(view, sampler) -> `lens` for a sample's ray: drawn for a camera with a lens, else
LENS_CENTRE."""

__all__ = [
    "LENS_CENTRE",
    "VIEWS",
    "AnyCamera",
    "Orthographic",
    "Perspective",
    "Pinhole",
    "ThinLens",
    "camera_ray",
    "lens_sample",
]
