"""The lights of a scene: pick one, sample it, and the densities of both.

`pick` chooses an entry k of the light sampler (`LightSampler`), by power or by a tree; `sample_one`
draws a direction to it.  p and n are the point and the shading normal for which light is sampled.
"""

from typing import Any

from reference_rt.core.ray import BLOCK, HitBlock, PointBlock, RayBlock, SurfacePoint, vector_of
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel
from reference_rt.lights.emitters import area
from reference_rt.lights.light import (
    NO_LIGHT,
    Background,
    LightBlock,
    LightSample,
    put_background,
    put_light,
)
from reference_rt.lights.selection import choice
from reference_rt.lights.selection.choice import Pick
from reference_rt.lights.tables import ALL, AREA, ENVIRONMENT, Lights, LightTables, by_code
from reference_rt.shapes import Shapes
from reference_rt.textures import At, Textures

_KINDS = len(ALL)


@kernel
def background(lights: LightTables, d: Vec3) -> Vec3:
    """The radiance of the environment from direction d; black without one."""
    found: Vec3 = _background(lights.emitters, d)
    return found


@by_code("background", code=str(ENVIRONMENT))
def _background(lights: Lights, d: Vec3) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@by_code("backgrounds", code=str(ENVIRONMENT))
def _backgrounds(lights: Lights, rays: RayBlock, hits: HitBlock, n: int, lit: LightBlock) -> None:
    for j in range(n):
        if hits.codes[j] < 0:
            put_background(lit, j, Background(Vec3(0.0, 0.0, 0.0), 0.0))


@kernel
def backgrounds(
    lights: LightTables, rays: RayBlock, hits: HitBlock, n: int, lit: LightBlock
) -> None:
    """`background` of those of the first n rays that hit nothing, and the density of the
    environment's samples in their directions: read them with `background_in`."""
    _backgrounds(lights.emitters, rays, hits, n, lit)


@by_code("environment_density", code=str(ENVIRONMENT))
def _environment_density(lights: Lights, d: Vec3) -> float:
    return 0.0


@kernel
def background_of(lights: LightTables, d: Vec3) -> Background:
    """`background`, and the density of the environment's samples in direction d."""
    return Background(background(lights, d), _environment_density(lights.emitters, d))


@kernel
def emitted(lights: LightTables, q: SurfacePoint, at: At, w: Vec3) -> Vec3:
    """The radiance that the surface at `q` emits towards `w`: see `area.emitted`."""
    if q.light < 0:
        return Vec3(0.0, 0.0, 0.0)
    found: Vec3 = _emitted(lights.emitters, q, at, w)
    return found


@by_code("emitted", code=str(AREA))
def _emitted(lights: Lights, q: SurfacePoint, at: At, w: Vec3) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@by_code(lambda module: area.density if module is area else None, code=str(AREA))
def _area_density(lights: Lights, i: int, shapes: Shapes, p: Vec3, q: SurfacePoint) -> float:
    return 0.0


@kernel
def pick(lights: LightTables, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p` with normal `n`, which is 0 for light from all sides.  Its
    probability is 0 if there is none."""
    if count(lights) == 0:
        return Pick(0, 0.0)
    return choice.pick(lights.choice, lights.tree, p, n, u)


@kernel
def pick_probability(lights: LightTables, p: Vec3, n: Vec3, k: int) -> float:
    """The probability that `pick` returns light k."""
    if count(lights) == 0:
        return 0.0
    return choice.probability(lights.choice, lights.tree, p, n, k)


@kernel
def count(lights: LightTables) -> int:
    """The number of entries that can be picked."""
    return len(lights.choice.kind)


@kernel
def sample_one(
    lights: LightTables,
    k: int,
    shapes: Shapes,
    textures: Textures | None,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightSample:
    """A sample of the light from entry k at `p`; its pdf is without the probability of k."""
    kind, i = lights.choice.kind[k], lights.choice.row[k]
    found: LightSample = _sample(lights.emitters, kind, i, shapes, textures, p, u0, u1)
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
def ask_for_light(
    lights: LightTables, lit: LightBlock, j: int, picked: Pick, u0: float, u1: float
) -> None:
    """Path j wants a sample of the light that was picked, with numbers u0 and u1."""
    k, chosen = picked.light, lights.choice
    lit.codes[j], lit.codes[BLOCK + j], lit.codes[2 * BLOCK + j] = chosen.kind[k], chosen.row[k], k
    lit.numbers[12 * BLOCK + j], lit.numbers[13 * BLOCK + j] = u0, u1
    lit.numbers[14 * BLOCK + j] = picked.probability


@kernel
def picked_in(lit: LightBlock, j: int) -> Pick:
    """The light that path j asked for."""
    return Pick(lit.codes[2 * BLOCK + j], lit.numbers[14 * BLOCK + j])


@by_code.stage(own="samples")
def _samples(
    table: Any,
    kind: int,
    lit: LightBlock,
    shapes: Shapes,
    textures: Textures | None,
    points: PointBlock,
    n: int,
) -> None:
    """`sample_one` for those of the first n points that ask for a light of one kind."""
    numbers = lit.numbers
    for j in range(n):
        if lit.codes[j] == kind:
            i, p = lit.codes[BLOCK + j], vector_of(points.numbers, 0, j)
            u0, u1 = numbers[12 * BLOCK + j], numbers[13 * BLOCK + j]
            put_light(lit, j, _sample(table, kind, i, shapes, textures, p, u0, u1))


@kernel
def sample_asked(
    lights: LightTables,
    lit: LightBlock,
    shapes: Shapes,
    textures: Textures | None,
    points: PointBlock,
    n: int,
) -> None:
    """`sample_one` for those of the first n points that ask for a light (`ask_for_light`): read it
    with `light_of`."""
    for kind in range(_KINDS):
        _samples(lights.emitters, kind, lit, shapes, textures, points, n)


@kernel
def sample_fixed(
    lights: LightTables,
    k: int,
    shapes: Shapes,
    textures: Textures | None,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightSample:
    """`sample_one` where nothing is random: every area light is its one point at (u0, u1), which
    for a rectangle is the same wherever it is seen from."""
    kind, i = lights.choice.kind[k], lights.choice.row[k]
    found: LightSample = _sample_fixed(lights.emitters, kind, i, shapes, textures, p, u0, u1)
    return found


@by_code("sample_fixed")
def _sample_fixed(
    lights: Lights,
    kind: int,
    i: int,
    shapes: Shapes,
    textures: Textures | None,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightSample:
    return _sample(lights, kind, i, shapes, textures, p, u0, u1)


@kernel
def is_area(q: SurfacePoint) -> bool:
    """Whether a surface is an area light."""
    return q.light >= 0


@kernel
def area_pdf(lights: LightTables, shapes: Shapes, p: Vec3, n: Vec3, q: SurfacePoint) -> float:
    """The density per solid angle of `pick` and `sample_one` together, for a surface at `p` with
    normal `n`, at the point `q` of an area light; 0 for other points."""
    if not is_area(q):
        return 0.0
    chance = pick_probability(lights, p, n, q.light)
    density: float = _area_density(lights.emitters, q.light, shapes, p, q)
    return density * chance


@kernel
def environment_pdf(lights: LightTables, p: Vec3, n: Vec3, d: Vec3) -> float:
    """The same for a direction d to the environment."""
    return environment_density(lights, p, n, _environment_density(lights.emitters, d))


@kernel
def environment_density(lights: LightTables, p: Vec3, n: Vec3, density: float) -> float:
    """The same, where the density of the environment's samples is known."""
    if density == 0.0:
        return 0.0
    return density * pick_probability(lights, p, n, count(lights) - 1)


@kernel
def ambient(lights: LightTables) -> Vec3:
    """The ambient radiance I_a of the Phong model."""
    return row(lights.ambient, 0)
