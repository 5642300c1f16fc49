"""All integrators: one file each; here, the choice among them.

To add an integrator: its file with description, NamedTuple and `radiance` kernel; `AnyIntegrator`
and one registration below; a twin in `comparisons`.
"""

from typing import Annotated, Any

from pydantic import Field

from reference_rt.core.ray_block import put_vector, ray_of
from reference_rt.integrators import direct, path, whitted
from reference_rt.integrators.direct import Direct, DirectSetup
from reference_rt.integrators.path import Path, PathSetup
from reference_rt.integrators.ray_cast import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.integrators.scratch import Scratch
from reference_rt.integrators.whitted import Whitted, WhittedSetup
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.sampling import Samplers, sampler_of

AnyIntegrator = Annotated[RayCast | Whitted | Direct | Path, Field(discriminator="type")]

_radiance = ByClass("radiance")
_radiance.register(PathSetup, path.radiance)
_radiance.register(DirectSetup, direct.radiance)
_radiance.register(WhittedSetup, whitted.radiance)
radiance = _radiance.function
"""radiance(setup, scene, ray, sampler) -> Vec3, W sr^-1 m^-2."""


@kernel
def _one_by_one(
    setup: Any, scene: SceneTables, samplers: Samplers, n: int, scratch: Scratch
) -> None:
    for j in range(n):
        ray = ray_of(scratch.rays, j)
        put_vector(scratch.totals, 0, j, radiance(setup, scene, ray, sampler_of(samplers, j)))


_radiances = ByClass("radiances")
_radiances.register(PathSetup, path.radiances)
_radiances.register(DirectSetup, _one_by_one)
_radiances.register(WhittedSetup, _one_by_one)
radiances = _radiances.function
"""radiances(setup, scene, samplers, n, scratch): `radiance` of the first n of `scratch.rays`, into
`scratch.totals`."""

__all__ = ["AnyIntegrator", "Direct", "Path", "RayCast", "Whitted", "radiance", "radiances"]
