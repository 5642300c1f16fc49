"""What all cameras share: where they stand, and the text-book's view rectangle."""

from typing import Any, Self

from pydantic import model_validator

from reference_rt import transform
from reference_rt.description import Description, Direction, Vector


class Camera(Description):
    """An eye at `eye` that looks at `target`; `up` is up in the picture."""

    eye: Vector = (0.0, 0.0, 1.0)
    target: Vector = (0.0, 0.0, 0.0)
    up: Direction = (0.0, 1.0, 0.0)

    @model_validator(mode="after")
    def _stands_somewhere(self) -> Self:
        transform.look_at(self.eye, self.target, self.up)
        return self

    def view(self, width: int, height: int) -> Any:
        """The camera as its kernel needs it, for a picture of width x height pixels."""
        raise NotImplementedError
