"""The register of lights: their descriptions, and their tables.

A new light has a line in `AnyLight` and, unless it surrounds the scene, one in `Lights`; all else
follows from these two.  Its import as itself makes it a name of `reference_rt.lights`.
"""

from typing import Annotated, Any, NamedTuple, get_args

from pydantic import Field

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import HitBlock, RayBlock, vector_of
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.by_code import ByCode, described_in, tables_of
from reference_rt.jit.kernel import by_class, kernel
from reference_rt.jit.links import LINK, declare
from reference_rt.lights.emitters import (
    area,
    constant,
    directional,
    environment_map,
    goniometric,
    point,
    projector,
    spot,
)
from reference_rt.lights.emitters.constant import Ambient as Ambient
from reference_rt.lights.emitters.constant import Constant as Constant
from reference_rt.lights.emitters.constant import Environment
from reference_rt.lights.emitters.directional import Directional as Directional
from reference_rt.lights.emitters.environment_map import EnvironmentMap as EnvironmentMap
from reference_rt.lights.emitters.environment_map import EnvironmentMaps
from reference_rt.lights.emitters.goniometric import Goniometric as Goniometric
from reference_rt.lights.emitters.point import Point as Point
from reference_rt.lights.emitters.projector import Projector as Projector
from reference_rt.lights.emitters.spot import Spot as Spot
from reference_rt.lights.light import Background, LightBlock, LightSample, put_background
from reference_rt.lights.selection.choice import LightSampler, LightTree

AnyLight = Annotated[
    Point | Spot | Goniometric | Projector | Directional | Constant | EnvironmentMap | Ambient,
    Field(discriminator="type"),
]


def _of_environment(name: str, otherwise: Any = None) -> Any:
    modules = {Environment: constant, EnvironmentMaps: environment_map}
    kernels = {table: getattr(module, name, otherwise) for table, module in modules.items()}
    return by_class(name, kernels)


_radiance_of = _of_environment("radiance")
_density_of = _of_environment("pdf")
_sample_of = _of_environment("sample")


@kernel
def _one_by_one(environment: Any, rays: RayBlock, hits: HitBlock, n: int, lit: LightBlock) -> None:
    for j in range(n):
        if hits.codes[j] < 0:
            d = vector_of(rays.numbers, 3, j)
            found = Background(_radiance_of(environment, d), _density_of(environment, d))
            put_background(lit, j, found)


_backgrounds_of = _of_environment("backgrounds", _one_by_one)


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

    @staticmethod
    @kernel
    def backgrounds(
        environment: Any, rays: RayBlock, hits: HitBlock, n: int, lit: LightBlock
    ) -> None:
        _backgrounds_of(environment, rays, hits, n, lit)


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
    goniometrics: Annotated[goniometric.Goniometrics | None, goniometric]
    projectors: Annotated[projector.Projectors | None, projector]
    directionals: Annotated[directional.Directionals | None, directional]
    environment: Annotated[Environment | EnvironmentMaps | None, _Surroundings]
    ambient: FloatArray | None
    choice: LightSampler | None
    tree: LightTree | None


declare(Lights, LINK)

ALL = tables_of(Lights)
"""Of all lights, surfaces and the environment included."""

by_code = ByCode(Lights)

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


class LightTables(NamedTuple):
    """`Lights` as kernels take them.  emitters: the tables of all types, or a link;  choice:
    without lights, of arrays of length 0;  tree: None if there is none, or a link;  ambient (1,
    3)."""

    emitters: Any
    choice: LightSampler
    tree: Any
    ambient: FloatArray
