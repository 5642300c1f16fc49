"""The kernel of particles: what each thread runs beside that of `tiles` for the integrator `light`.

Particles are numbered as samples are: number `sample` of `pixel`, so that each has numbers of its
own.  Where it is seen does not depend on that pixel.
"""

from typing import Any

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import (
    BLOCK,
    HIT_FLOATS,
    HIT_INTEGERS,
    POINT_FLOATS,
    POINT_INTEGERS,
    RAY_FLOATS,
    HitBlock,
    PointBlock,
    RayBlock,
)
from reference_rt.integrators.light import (
    DRAWN_FLOATS,
    SEEN_FLOATS,
    LightScratch,
    LightSetup,
    Target,
    trace_particles,
)
from reference_rt.integrators.path import STATE_FLOATS, VECTOR_FLOATS, Scratch, prepare
from reference_rt.integrators.scene_tables import KernelScene
from reference_rt.jit.kernel import entry_kernel, local_floats, local_integers
from reference_rt.lights import LIGHT_FLOATS, LIGHT_INTEGERS, LightBlock
from reference_rt.lights.emission import Emission
from reference_rt.materials import SCATTER_FLOATS, SCATTER_INTEGERS, ScatterBlock, scratch_floats
from reference_rt.rendering.tiles import View
from reference_rt.sampling import PAIR_FLOATS, PAIR_INTEGERS, Samplers, invalidate_pairs


@entry_kernel
def splat_tile(
    light: LightSetup,
    emission: Emission,
    scene: KernelScene,
    view: View,
    film_filter: Any,
    sampler_setup: Any,
    shape: tuple[int, int],
    out: FloatArray,
    begin: int,
    end: int,
    first: int,
    last: int,
) -> None:
    """Radiance by the particles of some pixels: its sums over particles in out (pixels, 3), of the
    whole picture."""
    scratch = Scratch(
        rays=RayBlock(local_floats(RAY_FLOATS)),
        totals=local_floats(0),
        shadows=RayBlock(local_floats(RAY_FLOATS)),
        arriving=local_floats(VECTOR_FLOATS),
        of=local_integers(0),
        hits=HitBlock(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS)),
        states=local_floats(STATE_FLOATS),
        samples=local_integers(BLOCK),
        kept=local_floats(scratch_floats(scene.materials)),
        points=PointBlock(local_floats(POINT_FLOATS), local_integers(POINT_INTEGERS)),
        lit=LightBlock(local_floats(LIGHT_FLOATS), local_integers(LIGHT_INTEGERS)),
        scattered=ScatterBlock(local_floats(SCATTER_FLOATS), local_integers(SCATTER_INTEGERS)),
    )
    more = LightScratch(
        towards=RayBlock(local_floats(RAY_FLOATS)),
        blocked=HitBlock(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS)),
        drawn=local_floats(DRAWN_FLOATS),
        seen=local_floats(SEEN_FLOATS),
    )
    samplers = Samplers(
        sampler_setup,
        local_integers(BLOCK),
        local_integers(BLOCK),
        local_floats(PAIR_FLOATS),
        local_integers(PAIR_INTEGERS),
    )
    prepare(scratch)
    invalidate_pairs(samplers)
    target = Target(view.link, view.has_lens, film_filter, shape, out)
    count = last - first
    particles = (end - begin) * count
    for start in range(0, particles, BLOCK):
        n = min(BLOCK, particles - start)
        for k in range(n):
            samplers.pixels[k] = begin + (start + k) // count
            samplers.numbers[k] = first + (start + k) % count
        trace_particles(light, scene, emission, target, samplers, n, scratch, more)
