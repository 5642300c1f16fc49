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
from reference_rt.lights.emitters import area, constant, directional, environment_map, point, spot
from reference_rt.lights.emitters.area import Areas
from reference_rt.lights.emitters.constant import Environment
from reference_rt.lights.emitters.directional import Directionals
from reference_rt.lights.emitters.environment_map import EnvironmentMaps
from reference_rt.lights.emitters.point import Points
from reference_rt.lights.emitters.spot import Spots
from reference_rt.lights.light import AREA, DIRECTIONAL, NO_LIGHT, POINT, SPOT, LightSample
from reference_rt.lights.selection import choice
from reference_rt.lights.selection.choice import LightSampler
from reference_rt.lights.selection.tree import LightTree, Pick
from reference_rt.shapes import Shapes
from reference_rt.textures import Textures


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


@kernel
def _black(environment: None, d: Vec3) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@kernel
def _never(environment: None, d: Vec3) -> float:
    return 0.0


@kernel
def _nothing(environment: None, u0: float, u1: float) -> LightSample:
    return NO_LIGHT


def _of_environment(name: str, without: Any) -> Any:
    kernels = ByClass(name)
    kernels.register(type(None), without)
    kernels.register(Environment, getattr(constant, name))
    kernels.register(EnvironmentMaps, getattr(environment_map, name))
    return kernels.function


_by_code = ByCode(
    [
        (AREA, "areas", area),
        (POINT, "points", point),
        (SPOT, "spots", spot),
        (DIRECTIONAL, "directionals", directional),
    ]
)
"""The bodies of the functions below are for the environment, of which there is only one."""

background = _of_environment("radiance", _black)
"""background(environment, d): the radiance from direction d."""

_environment_pdf = _of_environment("pdf", _never)
_environment_sample = _of_environment("sample", _nothing)


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
def depends_on_point(lights: Lights) -> bool:
    """Whether any probability or density depends on the point p: a constant."""
    return lights.areas is not None or lights.tree is not None


@kernel
def depends_on_normal(lights: Lights) -> bool:
    """Whether any probability depends on the normal n: a constant."""
    return lights.tree is not None


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
    return _sample(lights, entries.kind[k], entries.row[k], shapes, textures, p, u0, u1)


@_by_code("sample")
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
    found: LightSample = _environment_sample(lights.environment, u0, u1)
    return found


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
    return _middle(lights, entries.kind[k], entries.row[k], shapes, textures, p)


@_by_code("middle")
def _middle(
    lights: Lights, kind: int, i: int, shapes: Shapes, textures: Textures | None, p: Vec3
) -> LightSample:
    return _sample(lights, kind, i, shapes, textures, p, 0.5, 0.5)


@kernel
def is_area(areas: Areas | None, q: SurfacePoint) -> bool:
    """Whether a surface is an area light."""
    if areas is None:
        return False
    return q.light >= 0


@kernel
def area_pdf(lights: Lights, shapes: Shapes, p: Vec3, n: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle of `pick` and `sample_one` together, for a surface at `p` with
    normal `n`, at the point `q` of an area light; 0 for other points."""
    return _area_pdf(lights.areas, lights, shapes, p, n, q)


@kernel
def _area_pdf(
    areas: Areas | None, lights: Lights, shapes: Shapes, p: Vec3, n: Vec3, q: SurfacePoint
) -> float:
    if areas is None:
        return 0.0
    if not is_area(areas, q):
        return 0.0
    chance = pick_probability(lights, p, n, q.light)
    return area.pdf(areas, q.light, shapes, p, q) * chance


@kernel
def environment_pdf(lights: Lights, p: Vec3, n: Vec3, d: Vec3) -> float:
    """The same for a direction `d` to the environment."""
    return _surrounding_pdf(lights.environment, lights, p, n, d)


@kernel
def _surrounding_pdf(
    environment: Environment | EnvironmentMaps | None, lights: Lights, p: Vec3, n: Vec3, d: Vec3
) -> float:
    if environment is None:
        return 0.0
    chance = pick_probability(lights, p, n, count(lights) - 1)
    density: float = _environment_pdf(environment, d)
    return density * chance


@kernel
def ambient(lights: Lights) -> Vec3:
    """The ambient radiance I_a of the Phong model."""
    return _ambient(lights.ambient)


@kernel
def _ambient(radiance: FloatArray | None) -> Vec3:
    if radiance is None:
        return Vec3(0.0, 0.0, 0.0)
    return row(radiance, 0)
