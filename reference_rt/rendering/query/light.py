"""Light samples, their densities, and the direct light of single lights."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt import lights as any_light
from reference_rt import shapes as any_shape
from reference_rt.accel.array_query import Primitives
from reference_rt.accel.geometry import Geometry, closest_hit, surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray, scaled
from reference_rt.core.vec3 import row
from reference_rt.integrators.direct_light import direct
from reference_rt.integrators.scene_tables import KernelScene, SceneTables
from reference_rt.integrators.shading import shade
from reference_rt.jit.kernel import entry_kernel, local_floats
from reference_rt.jit.links import Linker
from reference_rt.lights import TABLES, Constant, EnvironmentMap, LightTables
from reference_rt.materials import scratch_floats
from reference_rt.rendering.kept_links import (
    Linked,
    link_to_geometry,
    link_to_scene,
    linked,
)
from reference_rt.rendering.linking import calls_of, linked_lights, linked_shapes, linked_textures
from reference_rt.rendering.query.hits import BoolArray
from reference_rt.rendering.query.rays import (
    broadcast,
    check_in_unit_cube,
    checked_rays,
    in_blocks,
    numbers,
    rays_of,
    shaped,
)
from reference_rt.rendering.query.tracing import (
    NO_LIMIT,
    FirstHits,
    empty_hits,
    hit_of,
)
from reference_rt.scene.build import BuiltScene
from reference_rt.shapes import Shapes
from reference_rt.textures import Textures
from reference_rt.util.errors import Brief


@dataclass(frozen=True)
class LightSamples(metaclass=Brief):
    """Light samples at n points, without visibility.

    light (n,): number of the selected light, see `light_sources`, -1 for none;  wi (n, 3): unit
    direction towards it;  distance (n,): inf for directional lights and environments;  target (n,
    3): the point on the light, offset from its surface by its error bound;  radiance (n, 3): what
    arrives along wi; for a point, spot or directional light its irradiance perpendicular to wi
    (intensity / r²);  pdf (n,): solid-angle density of wi times the probability of the light; 0 if
    nothing arrives;  is_delta (n,): whether the light is a point, spot or direction: pdf is then
    the probability of the light alone.
    """

    light: IntArray
    wi: FloatArray
    distance: FloatArray
    target: FloatArray
    radiance: FloatArray
    pdf: FloatArray
    is_delta: BoolArray


@dataclass(frozen=True)
class DirectLight(metaclass=Brief):
    """Direct light of one light at the first hits of n rays.

    target (n, 3): the point on the light, or the direction towards an environment;  pdf (n,): its
    density per solid angle, 1 for a point light, 0 where no light can arrive or nothing was hit;
    contribution (n, 3): f cos L (for a point light f cos I / r²), 0 in shadow.
    """

    target: FloatArray
    pdf: FloatArray
    contribution: FloatArray


@entry_kernel
def sample_kernel(
    lights: LightTables,
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
def pdf_kernel(
    geometry: Geometry,
    lights: LightTables,
    shapes: Shapes,
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
        if found.codes[i, 0] < 0:
            out[i] = any_light.environment_pdf(lights, ray.o, row(n, i), ray.d)
            continue
        q = surface(geometry, ray, hit_of(found, i))
        out[i] = any_light.area_pdf(lights, shapes, ray.o, row(n, i), q)


@entry_kernel
def direct_kernel(
    scene: KernelScene, o: FloatArray, d: FloatArray, k: int, u: float, v: float, out: FloatArray
) -> None:
    kept = local_floats(scratch_floats(scene.materials))
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
class LightSources(metaclass=Brief):
    """The shape or light of the scene that each light number stands for.

    shape (m,): index of an area light in the scene's shapes (a mesh has a light for each triangle);
    -1 for other lights, and within groups;  light (m,): index in the scene's lights, -1 for area
    lights;  probability (m,): selection probability by power, 0 for a light that cannot be sampled
    (in a group or a solid, or a shape without a sampling kernel).
    """

    shape: IntArray
    light: IntArray
    probability: FloatArray


def light_sources(scene: BuiltScene) -> LightSources:
    """The lights of a scene, in the order of their numbers."""
    tables = scene.tables
    areas, choice = tables.lights.areas, tables.lights.choice
    shape = []
    if areas is not None:
        parts = tables.geometry.parts
        for kind, i in zip(areas.kind.tolist(), areas.row.tolist(), strict=True):
            number = any_shape.owner(tables.geometry.shapes, kind, i)
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


def _linked_lights(scene: SceneTables) -> Linked:
    """(lights, shapes, textures)."""
    lights, shapes, textures = scene.lights, scene.geometry.shapes, scene.textures

    def link(linker: Linker) -> Any:
        calls = calls_of(sample_kernel) | calls_of(pdf_kernel)
        return (
            linked_lights(linker, lights, calls),
            linked_shapes(linker, shapes, calls, lights.areas),
            linked_textures(linker, textures, calls),
        )

    return linked(scene, "lights", link)


def sample_lights(
    scene: SceneTables,
    points: npt.ArrayLike,
    u: npt.ArrayLike,
    normals: npt.ArrayLike = (0.0, 0.0, 0.0),
    threads: int | None = None,
) -> LightSamples:
    """A randomly selected light, and a direction towards it, for each point.

    points (..., 3);  u (..., 3): numbers in [0, 1), the first selects the light, the other two the
    point on it;  normals (..., 3): unit normals on the lit side, which the light tree uses; 0 for
    light from both sides.  All broadcast; a single point gives numbers.  The estimate of the
    scattered radiance is f |cos| radiance / pdf, or 0 if the ray is `occluded`.  Raises ValueError.
    """
    shape, (p, u, n) = broadcast(
        ("points", numbers("points", points, 3), 1),
        ("u", numbers("u", u, 3), 1),
        ("normals", numbers("normals", normals, 3), 1),
    )
    check_in_unit_cube(u)
    light, out = np.empty(len(p), np.int64), np.empty((len(p), 12))

    sources = _linked_lights(scene)

    def sample(k: slice) -> None:
        lights, shapes, textures = sources.tables
        sample_kernel(lights, shapes, textures, p[k], n[k], u[k], light[k], out[k])

    in_blocks(sample, len(p), threads)
    columns = (out[:, 0:3], out[:, 3], out[:, 4:7], out[:, 7:10], out[:, 10], out[:, 11] != 0.0)
    return LightSamples(*(shaped(column, shape) for column in (light, *columns)))


def light_pdf(
    scene: SceneTables,
    points: npt.ArrayLike,
    directions: npt.ArrayLike,
    normals: npt.ArrayLike = (0.0, 0.0, 0.0),
    t_min: npt.ArrayLike = 0.0,
    threads: int | None = None,
) -> FloatArray:
    """The solid-angle density with which `sample_lights` draws directions (..., 3) at points
    (..., 3), the probability of the light included.

    The light is the area light that the ray hits first at t > t_min, or the environment if it hits
    nothing; the density is 0 if there is neither.  Raises ValueError.
    """
    shape, (p, d, n, low) = broadcast(
        ("points", numbers("points", points, 3), 1),
        ("directions", numbers("directions", directions, 3), 1),
        ("normals", numbers("normals", normals, 3), 1),
        ("t_min", numbers("t_min", t_min), 0),
    )
    rays = rays_of(p, d, low if low.any() else 0.0)
    out, query = np.empty(len(p)), FirstHits(scene, len(p), surfaces=False)
    surfaces, sources = link_to_geometry(scene, "surface"), _linked_lights(scene)

    def density(k: slice) -> None:
        answers = empty_hits(len(p[k]), surfaces=False)
        begin = None if rays.t_min is None else rays.t_min[k]
        found = query.trace(p[k], d[k], begin, NO_LIMIT, answers, rows=True)
        lights, shapes, _ = sources.tables
        pdf_kernel(surfaces.tables, lights, shapes, p[k], n[k], d[k], found, out[k])

    in_blocks(density, len(p), threads)
    return shaped(out, shape)  # type: ignore[no-any-return]


def direct_light(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    light: int,
    u: tuple[float, float] = (0.5, 0.5),
) -> DirectLight:
    """Direct light of number `light` (see `light_sources`) from the point that `u` selects."""
    o, d = checked_rays(origins, directions)
    choice = scene.lights.choice
    if choice is None or choice.probability[light] == 0.0:
        raise ValueError(f"light {light} cannot be sampled; expected one that can be picked")
    # As Whitted's integrator, it traces rays one by one.
    out, found = np.zeros((len(o), 7)), link_to_scene(scene, direct_kernel)
    with np.errstate(all="ignore"):
        direct_kernel(found.tables, o, d, light, u[0], u[1], out)
    return DirectLight(target=out[:, 0:3], pdf=out[:, 3], contribution=out[:, 4:7])
