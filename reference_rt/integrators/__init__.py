"""All integrators: one file each; here, the choice among them.

To add an integrator: its file with description, NamedTuple and `radiance` kernel; `AnyIntegrator`
and one registration below; a twin in `comparisons`.
"""

from typing import Annotated

from pydantic import Field

from reference_rt.integrators import direct, path, whitted
from reference_rt.integrators.direct import Direct, DirectSetup
from reference_rt.integrators.path import Path, PathSetup
from reference_rt.integrators.ray_cast import RayCast
from reference_rt.integrators.whitted import Whitted, WhittedSetup
from reference_rt.kernel import ByClass

AnyIntegrator = Annotated[RayCast | Whitted | Direct | Path, Field(discriminator="type")]

_radiance = ByClass("radiance")
_radiance.register(PathSetup, path.radiance)
_radiance.register(DirectSetup, direct.radiance)
_radiance.register(WhittedSetup, whitted.radiance)
radiance = _radiance.function
"""radiance(setup, scene, ray, sampler) -> Vec3, W sr^-1 m^-2."""

__all__ = ["AnyIntegrator", "Direct", "Path", "RayCast", "Whitted", "radiance"]
