"""Independent sampler: each number is a hash of (seed, pixel, sample, dimension)."""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

from reference_rt.core.model import Description
from reference_rt.jit.kernel import kernel
from reference_rt.sampling.hashing import LOW32, combine, mix

_32 = np.uint64(32)


class Independent(Description):
    """Independent uniform random numbers: the plain Monte Carlo baseline."""

    type: Literal["independent"] = "independent"
    spp: Annotated[int, Field(ge=1, le=2**31)] = 16
    """Samples per pixel."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    """Selects the random numbers: pictures of different seeds are independent."""

    def setup(self) -> "IndependentSetup":
        return IndependentSetup(np.uint64(self.seed))


class IndependentSetup(NamedTuple):
    seed: np.uint64


class IndependentSample(NamedTuple):
    """key: a hash of seed, pixel and sample."""

    key: np.uint64


@kernel
def start(setup: IndependentSetup, pixel: int, sample: int) -> IndependentSample:
    return IndependentSample(combine(combine(setup.seed, np.uint64(pixel)), np.uint64(sample)))


@kernel
def draw(sampler: IndependentSample, dimension: int) -> tuple[float, float]:
    """Two multiples of 2^-32 plus 2^-33, the middles of cells: never 0, never 1."""
    h = mix(sampler.key + np.uint64(dimension + 1) * np.uint64(0x9E3779B97F4A7C15))
    return (float(h >> _32) + 0.5) * 2.0**-32, (float(h & LOW32) + 0.5) * 2.0**-32
