"""Independent sampler: each number is a hash of (seed, pixel, sample, dimension)."""

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from reference_rt.core.model import Description, Examples
from reference_rt.jit.kernel import kernel


class Independent(Description):
    """Independent uniform random numbers: the plain Monte Carlo baseline."""

    EXAMPLES: ClassVar[Examples] = ({"spp": 4}, {"spp": 4, "seed": 3})
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
def split(sampler: IndependentSample, n: int, k: int) -> IndependentSample:
    return IndependentSample(combine(sampler.key, np.uint64(k))) if n > 1 else sampler


@kernel
def draw(sampler: IndependentSample, dimension: int) -> tuple[float, float]:
    """Two multiples of 2^-32 plus 2^-33, the middles of cells: never 0, never 1."""
    h = mix(sampler.key + np.uint64(dimension + 1) * np.uint64(0x9E3779B97F4A7C15))
    return (float(h >> np.uint64(32)) + 0.5) * 2.0**-32, (float(h & LOW32) + 0.5) * 2.0**-32


# ---- hashes --------------------------------------------------------------------------------------
# In uint64 arithmetic, with the same results in compiled code and plain Python.

LOW32 = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)
_30, _27, _31 = np.uint64(30), np.uint64(27), np.uint64(31)
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_M1, _M2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)


@kernel
def mix(x: np.uint64) -> np.uint64:
    """A bijection of 64 bits in which each input bit affects each output bit (splitmix64's
    finaliser: Stafford 2011, variant 13)."""
    x = (x ^ (x >> _30)) * _M1
    x = (x ^ (x >> _27)) * _M2
    return x ^ (x >> _31)


@kernel
def combine(a: np.uint64, b: np.uint64) -> np.uint64:
    """A hash of an ordered pair."""
    return mix(a ^ mix(b + _GOLDEN))
