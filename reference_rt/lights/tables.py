"""The register of lights: their descriptions, and their tables, themselves or behind links.

A new light has a line in `AnyLight` and, unless it surrounds the scene, one in `Lights`; all else
follows from these two.  Its import as itself makes it a name of `reference_rt.lights`.
"""

from typing import Annotated, Any, NamedTuple, get_args

from pydantic import Field

from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.by_code import ByCode, described_in, tables_of
from reference_rt.jit.kernel import by_class, kernel
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
from reference_rt.lights.emitters.constant import Ambient as Ambient
from reference_rt.lights.emitters.constant import Constant as Constant
from reference_rt.lights.emitters.constant import Environment
from reference_rt.lights.emitters.directional import Directional as Directional
from reference_rt.lights.emitters.environment_map import AHEAD_FLOATS, EnvironmentMaps
from reference_rt.lights.emitters.environment_map import EnvironmentMap as EnvironmentMap
from reference_rt.lights.emitters.point import Point as Point
from reference_rt.lights.emitters.projector import Projector as Projector
from reference_rt.lights.emitters.spot import Spot as Spot
from reference_rt.lights.light import LightSample
from reference_rt.lights.selection.choice import LightSampler, LightTree

AnyLight = Annotated[
    Point | Spot | Projector | Directional | Constant | EnvironmentMap | Ambient,
    Field(discriminator="type"),
]


def _of_environment(name: str) -> Any:
    modules = {Environment: constant, EnvironmentMaps: environment_map}
    return by_class(name, {table: getattr(module, name) for table, module in modules.items()})


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


class Lights(NamedTuple):
    """The table of each type, None for types that the scene lacks.

    ambient (1, 3): the ambient radiance;  choice: the entries of the light sampler, None if no
    light can be picked;  tree: the light tree, None for few lights.  Entries are in the order of
    the tables: all areas, points, spots, and so on, the environment last.  So area light i is entry
    i.
    """

    areas: Annotated[area.Areas | None, area]
    points: Annotated[point.Points | None, point]
    spots: Annotated[spot.Spots | None, spot]
    projectors: Annotated[projector.Projectors | None, projector]
    directionals: Annotated[directional.Directionals | None, directional]
    environment: Annotated[Environment | EnvironmentMaps | None, _Surroundings]
    ambient: FloatArray | None
    choice: LightSampler | None
    tree: LightTree | None


declare(Lights, LINK)

ALL = tables_of(Lights)
"""Of all lights, surfaces and the environment included."""

by_code = ByCode((code, field, module) for code, field, _, module in ALL)

_CODES = {field: code for code, field, _, _ in ALL}
AREA, ENVIRONMENT = _CODES["areas"], _CODES["environment"]
POINT, SPOT, PROJECTOR = _CODES["points"], _CODES["spots"], _CODES["projectors"]
DIRECTIONAL = _CODES["directionals"]

TABLES: tuple[tuple[int, str, Any, Any], ...] = tuple(
    (code, field, described_in(module, get_args(AnyLight)[0]), module)
    for code, field, _, module in ALL
    if code not in (AREA, ENVIRONMENT)
)
"""(code, field of Lights, description, module) of those that are neither surfaces nor surround the
scene, in the order in which `Lights.choice` lists them."""


class LinkedLights(NamedTuple):
    """`Lights` behind links.  emitters: to the tables of all types;  choice: without lights, of
    arrays of length 0;  tree: to the light tree, or to nothing;  ambient (1, 3)."""

    emitters: Link
    choice: LightSampler
    tree: Link
    ambient: FloatArray


@kernel
def _themselves(lights: Any) -> Any:
    return lights


@kernel
def _emitters_of(lights: LinkedLights) -> Link:
    return lights.emitters


emitters = by_class("emitters", {Lights: _themselves, LinkedLights: _emitters_of})
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


depends_on_point = by_class("depends_on_point", {Lights: _point_matters, LinkedLights: _always})
"""depends_on_point(lights): whether any probability or density depends on the point p: a
constant."""

depends_on_normal = by_class("depends_on_normal", {Lights: _normal_matters, LinkedLights: _always})
"""depends_on_normal(lights): whether any probability depends on the normal n: a constant."""


@kernel
def _map_of(lights: Lights) -> EnvironmentMaps | None:
    found: EnvironmentMaps | None = _as_map(lights.environment)
    return found


@kernel
def _no_map(lights: Any) -> None:
    return None


_as_map = by_class(
    "as_map", {EnvironmentMaps: _themselves, Environment: _no_map, type(None): _no_map}
)

map_of = by_class("map_of", {Lights: _map_of, LinkedLights: _no_map})
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


has_areas = by_class("has_areas", {Lights: _any_areas, LinkedLights: _always})
"""has_areas(lights): whether a surface may be a light: a constant."""
