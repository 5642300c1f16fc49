"""The lights of a scene: pick one, sample it, and the densities of both.

`pick` chooses an entry k of the light sampler (`LightSampler`), by power or by a tree; `sample_one`
draws a direction to it.  p and n are the point and the shading normal for which light is sampled.
"""

from typing import Any, NamedTuple

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import SurfacePoint
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.jit.links import LINK, Link
from reference_rt.jit.operation_types import declare
from reference_rt.lights.emitters import area, constant, directional, environment_map, point, spot
from reference_rt.lights.emitters.area import Areas
from reference_rt.lights.emitters.constant import Environment
from reference_rt.lights.emitters.directional import Directionals
from reference_rt.lights.emitters.environment_map import EnvironmentMaps
from reference_rt.lights.emitters.point import Points
from reference_rt.lights.emitters.spot import Spots
from reference_rt.lights.light import (
    AREA,
    DIRECTIONAL,
    ENVIRONMENT,
    NO_LIGHT,
    POINT,
    SPOT,
    LightSample,
)
from reference_rt.lights.selection import choice
from reference_rt.lights.selection.choice import LightSampler
from reference_rt.lights.selection.tree import LightTree, Pick
from reference_rt.shapes import Shapes
from reference_rt.textures import At, Textures


class Lights(NamedTuple):
    """The table of each type, None for types that the scene lacks.

    ambient (1, 3): the ambient radiance;  choice: the entries of the light sampler, None if no
    light can be picked;  tree: the light tree, None for few lights.  Entries are in this order: all
    areas, points, spots, directional lights, the environment.  So area light i is entry i.
    """

    points: Points | None
    spots: Spots | None
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

by_code = ByCode(
    [
        (AREA, "areas", area),
        (POINT, "points", point),
        (SPOT, "spots", spot),
        (DIRECTIONAL, "directionals", directional),
        (ENVIRONMENT, "environment", _Surroundings),
    ]
)


CODES = (
    (AREA, "areas"),
    (POINT, "points"),
    (SPOT, "spots"),
    (DIRECTIONAL, "directionals"),
    (ENVIRONMENT, "environment"),
)
"""(code, field of Lights)."""


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
def background(lights: Any, d: Vec3) -> Vec3:
    """The radiance of the environment from direction d; black without one."""
    found: Vec3 = _background(emitters(lights), d)
    return found


@by_code("background", code=str(ENVIRONMENT))
def _background(lights: Lights, d: Vec3) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@by_code("environment_density", code=str(ENVIRONMENT))
def _environment_density(lights: Lights, d: Vec3) -> float:
    return 0.0


@kernel
def emitted(lights: Any, q: SurfacePoint, at: At, w: Vec3) -> Vec3:
    """The radiance that the surface at `q` emits towards `w`: see `area.emitted`."""
    if not is_area(lights, q):
        return Vec3(0.0, 0.0, 0.0)
    found: Vec3 = _emitted(emitters(lights), q, at, w)
    return found


@by_code("emitted", code=str(AREA))
def _emitted(lights: Lights, q: SurfacePoint, at: At, w: Vec3) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@by_code(lambda module: area.pdf if module is area else None, code=str(AREA))
def _area_density(lights: Lights, i: int, shapes: Shapes, p: Vec3, q: SurfacePoint) -> float:
    return 0.0


@kernel
def pick(lights: Lights, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p` with normal `n`, which is 0 for light from all sides.  Its
    probability is 0 if there is none."""
    return _pick(lights.choice, lights.tree, p, n, u)


@kernel
def _pick(lights: LightSampler | None, tree: LightTree | None, p: Vec3, n: Vec3, u: float) -> Pick:
    if lights is None:
        return Pick(0, 0.0)
    return choice.pick(lights, tree, p, n, u)


@kernel
def pick_probability(lights: Lights, p: Vec3, n: Vec3, k: int) -> float:
    """The probability that `pick` returns light k."""
    return _pick_probability(lights.choice, lights.tree, p, n, k)


@kernel
def _pick_probability(
    lights: LightSampler | None, tree: LightTree | None, p: Vec3, n: Vec3, k: int
) -> float:
    if lights is None:
        return 0.0
    return choice.probability(lights, tree, p, n, k)


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
def count(lights: Lights) -> int:
    """The number of entries that can be picked."""
    return _count(lights.choice)


@kernel
def _count(lights: LightSampler | None) -> int:
    if lights is None:
        return 0
    return choice.count(lights)


@kernel
def sample_one(
    lights: Lights, k: int, shapes: Shapes, textures: Textures | None, p: Vec3, u0: float, u1: float
) -> LightSample:
    """A sample of the light from entry k at `p`; its pdf is without the probability of k."""
    return _sample_one(lights.choice, lights, k, shapes, textures, p, u0, u1)


@kernel
def _sample_one(
    entries: LightSampler | None,
    lights: Lights,
    k: int,
    shapes: Shapes,
    textures: Textures | None,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightSample:
    if entries is None:
        return NO_LIGHT
    kind, i = entries.kind[k], entries.row[k]
    found: LightSample = _sample(emitters(lights), kind, i, shapes, textures, p, u0, u1)
    return found


@by_code("sample")
def _sample(
    lights: Lights,
    kind: int,
    i: int,
    shapes: Shapes,
    textures: Textures | None,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightSample:
    return NO_LIGHT


@kernel
def middle(
    lights: Lights, k: int, shapes: Shapes, textures: Textures | None, p: Vec3
) -> LightSample:
    """The same without random numbers: an area light is replaced by one point."""
    return _middle_of_one(lights.choice, lights, k, shapes, textures, p)


@kernel
def _middle_of_one(
    entries: LightSampler | None,
    lights: Lights,
    k: int,
    shapes: Shapes,
    textures: Textures | None,
    p: Vec3,
) -> LightSample:
    if entries is None:
        return NO_LIGHT
    kind, i = entries.kind[k], entries.row[k]
    found: LightSample = _middle(emitters(lights), kind, i, shapes, textures, p)
    return found


@by_code("middle")
def _middle(
    lights: Lights, kind: int, i: int, shapes: Shapes, textures: Textures | None, p: Vec3
) -> LightSample:
    return _sample(lights, kind, i, shapes, textures, p, 0.5, 0.5)


@kernel
def _any_areas(lights: Lights) -> bool:
    return lights.areas is not None


_has_areas = _for("has_areas", _any_areas, _always)


@kernel
def is_area(lights: Any, q: SurfacePoint) -> bool:
    """Whether a surface is an area light."""
    if not _has_areas(lights):
        return False
    return q.light >= 0


@kernel
def area_pdf(lights: Lights, shapes: Shapes, p: Vec3, n: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle of `pick` and `sample_one` together, for a surface at `p` with
    normal `n`, at the point `q` of an area light; 0 for other points."""
    if not is_area(lights, q):
        return 0.0
    chance = pick_probability(lights, p, n, q.light)
    density: float = _area_density(emitters(lights), q.light, shapes, p, q)
    return density * chance


@kernel
def environment_pdf(lights: Lights, p: Vec3, n: Vec3, d: Vec3) -> float:
    """The same for a direction `d` to the environment."""
    density: float = _environment_density(emitters(lights), d)
    if density == 0.0:
        return 0.0
    return density * pick_probability(lights, p, n, count(lights) - 1)


@kernel
def ambient(lights: Lights) -> Vec3:
    """The ambient radiance I_a of the Phong model."""
    return _ambient(lights.ambient)


@kernel
def _ambient(radiance: FloatArray | None) -> Vec3:
    if radiance is None:
        return Vec3(0.0, 0.0, 0.0)
    return row(radiance, 0)
