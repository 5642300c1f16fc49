"""Integrators: one file each; here, the dispatch among them.

Contract: a description (pydantic; `deterministic`: it draws no random numbers;
`follows_scattered`: BSDF-sampled rays collect emission too) whose `setup()` is a NamedTuple of
parameters, and a kernel for one ray, `radiance(setup, scene, ray, sampler)`, or one for a block of
rays, `radiances`.  It estimates the radiance in W sr^-1 m^-2, linear sRGB, that arrives at a ray's
origin from its (unit) direction; 0 is black.
`RayCast` alone has no such kernel: `ray_cast.cast` computes AOVs.  Shared by all: `shading` (from a
hit to the BSDF's input), `direct_light` (one light sample, power heuristic), `scene_tables` (what
kernels read), `path.Scratch` (buffers of a block).

To add an integrator: its file with description, NamedTuple and kernel; `AnyIntegrator` and its
registrations below; its counterpart in `comparisons`.
"""

from typing import Annotated, Any

from pydantic import Field

from reference_rt.core.ray import put_vector, ray_of
from reference_rt.integrators import direct, path, whitted
from reference_rt.integrators.direct import Direct, DirectSetup
from reference_rt.integrators.path import Path, PathSetup, Scratch
from reference_rt.integrators.ray_cast import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.integrators.whitted import Whitted, WhittedSetup
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.sampling import Samplers, sampler_of

AnyIntegrator = Annotated[RayCast | Whitted | Direct | Path, Field(discriminator="type")]

INTEGRATORS: dict[type, str] = {PathSetup: "path", DirectSetup: "direct", WhittedSetup: "whitted"}
"""The names of the integrators, by the classes of their setups."""


def setup_of(integrator: Whitted | Direct | Path, has_numbers: bool) -> Any:
    """What `radiances` takes for an integrator: its own, or that of the path tracer that draws the
    same samples.  has_numbers: whether the sampler has random numbers."""
    if has_numbers and isinstance(integrator, Direct):
        return integrator.as_path() or integrator.setup()
    return integrator.setup()


@kernel
def _one_by_one(
    setup: Any, scene: SceneTables, samplers: Samplers, n: int, scratch: Scratch
) -> None:
    for j in range(n):
        ray, sampler = ray_of(scratch.rays, j), sampler_of(samplers, j)
        put_vector(scratch.totals, 0, j, whitted.radiance(setup, scene, ray, sampler))


_radiances = ByClass("radiances")
_radiances.register(PathSetup, path.radiances)
_radiances.register(DirectSetup, direct.radiances)
_radiances.register(WhittedSetup, _one_by_one)
radiances = _radiances.function
"""radiances(setup, scene, samplers, n, scratch): estimates of the radiance along the first n of
`scratch.rays`, into `scratch.totals`."""

__all__ = [
    "AnyIntegrator",
    "Direct",
    "Path",
    "RayCast",
    "Whitted",
    "WhittedSetup",
    "radiances",
    "setup_of",
]
