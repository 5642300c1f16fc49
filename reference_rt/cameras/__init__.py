"""Cameras, and the film: picture size, layers and reconstruction filters.

A camera has a `Camera` description, in scene units and degrees, with
`setup(width, height)` for a picture of that many pixels, which returns a NamedTuple (a *view*); the
kernel camera_ray(view, x, y, lens) -> `Ray` with a unit direction and no end, for the film point
(x, y), each in [0, 1] across the picture from its top left corner, and the lens point for `lens`, a
pair of random numbers; and its inverse, see(view, p, lens) -> `Seen`.  The module of a camera with
a lens says so: HAS_LENS; for others it is LENS_CENTRE.

To add a camera: its description and kernels, in a module that has no other `camera_ray` or `see`,
and its line in `AnyCamera`.
"""

from typing import Annotated, Any

from pydantic import Field

from reference_rt.cameras.camera import LENS_CENTRE as LENS_CENTRE
from reference_rt.cameras.camera import Seen as Seen
from reference_rt.cameras.orthographic import Orthographic as Orthographic
from reference_rt.cameras.perspective import Perspective as Perspective
from reference_rt.cameras.pinhole import Pinhole as Pinhole
from reference_rt.cameras.thin_lens import ThinLens as ThinLens
from reference_rt.core.model import module_of, setups_of
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import by_class
from reference_rt.jit.links import Linkable

AnyCamera = Annotated[Perspective | Orthographic | Pinhole | ThinLens, Field(discriminator="type")]

VIEWS = (*setups_of(AnyCamera),)
"""The classes that `setup` returns.  `Pinhole` has no own one."""

_ray_of = by_class("camera_ray", {view: module_of(view).camera_ray for view in VIEWS})

_see_of = by_class("see", {view: module_of(view).see for view in VIEWS})

views = Linkable()
"""The operations `camera_ray` and `see`, on a view or on a link to one."""


@views.operation
def camera_ray(view: Any, x: float, y: float, lens: tuple[float, float]) -> Ray:
    """The ray of the film point (x, y), x to the right and y down, each from 0 to 1 across the
    picture, through the lens point for `lens`, a pair in [0, 1); LENS_CENTRE gives the centre of
    the lens."""
    ray: Ray = _ray_of(view, x, y, lens)
    return ray


@views.operation
def see(view: Any, p: Vec3, lens: tuple[float, float]) -> Seen:
    """The film point whose ray through the lens point for `lens` meets the point `p`."""
    found: Seen = _see_of(view, p, lens)
    return found


def has_lens(view: Any) -> bool:
    """Whether lens points are drawn for a camera."""
    return getattr(module_of(type(view)), "HAS_LENS", False)
