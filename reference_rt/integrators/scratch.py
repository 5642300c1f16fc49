"""Scratch buffers for one block of samples, reused for all blocks of a tile."""

from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import BLOCK
from reference_rt.core.ray_block import RAY_FLOATS, HitBlock, RayBlock
from reference_rt.jit.kernel import kernel

STATE_FLOATS = 11 * BLOCK
VECTOR_FLOATS = 3 * BLOCK


class Scratch(NamedTuple):
    """rays: input, the camera rays; integrators overwrite them;  totals (VECTOR_FLOATS,): output,
    the radiance along each camera ray.

    Buffers of integrators: shadows, the shadow rays; for each of them lights (VECTOR_FLOATS,), what
    it adds if it is not occluded, and lit (BLOCK,), the sample that it belongs to;  hits;  states
    (STATE_FLOATS,) of the active paths and samples (BLOCK,), the sample of each;  kept
    (`materials.scratch_floats`,), the buffer of `shade`.
    """

    rays: RayBlock
    totals: FloatArray
    shadows: RayBlock
    lights: FloatArray
    lit: IntArray
    hits: HitBlock
    states: FloatArray
    samples: IntArray
    kept: FloatArray


@kernel
def prepare(scratch: Scratch) -> None:
    """Initialise the rays.  Vector lanes without a ray are traced too, and uninitialised memory may
    hold subnormal numbers, on which some processors are a hundred times slower."""
    for k in range(RAY_FLOATS):
        scratch.rays.numbers[k] = 1.0
        scratch.shadows.numbers[k] = 1.0
