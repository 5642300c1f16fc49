"""Samplers: numbers that are pure functions of (seed, pixel, sample, dimension).

No state: any pixel's numbers can be had in any order, so that an image is bit-identical for any
number of threads.  To add a sampler: its file with description, NamedTuples and kernels; the lines
below.
"""

from typing import Annotated, Any, NamedTuple

from pydantic import Field

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.sampling import blocks, grid, independent, sobol
from reference_rt.sampling.blocks import FLOATS as PAIR_FLOATS
from reference_rt.sampling.blocks import INTEGERS as PAIR_INTEGERS
from reference_rt.sampling.blocks import BlockSample
from reference_rt.sampling.grid import Grid, GridSample, GridSetup
from reference_rt.sampling.independent import Independent, IndependentSample, IndependentSetup
from reference_rt.sampling.orders import GROUP
from reference_rt.sampling.sobol import Sobol, SobolSample, SobolSetup

AnySampler = Annotated[Sobol | Independent | Grid, Field(discriminator="type")]

Sample = SobolSample | BlockSample | IndependentSample | GridSample
"""The numbers of one sample of one pixel."""

# Dimensions are fixed, so that what one decision draws never shifts another's numbers. A pair
# takes one number: (u0, u1) of dimension k are stratified in the unit square. Those of a bounce,
# from PER_BOUNCE times its number on, are so jointly: the first's with the film and the lens.
PER_BOUNCE = GROUP
FILM, LIGHT_AND_LOBE, LIGHT_POINT, BSDF_DIRECTION, LENS = range(PER_BOUNCE)
ROULETTE = PER_BOUNCE
"""Whether there is a next bounce: in the place that the film has in the first."""

_start = ByClass("start_sample")
_start.register(SobolSetup, sobol.start)
_start.register(IndependentSetup, independent.start)
_start.register(GridSetup, grid.start)
start_sample = _start.function
"""start_sample(setup, pixel, sample) -> the sampler of one sample of one pixel."""


@kernel
def _without_blocks(setup: Any, pixel: int, sample: int, pairs: FloatArray, made: IntArray) -> Any:
    return start_sample(setup, pixel, sample)


_start_in_block = ByClass("start_in_block")
_start_in_block.register(SobolSetup, blocks.start)
_start_in_block.register(IndependentSetup, _without_blocks)
_start_in_block.register(GridSetup, _without_blocks)
start_in_block = _start_in_block.function
"""start_in_block(setup, pixel, sample, pairs, made) -> a sampler of the same numbers, which draws
those of several samples of the pixel at once: see `Samplers`."""


class Samplers(NamedTuple):
    """The samplers of some samples: their pixels (n,) and their numbers (n,) in these.

    Scratch: pairs (PAIR_FLOATS,), and made (PAIR_INTEGERS,), -1 before the first is drawn.
    """

    setup: Any
    pixels: IntArray
    numbers: IntArray
    pairs: FloatArray
    made: IntArray


@kernel
def forget_pairs(samplers: Samplers) -> None:
    """Before the first sample."""
    for k in range(PAIR_INTEGERS):
        samplers.made[k] = -1


@kernel
def sampler_of(samplers: Samplers, k: int) -> Sample:
    """That of sample k, to be taken one after another: a pixel's are drawn several at once."""
    pixel, number = samplers.pixels[k], samplers.numbers[k]
    made: Sample = start_in_block(samplers.setup, pixel, number, samplers.pairs, samplers.made)
    return made


_draw = ByClass("draw_pair")
_draw.register(SobolSample, sobol.draw)
_draw.register(BlockSample, blocks.draw)
_draw.register(IndependentSample, independent.draw)
_draw.register(GridSample, grid.draw)
draw_pair = _draw.function
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
    "forget_pairs",
    "sampler_of",
    "start_in_block",
    "start_sample",
]
