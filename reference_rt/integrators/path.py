"""Path tracing: the rendering equation by Monte Carlo (Kajiya 1986)."""

from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.accel.block_query import any_hits, closest_hits, hit_of
from reference_rt.accel.geometry import closest_hit, occluded
from reference_rt.core.model import Description
from reference_rt.core.ray import Ray, ray_from
from reference_rt.core.ray_block import add_vector, put_ray, put_vector, ray_of, vector_of
from reference_rt.core.vec3 import Vec3, is_black, max_component, to_world
from reference_rt.integrators.direct_light import power_heuristic, receiver, unshadowed
from reference_rt.integrators.path_state import State, put_state, start, state_of
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.integrators.scratch import Scratch
from reference_rt.integrators.shading import shade
from reference_rt.jit.kernel import kernel, local_floats
from reference_rt.lights import shadow_ray
from reference_rt.lights.emitters import area
from reference_rt.materials import Shading
from reference_rt.sampling import Samplers, draw_pair, sampler_of

UNLIMITED = 2**31
ROULETTE_CAP = 0.999
"""The highest chance of survival: it ends paths between perfect mirrors.

Weights grow by albedo / cap a bounce where the albedo exceeds the cap, with a variance that is
infinite from albedo² = cap on.  Mitsuba's cap of 0.95 reaches that at an albedo of 0.975; the mean
is the same.
"""

_LIGHTS, _BSDF = range(2)
_ALONE = {"lights": _LIGHTS, "bsdf": _BSDF}


class Path(Description):
    """Unbiased global illumination: next-event estimation, multiple importance sampling, Russian
    roulette."""

    deterministic: ClassVar[bool] = False
    type: Literal["path"] = "path"
    max_depth: Annotated[int, Field(ge=0)] | None = None
    """Most edges of a path from the eye: 1 shows lights alone, 2 adds direct light; none: no end.
    """
    rr_depth: Annotated[int, Field(ge=1, le=4096)] = 5
    """Edges after which Russian roulette begins: what no limit ends, it does."""
    sampling: Literal["both", "lights", "bsdf"] = "both"
    """What finds lights: samples of lights, of the materials, or both, each weighted by how well
    it does (the same mean, most noise for one alone).  What only one can find, it finds."""

    @property
    def follows_scattered(self) -> bool:
        """Whether scattered rays bring the light of what is sampled too."""
        return self.sampling != "lights"

    def setup(self) -> "PathSetup":
        limit = UNLIMITED if self.max_depth is None else min(self.max_depth, UNLIMITED)
        return PathSetup(limit, self.rr_depth, _ALONE.get(self.sampling))


class PathSetup(NamedTuple):
    """alone: the one thing that is to find lights; None for both, so that nothing is asked."""

    max_depth: int
    rr_depth: int
    alone: int | None


class Step(NamedTuple):
    """How a path leaves a surface: goes_on, whether it does, along `ray` with `state`."""

    goes_on: bool
    ray: Ray
    state: State


class Lit(NamedTuple):
    """The light, weighted, that comes by way of a surface if nothing is on the ray `shadow`; 0
    where nothing can."""

    light: Vec3
    shadow: Ray


@kernel
def radiance(path: PathSetup, scene: SceneTables, ray: Ray, sampler: sampling.Sample) -> Vec3:
    """An estimate of the radiance that arrives along `ray` at its origin; its mean is exact."""
    total = Vec3(0.0, 0.0, 0.0)
    state = start(ray)
    kept = local_floats(any_material.kept_floats(scene.materials))
    for depth in range(path.max_depth):
        hit = closest_hit(scene.geometry, ray)
        if hit.kind < 0:
            return total + _from_sky(path, scene, state, ray)
        shading = shade(scene, ray, hit, kept)
        if any_light.is_area(scene.lights.areas, shading.point):
            total = total + _from_lamp(path, scene, state, ray, shading)
        if depth + 1 >= path.max_depth:
            break
        lit = _next_event(path, scene, state, shading, sampler, depth)
        if not is_black(lit.light):
            if not occluded(scene.geometry, lit.shadow):
                total = total + lit.light
        step = _scatter(path, scene, state, shading, sampler, depth)
        if not step.goes_on:
            break
        ray, state = step.ray, step.state
    return total


@kernel
def radiances(
    path: PathSetup, scene: SceneTables, samplers: Samplers, n: int, scratch: Scratch
) -> None:
    """`radiance` of the first n of `scratch.rays`, into `scratch.totals`: all paths at once, edge
    by edge, so that rays are traced side by side and no path waits for another."""
    rays, shadows, hits = scratch.rays, scratch.shadows, scratch.hits
    for j in range(n):
        put_state(scene, scratch, j, j, start(ray_of(rays, j)))
        put_vector(scratch.totals, 0, j, Vec3(0.0, 0.0, 0.0))
    for depth in range(path.max_depth):
        if n == 0:
            break
        closest_hits(scene.geometry, rays, hits, n)
        alive, lit = 0, 0
        for j in range(n):
            k = scratch.samples[j]
            state = state_of(scene, scratch, j)
            ray = ray_of(rays, j)
            hit = hit_of(scene.geometry, ray, hits, j)
            if hit.kind < 0:
                add_vector(scratch.totals, 0, k, _from_sky(path, scene, state, ray))
                continue
            shading = shade(scene, ray, hit, scratch.kept)
            if any_light.is_area(scene.lights.areas, shading.point):
                add_vector(scratch.totals, 0, k, _from_lamp(path, scene, state, ray, shading))
            if depth + 1 >= path.max_depth:
                continue
            sampler = sampler_of(samplers, k)
            found = _next_event(path, scene, state, shading, sampler, depth)
            if not is_black(found.light):
                put_ray(shadows, lit, found.shadow)
                put_vector(scratch.lights, 0, lit, found.light)
                scratch.lit[lit] = k
                lit += 1
            step = _scatter(path, scene, state, shading, sampler, depth)
            if step.goes_on:
                put_ray(rays, alive, step.ray)
                put_state(scene, scratch, alive, k, step.state)
                alive += 1
        any_hits(scene.geometry, shadows, hits, lit)
        for j in range(lit):
            if hits.codes[j] < 0:
                add_vector(scratch.totals, 0, scratch.lit[j], vector_of(scratch.lights, 0, j))
        n = alive


@kernel
def _from_sky(path: PathSetup, scene: SceneTables, state: State, ray: Ray) -> Vec3:
    """What a path finds that hits nothing, weighted."""
    lights, weight = scene.lights, 1.0
    if state.bsdf_pdf > 0.0:
        light_pdf = any_light.environment_pdf(lights, state.previous, state.normal, ray.d)
        weight = _weight(path.alone, _BSDF, state.bsdf_pdf, light_pdf)
    emitted: Vec3 = any_light.background(lights.environment, ray.d)
    return state.throughput * emitted * weight


@kernel
def _from_lamp(
    path: PathSetup, scene: SceneTables, state: State, ray: Ray, shading: Shading
) -> Vec3:
    """What a path finds that hits an area light, weighted."""
    lights, point, weight = scene.lights, shading.point, 1.0
    if state.bsdf_pdf > 0.0:
        shapes = scene.geometry.shapes
        light_pdf = any_light.area_pdf(lights, shapes, state.previous, state.normal, point)
        weight = _weight(path.alone, _BSDF, state.bsdf_pdf, light_pdf)
    return state.throughput * area.emitted(lights.areas, point, shading.at, -ray.d) * weight


@kernel
def _weight(alone: int | None, way: int, pdf: float, other: float) -> float:
    """The weight of what one way of sampling found with density `pdf`, and the other could have
    with `other`; all or nothing where one way alone is asked for."""
    if alone is None:
        return power_heuristic(pdf, other)
    return 1.0 if alone == way or other == 0.0 else 0.0


@kernel
def _next_event(
    path: PathSetup,
    scene: SceneTables,
    state: State,
    shading: Shading,
    sampler: sampling.Sample,
    depth: int,
) -> Lit:
    """Direct light from one light picked at random, weighted against the BSDF's own sampling."""
    point, dimension = shading.point, sampling.PER_BOUNCE * depth
    nothing = Lit(Vec3(0.0, 0.0, 0.0), Ray(point.p, point.n, 0.0))
    count = any_light.count(scene.lights)
    if count == 0 or not any_material.is_smooth(scene.materials, point.material):
        return nothing
    u_pick = 0.5
    if count > 1:
        u_pick, _ = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
    picked = any_light.pick(scene.lights, point.p, receiver(scene, shading), u_pick)
    if picked.probability == 0.0:
        return nothing
    u0, u1 = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
    shapes, textures = scene.geometry.shapes, scene.textures
    light = any_light.sample_one(scene.lights, picked.light, shapes, textures, point.p, u0, u1)
    sample = unshadowed(scene, shading, light)
    if is_black(sample.contribution):
        return nothing
    pdf = light.pdf * picked.probability
    weight = 1.0
    if not light.is_delta:
        weight = _weight(path.alone, _LIGHTS, pdf, sample.bsdf_pdf)
    arriving = sample.contribution * (weight / pdf)
    return Lit(state.throughput * arriving, shadow_ray(point, light))


@kernel
def _scatter(
    path: PathSetup,
    scene: SceneTables,
    state: State,
    shading: Shading,
    sampler: sampling.Sample,
    depth: int,
) -> Step:
    """From the surface that edge number `depth` of a path has hit to the next ray."""
    point, dimension = shading.point, sampling.PER_BOUNCE * depth
    ended = Step(False, Ray(point.p, point.n, 0.0), state)
    u_lobe = 0.5
    if any_material.chooses(scene.materials, point.material):
        _, u_lobe = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
    u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
    scattered = any_material.sample(scene.materials, shading, u_lobe, u0, u1)
    if scattered.pdf == 0.0:
        return ended
    throughput = state.throughput * scattered.weight
    eta = state.eta * scattered.eta
    if depth + 1 >= path.rr_depth:
        # eta² undoes the change of radiance in glass: what counts is the power that is left.
        survival = min(max_component(throughput) * eta * eta, ROULETTE_CAP)
        u_roulette, _ = draw_pair(sampler, dimension + sampling.ROULETTE)
        if not u_roulette < survival:  # also ends what is NaN
            return ended
        throughput = throughput * (1.0 / survival)
    bsdf_pdf = 0.0 if scattered.is_delta else scattered.pdf
    ray = ray_from(point, to_world(shading.frame, scattered.wi))
    return Step(True, ray, State(throughput, eta, bsdf_pdf, point.p, receiver(scene, shading)))
