"""All cameras: one file each; here, the choice among them.

To add a camera: its file with description, NamedTuple and kernel; `AnyCamera` and one registration
below; a translator function in `comparisons.translate`; a scene; a row in the tests' tuple.
"""

from typing import Annotated

from pydantic import Field

from reference_rt.cameras import orthographic, perspective
from reference_rt.cameras.orthographic import Orthographic, OrthographicView
from reference_rt.cameras.perspective import Perspective, PerspectiveView
from reference_rt.kernel import ByClass

AnyCamera = Annotated[Perspective | Orthographic, Field(discriminator="type")]

_ray = ByClass("camera_ray")
_ray.register(PerspectiveView, perspective.camera_ray)
_ray.register(OrthographicView, orthographic.camera_ray)
camera_ray = _ray.function
"""camera_ray(view, x, y) -> the ray through the film point (x, y): x to the right and y down, each
from 0 to 1 across the picture."""

__all__ = ["AnyCamera", "Orthographic", "Perspective", "camera_ray"]
