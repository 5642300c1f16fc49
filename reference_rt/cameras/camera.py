"""What all cameras share: position and orientation; and `no_lens`, for most of them."""

from typing import Any, Self

from pydantic import model_validator

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description, Direction, Vector
from reference_rt.jit.kernel import kernel
from reference_rt.sampling import Sample

LENS_CENTRE = (0.5, 0.5)
"""The lens sample of the centre of any lens."""


class Camera(Description):
    """A camera at `eye` that looks at `target`; `up` is up in the picture."""

    eye: Vector = (0.0, 0.0, 1.0)
    """Where the camera stands: [x, y, z] in world coordinates, in scene units."""
    target: Vector = (0.0, 0.0, 0.0)
    """The point that the camera looks at: [x, y, z] in world coordinates, not the eye."""
    up: Direction = (0.0, 1.0, 0.0)
    """The direction that points up in the picture: world coordinates, of any length, not parallel
    to the line of view."""

    @model_validator(mode="after")
    def _check_orientation(self) -> Self:
        transform.look_at(self.eye, self.target, self.up)
        return self

    @property
    def basis(self) -> FloatArray:
        """(3, 3), orthonormal: the textbook's u, v, w as rows: right, up and backward."""
        return transform.look_at(self.eye, self.target, self.up)[:, :3].T

    def setup(self, width: int, height: int) -> Any:
        """The NamedTuple that `camera_ray` takes, for a picture of width x height pixels."""
        raise NotImplementedError


@kernel
def no_lens(view: Any, sampler: Sample) -> tuple[float, float]:
    """The `lens_sample` of cameras without a lens: draws nothing."""
    return LENS_CENTRE
