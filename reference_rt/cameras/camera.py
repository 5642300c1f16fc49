"""What all cameras share: where they stand, and that most have no lens."""

from typing import Any, Self

from pydantic import model_validator

from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description, Direction, Vector
from reference_rt.jit.kernel import kernel
from reference_rt.sampling import Sample

LENS_CENTRE = (0.5, 0.5)
"""The lens sample that meets the middle of any lens."""


class Camera(Description):
    """An eye at `eye` that looks at `target`; `up` is up in the picture."""

    eye: Vector = (0.0, 0.0, 1.0)
    target: Vector = (0.0, 0.0, 0.0)
    up: Direction = (0.0, 1.0, 0.0)

    @model_validator(mode="after")
    def _stands_somewhere(self) -> Self:
        transform.look_at(self.eye, self.target, self.up)
        return self

    @property
    def basis(self) -> FloatArray:
        """(3, 3): the text-book's u, v, w as rows: right, up, and back from where it looks."""
        return transform.look_at(self.eye, self.target, self.up)[:, :3].T

    def setup(self, width: int, height: int) -> Any:
        """The camera as its kernel needs it, for a picture of width x height pixels."""
        raise NotImplementedError


@kernel
def no_lens(view: Any, sampler: Sample) -> tuple[float, float]:
    """For cameras whose rays all pass one point, or none: nothing is drawn."""
    return LENS_CENTRE
