"""The lights of a scene: pick one, sample it, and the densities of both.

`pick` chooses an entry k of the light sampler (`LightSampler`), by power or by a tree; `sample_one`
draws a direction to it.  p and n are the point and the shading normal for which light is sampled.
"""

from typing import Any

from reference_rt.core.ray import SurfacePoint
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import kernel
from reference_rt.lights.emitters import area, environment_map
from reference_rt.lights.emitters.environment_map import Ahead
from reference_rt.lights.light import NO_LIGHT, LightSample
from reference_rt.lights.selection import choice
from reference_rt.lights.selection.choice import Pick
from reference_rt.lights.tables import (
    AREA,
    ENVIRONMENT,
    Lights,
    by_code,
    emitters,
    has_areas,
)
from reference_rt.shapes import Shapes
from reference_rt.textures import At, Textures


@kernel
def background(lights: Any, d: Vec3) -> Vec3:
    """The radiance of the environment from direction d; black without one."""
    found: Vec3 = _background(emitters(lights), d)
    return found


@by_code("background", code=str(ENVIRONMENT))
def _background(lights: Lights, d: Vec3) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@kernel
def background_of(ahead: Ahead | None, lights: Any, d: Vec3) -> Vec3:
    """`background`, computed ahead or now."""
    if ahead is None:
        return background(lights, d)
    return environment_map.radiance_ahead(ahead)


@by_code("environment_density", code=str(ENVIRONMENT))
def _environment_density(lights: Lights, d: Vec3) -> float:
    return 0.0


@kernel
def _density_of(ahead: Ahead | None, lights: Any, d: Vec3) -> float:
    if ahead is None:
        found: float = _environment_density(emitters(lights), d)
        return found
    return environment_map.pdf_ahead(ahead)


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


@by_code(lambda module: area.density if module is area else None, code=str(AREA))
def _area_density(lights: Lights, i: int, shapes: Shapes, p: Vec3, q: SurfacePoint) -> float:
    return 0.0


@kernel
def pick(lights: Lights, p: Vec3, n: Vec3, u: float) -> Pick:
    """A light for a surface at `p` with normal `n`, which is 0 for light from all sides.  Its
    probability is 0 if there is none."""
    if lights.choice is None:
        return Pick(0, 0.0)
    return choice.pick(lights.choice, lights.tree, p, n, u)


@kernel
def pick_probability(lights: Lights, p: Vec3, n: Vec3, k: int) -> float:
    """The probability that `pick` returns light k."""
    if lights.choice is None:
        return 0.0
    return choice.probability(lights.choice, lights.tree, p, n, k)


@kernel
def count(lights: Lights) -> int:
    """The number of entries that can be picked."""
    if lights.choice is None:
        return 0
    return choice.count(lights.choice)


@kernel
def sample_one(
    lights: Lights, k: int, shapes: Shapes, textures: Textures | None, p: Vec3, u0: float, u1: float
) -> LightSample:
    """A sample of the light from entry k at `p`; its pdf is without the probability of k."""
    if lights.choice is None:
        return NO_LIGHT
    kind, i = lights.choice.kind[k], lights.choice.row[k]
    found: LightSample = _sample(emitters(lights), kind, i, shapes, textures, p, u0, u1)
    return found


@kernel
def sample_picked(
    ahead: Ahead | None,
    lights: Lights,
    k: int,
    shapes: Shapes,
    textures: Textures | None,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightSample:
    """`sample_one`, computed ahead for an environment map or now."""
    if ahead is None:
        return sample_one(lights, k, shapes, textures, p, u0, u1)
    if lights.choice.kind[k] == ENVIRONMENT:  # type: ignore[union-attr]
        return environment_map.sample_ahead(ahead)
    return sample_one(lights, k, shapes, textures, p, u0, u1)


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
def sample_fixed(
    lights: Lights,
    k: int,
    shapes: Shapes,
    textures: Textures | None,
    p: Vec3,
    u0: float,
    u1: float,
) -> LightSample:
    """`sample_one` where nothing is random: every area light is its one point at (u0, u1), which
    for a rectangle is the same wherever it is seen from."""
    if lights.choice is None:
        return NO_LIGHT
    kind, i = lights.choice.kind[k], lights.choice.row[k]
    found: LightSample = _sample_fixed(emitters(lights), kind, i, shapes, textures, p, u0, u1)
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
def is_area(lights: Any, q: SurfacePoint) -> bool:
    """Whether a surface is an area light."""
    if not has_areas(lights):
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
def environment_pdf(ahead: Ahead | None, lights: Lights, p: Vec3, n: Vec3, d: Vec3) -> float:
    """The same for a direction d to the environment, computed ahead or now."""
    density = _density_of(ahead, lights, d)
    if density == 0.0:
        return 0.0
    return density * pick_probability(lights, p, n, count(lights) - 1)


@kernel
def ambient(lights: Lights) -> Vec3:
    """The ambient radiance I_a of the Phong model."""
    if lights.ambient is None:
        return Vec3(0.0, 0.0, 0.0)
    return row(lights.ambient, 0)
