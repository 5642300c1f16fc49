"""The tables of all types of lights, themselves or behind links."""

from typing import Any, NamedTuple

from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.jit.links import LINK, Link, declare
from reference_rt.lights.emitters import (
    area,
    constant,
    directional,
    environment_map,
    point,
    projector,
    spot,
)
from reference_rt.lights.emitters.area import Areas
from reference_rt.lights.emitters.constant import Environment
from reference_rt.lights.emitters.directional import Directionals
from reference_rt.lights.emitters.environment_map import AHEAD_FLOATS, EnvironmentMaps
from reference_rt.lights.emitters.point import Points
from reference_rt.lights.emitters.projector import Projectors
from reference_rt.lights.emitters.spot import Spots
from reference_rt.lights.light import (
    AREA,
    DIRECTIONAL,
    ENVIRONMENT,
    POINT,
    PROJECTOR,
    SPOT,
    LightSample,
)
from reference_rt.lights.selection.choice import LightSampler, LightTree


class Lights(NamedTuple):
    """The table of each type, None for types that the scene lacks.

    ambient (1, 3): the ambient radiance;  choice: the entries of the light sampler, None if no
    light can be picked;  tree: the light tree, None for few lights.  Entries are in this order: all
    areas, points, spots, projectors, directional lights, the environment.  So area light i is entry
    i.
    """

    points: Points | None
    spots: Spots | None
    projectors: Projectors | None
    directionals: Directionals | None
    areas: Areas | None
    environment: Environment | EnvironmentMaps | None
    ambient: FloatArray | None
    choice: LightSampler | None
    tree: LightTree | None


def _of_environment(name: str) -> Any:
    kernels = ByClass(name)
    kernels.register(Environment, getattr(constant, name))
    kernels.register(EnvironmentMaps, getattr(environment_map, name))
    return kernels.function


_radiance_of = _of_environment("radiance")
_density_of = _of_environment("pdf")
_sample_of = _of_environment("sample")


class _Surroundings:
    """The kernels of the environment, of either class."""

    @staticmethod
    @kernel
    def background(environment: Any, d: Vec3) -> Vec3:
        found: Vec3 = _radiance_of(environment, d)
        return found

    @staticmethod
    @kernel
    def environment_density(environment: Any, d: Vec3) -> float:
        found: float = _density_of(environment, d)
        return found

    @staticmethod
    @kernel
    def sample(environment: Any, u0: float, u1: float) -> LightSample:
        found: LightSample = _sample_of(environment, u0, u1)
        return found


declare(Lights, LINK)

TABLES: tuple[tuple[int, str, Any], ...] = (
    (AREA, "areas", area),
    (POINT, "points", point),
    (SPOT, "spots", spot),
    (PROJECTOR, "projectors", projector),
    (DIRECTIONAL, "directionals", directional),
    (ENVIRONMENT, "environment", _Surroundings),
)
"""(code, field of Lights, module with its kernels)."""

by_code = ByCode(TABLES)


class LinkedLights(NamedTuple):
    """`Lights` behind links.  emitters: to the tables of all types;  choice: without lights, of
    arrays of length 0;  tree: to the light tree, or to nothing;  ambient (1, 3)."""

    emitters: Link
    choice: LightSampler
    tree: Link
    ambient: FloatArray


def _for(name: str, of_lights: Any, of_linked: Any) -> Any:
    chosen = ByClass(name)
    chosen.register(Lights, of_lights)
    chosen.register(LinkedLights, of_linked)
    return chosen.function


@kernel
def _themselves(lights: Any) -> Any:
    return lights


@kernel
def _emitters_of(lights: LinkedLights) -> Link:
    return lights.emitters


emitters = _for("emitters", _themselves, _emitters_of)
"""emitters(lights): the tables, or the link to them."""


@kernel
def _point_matters(lights: Lights) -> bool:
    return lights.areas is not None or lights.tree is not None


@kernel
def _normal_matters(lights: Lights) -> bool:
    return lights.tree is not None


@kernel
def _always(lights: LinkedLights) -> bool:
    return True


depends_on_point = _for("depends_on_point", _point_matters, _always)
"""depends_on_point(lights): whether any probability or density depends on the point p: a
constant."""

depends_on_normal = _for("depends_on_normal", _normal_matters, _always)
"""depends_on_normal(lights): whether any probability depends on the normal n: a constant."""


@kernel
def _map_of(lights: Lights) -> EnvironmentMaps | None:
    found: EnvironmentMaps | None = _as_map(lights.environment)
    return found


@kernel
def _no_map(lights: Any) -> None:
    return None


_maps = ByClass("as_map")
_maps.register(EnvironmentMaps, _themselves)
_maps.register(Environment, _no_map)
_maps.register(type(None), _no_map)
_as_map = _maps.function

map_of = _for("map_of", _map_of, _no_map)
"""map_of(lights): the environment map whose light is computed ahead, None if there is none."""


@kernel
def ahead_of(lights: Any, numbers: FloatArray, j: int) -> environment_map.Ahead | None:
    """What was computed ahead for path j of a block; None where nothing is."""
    found: environment_map.Ahead | None = environment_map.ahead_of(map_of(lights), numbers, j)
    return found


@kernel
def sky_floats(lights: Any) -> int:
    """The size of the scratch buffer for what is computed ahead."""
    return _floats_for(map_of(lights))


@kernel
def _floats_for(sky: EnvironmentMaps | None) -> int:
    if sky is None:
        return 0
    return AHEAD_FLOATS


@kernel
def _any_areas(lights: Lights) -> bool:
    return lights.areas is not None


has_areas = _for("has_areas", _any_areas, _always)
"""has_areas(lights): whether a surface may be a light: a constant."""
