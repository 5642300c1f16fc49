"""Samplers: numbers in [0, 1) that are pure functions of (seed, pixel, sample, dimension).

Samplers have no state: numbers can be drawn in any order, and an image is bit-identical for any
number of threads.  `warp.py` maps numbers to directions and points, `distribution.py` samples
tabulated densities by inversion.

A sampler's module has a `Description` with `spp` and `setup()`, which returns a NamedTuple for
kernels; start(setup, pixel, sample) -> a NamedTuple for one sample of one pixel (pixels counted
along rows, samples from 0); and draw(that, dimension) -> (u0, u1).  To add one: the module; below
its lines in `AnySampler` and `Sample`.
"""

from typing import Annotated, Any, NamedTuple, get_args

from pydantic import Field

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.model import module_of, setups_of
from reference_rt.jit.kernel import by_class, kernel
from reference_rt.sampling import blocks
from reference_rt.sampling.blocks import FLOATS as PAIR_FLOATS
from reference_rt.sampling.blocks import INTEGERS as PAIR_INTEGERS
from reference_rt.sampling.blocks import BlockSample
from reference_rt.sampling.grid import Grid, GridSample
from reference_rt.sampling.independent import Independent, IndependentSample
from reference_rt.sampling.sobol import GROUP, Sobol, SobolSample, SobolSetup

AnySampler = Annotated[Sobol | Independent | Grid, Field(discriminator="type")]

Sample = SobolSample | BlockSample | IndependentSample | GridSample
"""The sampler of one sample of one pixel."""

SETUPS = (*setups_of(AnySampler),)
"""The classes that `setup` returns."""

_MODULES = {sample: module_of(sample) for sample in get_args(Sample)}

# Every decision has a fixed dimension, so that the draws of one never shift the numbers of another.
# Each dimension gives a pair (u0, u1), stratified in the unit square. The pairs of one bounce, the
# PER_BOUNCE dimensions from PER_BOUNCE * bounce on, are also stratified jointly; those of the first
# bounce together with the film and the lens.
PER_BOUNCE = GROUP
FILM, LIGHT_AND_LOBE, LIGHT_POINT, BSDF_DIRECTION, LENS = range(PER_BOUNCE)
ROULETTE = PER_BOUNCE
"""The dimension of Russian roulette: each later bounce has it where the first one has FILM."""

start_sample = by_class("start_sample", {setup: module_of(setup).start for setup in SETUPS})
"""start_sample(setup, pixel, sample) -> the sampler of one sample of one pixel."""


@kernel
def _without_blocks(setup: Any, pixel: int, sample: int, pairs: FloatArray, made: IntArray) -> Any:
    return start_sample(setup, pixel, sample)


start_in_block = by_class(
    "start_in_block", dict.fromkeys(SETUPS, _without_blocks) | {SobolSetup: blocks.start}
)
"""start_in_block(setup, pixel, sample, pairs, made) -> a sampler with the same numbers, which
computes those of several samples of the pixel at once: see `Samplers`."""


class Samplers(NamedTuple):
    """The samplers of n samples: pixels (n,), and the samples' numbers (n,) in their pixels.

    Scratch buffers, a cache of pairs: pairs (PAIR_FLOATS,);  made (PAIR_INTEGERS,), -1 where
    nothing is cached.
    """

    setup: Any
    pixels: IntArray
    numbers: IntArray
    pairs: FloatArray
    made: IntArray


@kernel
def invalidate_pairs(samplers: Samplers) -> None:
    """Empties the cache of pairs: called before the first sample."""
    for k in range(PAIR_INTEGERS):
        samplers.made[k] = -1


@kernel
def sampler_of(samplers: Samplers, k: int) -> Sample:
    """The sampler of sample k.  Fastest in order of k: the numbers of several consecutive samples
    of a pixel are computed at once."""
    pixel, number = samplers.pixels[k], samplers.numbers[k]
    made: Sample = start_in_block(samplers.setup, pixel, number, samplers.pairs, samplers.made)
    return made


split_sample = by_class(
    "split_sample", {sample: of.split for sample, of in _MODULES.items() if hasattr(of, "split")}
)
"""split_sample(sampler, n, k) -> the sampler of part k of the n that a sample is split into.  With
Sobol' points the parts of all samples of a pixel are one sequence: n times as many points, which
are stratified together.  (Measured on soft shadows: 0.68 of the variance for two parts, 0.5 for
sixteen, of n sequences.)"""

draw_pair = by_class("draw_pair", {sample: of.draw for sample, of in _MODULES.items()})
"""draw_pair(sampler, dimension) -> (u0, u1), each in [0, 1)."""

__all__ = [
    "PAIR_FLOATS",
    "PAIR_INTEGERS",
    "AnySampler",
    "Grid",
    "Independent",
    "Sample",
    "Samplers",
    "Sobol",
    "draw_pair",
    "invalidate_pairs",
    "sampler_of",
    "split_sample",
    "start_in_block",
    "start_sample",
]
