"""Samples of a scene's lights, their densities, and the direct light of single ones."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reference_rt import lights as any_light
from reference_rt.accel.array_query import Primitives
from reference_rt.accel.geometry import Geometry, closest_hit, surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Hit, Ray
from reference_rt.core.scaled_ray import scaled
from reference_rt.core.vec3 import normalize, row
from reference_rt.integrators.direct_light import direct
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.integrators.shading import shade
from reference_rt.jit.kernel import entry_kernel, local_floats
from reference_rt.lights import TABLES, Constant, EnvironmentMap, Lights
from reference_rt.materials import kept_floats
from reference_rt.rendering.query.hits import BoolArray
from reference_rt.rendering.query.rays import (
    checked_rays,
    in_blocks,
    numbers,
    rays_of,
    shaped,
    together,
)
from reference_rt.rendering.query.tracing import NO_LIMIT, find, no_answers
from reference_rt.scene.build import BuiltScene
from reference_rt.shapes import TABLES as SHAPE_TABLES
from reference_rt.shapes import Shapes
from reference_rt.textures import Textures


@dataclass(frozen=True)
class LightSamples:
    """Light that arrives at n points if nothing is in the way.

    light (n,): number of the light that was picked, see `light_paths`, -1 for none;  wi (n, 3): the
    unit direction towards it;  distance (n,): inf for directions and environments;  target (n, 3):
    the point on the light, moved off its surface by its rounding;  radiance (n, 3): what arrives
    along wi; of a point, spot or directional light its irradiance across wi (intensity / r²);  pdf
    (n,): density of wi per solid angle, the chance of the light included; 0 where nothing arrives;
    is_delta (n,): whether the light has no extent: pdf is then the chance of the light alone.
    """

    light: IntArray
    wi: FloatArray
    distance: FloatArray
    target: FloatArray
    radiance: FloatArray
    pdf: FloatArray
    is_delta: BoolArray


@dataclass(frozen=True)
class DirectLight:
    """Direct light of one light at what n rays hit first.

    target (n, 3): the point on the light, or the direction towards an environment;  pdf (n,): its
    density per solid angle, 1 for a point light, 0 where no light can arrive or nothing was hit;
    contribution (n, 3): f cos L (for a point light f cos I / r²), 0 in shadow.
    """

    target: FloatArray
    pdf: FloatArray
    contribution: FloatArray


# They take the lights, the shapes and the textures alone: scenes of other materials share them.
@entry_kernel
def _sample(
    lights: Lights,
    shapes: Shapes,
    textures: Textures | None,
    p: FloatArray,
    n: FloatArray,
    u: FloatArray,
    light: IntArray,
    out: FloatArray,
) -> None:
    for i in range(len(p)):
        light[i] = -1
        for k in range(12):
            out[i, k] = 0.0
        at = row(p, i)
        picked = any_light.pick(lights, at, row(n, i), u[i, 0])
        if not picked.probability > 0.0:
            continue
        found = any_light.sample_one(lights, picked.light, shapes, textures, at, u[i, 1], u[i, 2])
        if not found.pdf > 0.0:
            continue
        light[i] = picked.light
        out[i, 0], out[i, 1], out[i, 2] = found.wi
        out[i, 3] = found.distance
        out[i, 4], out[i, 5], out[i, 6] = found.target
        out[i, 7], out[i, 8], out[i, 9] = found.radiance
        out[i, 10] = found.pdf * picked.probability
        out[i, 11] = 1.0 if found.is_delta else 0.0


@entry_kernel
def _pdf(
    geometry: Geometry,
    lights: Lights,
    p: FloatArray,
    n: FloatArray,
    d: FloatArray,
    found: Primitives,
    out: FloatArray,
) -> None:
    for i in range(len(p)):
        out[i] = 0.0
        ray, _, valid = scaled(row(p, i), row(d, i), math.inf)
        if not valid:
            continue
        kind = found.codes[i, 0]
        if kind < 0:
            out[i] = any_light.environment_pdf(lights, ray.o, row(n, i), normalize(ray.d))
            continue
        hit = Hit(
            found.t[i],
            kind,
            found.codes[i, 1],
            found.uv[i, 0],
            found.uv[i, 1],
            found.codes[i, 2],
        )
        q = surface(geometry, ray, hit)
        out[i] = any_light.area_pdf(lights, geometry.shapes, ray.o, row(n, i), q)


@entry_kernel
def _direct(
    scene: SceneTables, o: FloatArray, d: FloatArray, k: int, u: float, v: float, out: FloatArray
) -> None:
    kept = local_floats(kept_floats(scene.materials))
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        hit = closest_hit(scene.geometry, ray)
        if hit.kind < 0:
            continue
        found = direct(scene, shade(scene, ray, hit, kept), k, u, v)
        out[i, 0], out[i, 1], out[i, 2] = found.light.target
        out[i, 3] = found.light.pdf
        out[i, 4], out[i, 5], out[i, 6] = found.contribution


@dataclass(frozen=True)
class LightSources:
    """What the numbers of lights mean, an entry for each.

    shape (m,): the index in the scene's shapes of an area light, of which a mesh has one for each
    triangle; -1 for what is no shape, and within groups;  light (m,): the index in the scene's
    lights, -1 for area lights;  probability (m,): the chance by power alone, 0 of a light that
    cannot be sampled (a part of a group or of a solid, a shape without such a kernel).
    """

    shape: IntArray
    light: IntArray
    probability: FloatArray


def light_sources(scene: BuiltScene) -> LightSources:
    """The lights of a scene in the order of their numbers."""
    tables = scene.tables
    areas, choice = tables.lights.areas, tables.lights.choice
    shape = []
    if areas is not None:
        parts = tables.geometry.parts
        fields = {code: field for code, field, _, _ in SHAPE_TABLES}
        for kind, i in zip(areas.kind.tolist(), areas.row.tolist(), strict=True):
            number = getattr(tables.geometry.shapes, fields[kind]).owner[i]
            shape.append(number if parts is None else parts.shape[number])
    light: list[int] = []
    for kinds in (*(description for _, _, description, _ in TABLES), Constant | EnvironmentMap):
        light += [k for k, one in enumerate(scene.lights) if isinstance(one, kinds)]
    count = len(shape) + len(light)
    return LightSources(
        shape=np.array(shape + [-1] * len(light), np.int64),
        light=np.array([-1] * len(shape) + light, np.int64),
        probability=np.zeros(count) if choice is None else choice.probability.copy(),
    )


def sample_lights(
    scene: SceneTables,
    points: npt.ArrayLike,
    u: npt.ArrayLike,
    normals: npt.ArrayLike = (0.0, 0.0, 0.0),
    threads: int | None = None,
) -> LightSamples:
    """A light for each point, and a direction towards it.

    points (..., 3);  u (..., 3): numbers in [0, 1), the first for the light, two for its point;
    normals (..., 3): unit normals on the side that light may come from, by which many lights are
    picked; 0 for light from both sides.  They broadcast; a single point gives numbers.  The
    estimate of what a surface sends is f |cos| radiance / pdf, where `occluded` finds nothing in
    the way.  Raises ValueError.
    """
    shape, (p, u, n) = together(
        ("points", numbers("points", points, 3), 1),
        ("u", _in_unit_cube(numbers("u", u, 3)), 1),
        ("normals", numbers("normals", normals, 3), 1),
    )
    light, out = np.empty(len(p), np.int64), np.empty((len(p), 12))

    def sample(k: slice) -> None:
        shapes = scene.geometry.shapes
        _sample(scene.lights, shapes, scene.textures, p[k], n[k], u[k], light[k], out[k])

    in_blocks(sample, len(p), threads)
    columns = (out[:, 0:3], out[:, 3], out[:, 4:7], out[:, 7:10], out[:, 10], out[:, 11] != 0.0)
    return LightSamples(*(shaped(column, shape) for column in (light, *columns)))


def _in_unit_cube(u: FloatArray) -> FloatArray:
    if not ((u >= 0.0) & (u < 1.0)).all():
        raise ValueError("u: expected numbers from 0 up to, not including, 1")
    return u


def light_pdf(
    scene: SceneTables,
    points: npt.ArrayLike,
    directions: npt.ArrayLike,
    normals: npt.ArrayLike = (0.0, 0.0, 0.0),
    t_min: npt.ArrayLike = 0.0,
    threads: int | None = None,
) -> FloatArray:
    """The density per solid angle with which `sample_lights` picks what is seen from points
    (..., 3) in directions (..., 3): an area light, if that is met first at t > t_min, or the
    environment, if nothing is; 0 where neither is.  The chance of the light is included.  Raises
    ValueError."""
    shape, (p, d, n, low) = together(
        ("points", numbers("points", points, 3), 1),
        ("directions", numbers("directions", directions, 3), 1),
        ("normals", numbers("normals", normals, 3), 1),
        ("t_min", numbers("t_min", t_min), 0),
    )
    rays = rays_of(p, d, low if low.any() else 0.0)
    out = np.empty(len(p))

    def ask(k: slice) -> None:
        answers = no_answers(len(p[k]), surfaces=False)
        begin = None if rays.t_min is None else rays.t_min[k]
        found = find(scene.geometry, p[k], d[k], begin, NO_LIMIT, answers, len(p), rows=True)
        _pdf(scene.geometry, scene.lights, p[k], n[k], d[k], found, out[k])

    in_blocks(ask, len(p), threads)
    return shaped(out, shape)  # type: ignore[no-any-return]


def direct_light(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    light: int,
    u: tuple[float, float] = (0.5, 0.5),
) -> DirectLight:
    """Light from light number `light`, see `light_sources`, at its point that `u` picks."""
    o, d = checked_rays(origins, directions)
    choice = scene.lights.choice
    if choice is None or choice.probability[light] == 0.0:
        raise ValueError(f"light {light} cannot be sampled; expected one that can be picked")
    out = np.zeros((len(o), 7))
    with np.errstate(all="ignore"):
        _direct(scene, o, d, light, u[0], u[1], out)
    return DirectLight(target=out[:, 0:3], pdf=out[:, 3], contribution=out[:, 4:7])
