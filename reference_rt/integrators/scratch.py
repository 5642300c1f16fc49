"""A block of samples: the scratch of a band of pixels."""

from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import BLOCK
from reference_rt.core.ray_block import RAY_FLOATS, Hits, Rays
from reference_rt.jit.kernel import kernel

STATE_FLOATS = 11 * BLOCK
VECTOR_FLOATS = 3 * BLOCK


class Scratch(NamedTuple):
    """rays: from the eye at first;  totals (VECTOR_FLOATS,): the radiance along each of these.

    While an integrator works: shadows, rays that may be blocked, and the light (VECTOR_FLOATS,)
    that each brings to sample `lit` (BLOCK,);  hits;  states (STATE_FLOATS,) of paths, and the
    sample (BLOCK,) that each is of;  kept (`materials.kept_floats`,) for `shade`.
    """

    rays: Rays
    totals: FloatArray
    shadows: Rays
    lights: FloatArray
    lit: IntArray
    hits: Hits
    states: FloatArray
    samples: IntArray
    kept: FloatArray


@kernel
def prepare(scratch: Scratch) -> None:
    """Before the first rays.  Lanes without a ray are traced too, and memory that nobody has
    written may hold subnormal numbers, on which some processors are a hundred times slower."""
    for k in range(RAY_FLOATS):
        scratch.rays.numbers[k] = 1.0
        scratch.shadows.numbers[k] = 1.0
