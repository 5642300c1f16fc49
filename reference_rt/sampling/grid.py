"""Grid sampler: n x n fixed points in each pixel, for integrators that draw no random numbers."""

import math
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import AfterValidator, Field

from reference_rt.core.model import Description, Examples
from reference_rt.jit.kernel import kernel


def _square(n: int) -> int:
    if math.isqrt(n) ** 2 != n:
        raise ValueError(f"expected a square number of samples (1, 4, 9, ...), got {n}")
    return n


class Grid(Description):
    """The centres of n x n equal cells of the pixel, without random numbers: for deterministic
    integrators, and for `direct` where all lights are points, spots, goniometric, projectors or
    directional."""

    EXAMPLES: ClassVar[Examples] = ({}, {"spp": 4})
    type: Literal["grid"] = "grid"
    spp: Annotated[int, Field(ge=1, le=2**31), AfterValidator(_square)] = 1
    """Samples per pixel: the square of a whole number."""

    def setup(self) -> "GridSetup":
        return GridSetup(math.isqrt(self.spp))


class GridSetup(NamedTuple):
    """n: the points along each side of the pixel."""

    n: int


class GridSample(NamedTuple):
    """x, y: the sample's position in its pixel, in [0, 1)."""

    x: float
    y: float


@kernel
def start(setup: GridSetup, pixel: int, sample: int) -> GridSample:
    row, column = sample // setup.n, sample % setup.n
    return GridSample((column + 0.5) / setup.n, (row + 0.5) / setup.n)


@kernel
def draw(sampler: GridSample, dimension: int) -> tuple[float, float]:
    """The position in the pixel for dimension 0 (the film), else (1/2, 1/2)."""
    if dimension == 0:
        return sampler.x, sampler.y
    return 0.5, 0.5
