"""Integrators: one file each; here, the dispatch among them.

Contract: a description (pydantic; `deterministic`: it draws no random numbers;
`follows_scattered`: BSDF-sampled rays collect emission too) whose `setup()` is a NamedTuple of
parameters, and a kernel for one ray, `radiance(setup, scene, ray, sampler)`, or one for a block of
rays, `radiances`.  It estimates the radiance in W sr^-1 m^-2, linear sRGB, that arrives at a ray's
origin from its (unit) direction; 0 is black.
`RayCast` has no such kernel: `ray_cast.cast` computes AOVs.  That of `Light` leaves out what
`light.trace_particles` adds.  Shared by all: `shading` (from a hit to the BSDF's input),
`direct_light` (one light sample, power heuristic), `scene_tables` (what kernels read),
`path.Scratch` (buffers of a block).

To add an integrator: its file with description, NamedTuple and kernel, and its line in
`AnyIntegrator`.
"""

from typing import Annotated, Any

from pydantic import Field

from reference_rt.core.model import module_of, setups_of
from reference_rt.core.ray import put_vector, ray_of
from reference_rt.integrators.direct import Direct as Direct
from reference_rt.integrators.light import Light as Light
from reference_rt.integrators.media_path import MediaPathSetup as MediaPathSetup
from reference_rt.integrators.path import Path as Path
from reference_rt.integrators.path import Scratch
from reference_rt.integrators.ray_cast import RayCast as RayCast
from reference_rt.integrators.scene_tables import KernelScene
from reference_rt.integrators.whitted import Whitted as Whitted
from reference_rt.integrators.whitted import WhittedSetup as WhittedSetup
from reference_rt.jit.kernel import by_class, kernel
from reference_rt.sampling import Samplers, sampler_of

AnyIntegrator = Annotated[RayCast | Whitted | Direct | Path | Light, Field(discriminator="type")]

SETUPS = (*setups_of(AnyIntegrator), MediaPathSetup)
"""The classes that `setup` returns, and that of paths through media."""


def setup_of(integrator: Whitted | Direct | Path | Light, has_numbers: bool) -> Any:
    """What `radiances` takes for an integrator: its own, or that of the path tracer that draws the
    same samples.  has_numbers: whether the sampler has random numbers."""
    if has_numbers and isinstance(integrator, Direct):
        return integrator.as_path() or integrator.setup()
    return integrator.setup()


def traces_blocks(setup: type) -> bool:
    """Whether an integrator, by the class of its setup, has a kernel for a block of rays."""
    return hasattr(module_of(setup), "radiances")


def _radiances_of(setup: type) -> Any:
    """The kernel `radiances` of an integrator; or, of one ray after another, `radiance`."""
    if traces_blocks(setup):
        return module_of(setup).radiances
    radiance = module_of(setup).radiance

    @kernel
    def one_by_one(
        setup: Any, scene: KernelScene, samplers: Samplers, n: int, scratch: Scratch
    ) -> None:
        for j in range(n):
            ray, sampler = ray_of(scratch.rays, j), sampler_of(samplers, j)
            put_vector(scratch.totals, 0, j, radiance(setup, scene, ray, sampler))

    return one_by_one


radiances = by_class("radiances", {setup: _radiances_of(setup) for setup in SETUPS})
"""radiances(setup, scene, samplers, n, scratch): estimates of the radiance along the first n of
`scratch.rays`, into `scratch.totals`."""
