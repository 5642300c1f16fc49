"""A medium that is the same everywhere: fog, milk, coloured glass."""

import math
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from reference_rt.core.model import Colour, Description, Examples, Reflectance
from reference_rt.media.phase import AnyPhase, Isotropic


class Homogeneous(Description):
    """A medium that takes and scatters light alike at all points."""

    EXAMPLES: ClassVar[Examples] = (
        {"sigma_t": 0.5, "albedo": 0.9},
        {"sigma_t": (0.2, 0.5, 1.0), "albedo": (0.9, 0.8, 0.3), "phase": {"type": "hg", "g": 0.6}},
        {"sigma_t": (1.0, 0.5, 0.1), "albedo": 0.0, "scale": 2.0},
    )
    type: Literal["homogeneous"] = "homogeneous"
    sigma_t: Colour
    """The extinction coefficient: linear sRGB, each at least 0, in 1 / scene unit.  The share
    exp(-sigma_t t) of the light is left after the distance t."""
    albedo: Reflectance
    """The part of what is taken that is scattered, not absorbed: linear sRGB from 0 to 1."""
    scale: Annotated[float, Field(ge=0)] = 1.0
    """A factor on `sigma_t`, at least 0."""
    phase: AnyPhase = Isotropic()
    """The directions in which light is scattered.  Default: all alike."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not math.isfinite(max(self.sigma_t) * self.scale):
            raise ValueError("sigma_t times scale overflows; expected a finite product")
        return self
