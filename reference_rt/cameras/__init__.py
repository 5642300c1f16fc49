"""All cameras: one file each; here, the choice among them.

To add a camera: its file with description, NamedTuple and kernel; `AnyCamera` and the registrations
below; a translator function in `comparisons.mitsuba.translate`; a scene; a row in the tests' tuple.
"""

from typing import Annotated

from pydantic import Field

from reference_rt.cameras import orthographic, perspective, thin_lens
from reference_rt.cameras.camera import LENS_CENTRE, no_lens
from reference_rt.cameras.orthographic import Orthographic, OrthographicView
from reference_rt.cameras.perspective import Perspective, PerspectiveView
from reference_rt.cameras.pinhole import Pinhole
from reference_rt.cameras.thin_lens import ThinLens, ThinLensView
from reference_rt.jit.kernel import ByClass

AnyCamera = Annotated[Perspective | Orthographic | Pinhole | ThinLens, Field(discriminator="type")]

VIEWS = (PerspectiveView, OrthographicView, ThinLensView)
"""What kernels see of cameras.  A pinhole's rays are those of a perspective view, whose class it
shares."""

_ray = ByClass("camera_ray")
_ray.register(PerspectiveView, perspective.camera_ray)
_ray.register(OrthographicView, orthographic.camera_ray)
_ray.register(ThinLensView, thin_lens.camera_ray)
camera_ray = _ray.function
"""camera_ray(view, x, y, lens) -> the ray of the film point (x, y), x to the right and y down, each
from 0 to 1 across the picture, through the point of the lens that `lens`, a pair in [0, 1), stands
for: LENS_CENTRE is its middle."""

_lens = ByClass("lens_sample")
_lens.register(PerspectiveView, no_lens)
_lens.register(OrthographicView, no_lens)
_lens.register(ThinLensView, thin_lens.lens_sample)
lens_sample = _lens.function
"""lens_sample(view, sampler) -> the `lens` for a sample's ray.  Draws for a camera with a lens."""

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
