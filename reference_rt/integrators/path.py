"""Path tracing: the rendering equation by Monte Carlo (Kajiya 1986)."""

from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.description import Description
from reference_rt.geometry import closest_hit
from reference_rt.integrators.integrator import direct, power_heuristic, receiver
from reference_rt.kernel import kernel, local_floats
from reference_rt.lights import area
from reference_rt.materials import Shading
from reference_rt.ray import Ray, ray_from
from reference_rt.sampling import draw_pair
from reference_rt.shading import shade
from reference_rt.tables import SceneTables
from reference_rt.vec3 import Vec3, max_component, to_world

UNLIMITED = 2**31
ROULETTE_CAP = 0.999
"""The highest chance of survival: it ends paths between perfect mirrors.

Weights grow by albedo / cap a bounce where the albedo exceeds the cap, with a variance that is
infinite from albedo² = cap on.  Mitsuba's cap of 0.95 reaches that at an albedo of 0.975; the mean
is the same.
"""

_SAMPLING = ("both", "lights", "bsdf")
_BOTH, _LIGHTS, _BSDF = range(3)


class Path(Description):
    """Unbiased global illumination: next-event estimation, multiple importance sampling, Russian
    roulette."""

    deterministic: ClassVar[bool] = False
    type: Literal["path"] = "path"
    max_depth: Annotated[int, Field(ge=0)] | None = None
    """Most edges of a path from the eye: 1 shows lights alone, 2 adds direct light; none: no end.
    """
    rr_depth: Annotated[int, Field(ge=1)] = 5
    """Edges after which Russian roulette begins."""
    sampling: Literal["both", "lights", "bsdf"] = "both"
    """What finds lights: samples of lights, of the materials, or both, each weighted by how well
    it does (the same mean, most noise for one alone).  What only one can find, it finds."""

    def setup(self) -> "PathSetup":
        limit = UNLIMITED if self.max_depth is None else min(self.max_depth, UNLIMITED)
        return PathSetup(limit, min(self.rr_depth, UNLIMITED), _SAMPLING.index(self.sampling))


class PathSetup(NamedTuple):
    max_depth: int
    rr_depth: int
    sampling: int


@kernel
def radiance(path: PathSetup, scene: SceneTables, ray: Ray, sampler: sampling.Sample) -> Vec3:
    """An estimate of the radiance that arrives along `ray` at its origin; its mean is exact."""
    total = Vec3(0.0, 0.0, 0.0)
    throughput = Vec3(1.0, 1.0, 1.0)
    eta = 1.0
    # How the ray was chosen: from `previous`, for a light-picking normal, with this density; 0 for
    # the eye and for delta lobes, whose finds no light sample competes for.
    bsdf_pdf, previous, normal = 0.0, ray.o, ray.d
    lights = scene.lights
    kept = local_floats(any_material.kept_floats(scene.materials))
    for depth in range(path.max_depth):
        hit = closest_hit(scene.geometry, ray)
        if hit.kind < 0:
            weight = 1.0
            if bsdf_pdf > 0.0:
                light_pdf = any_light.environment_pdf(lights, previous, normal, ray.d)
                weight = _weight(path.sampling == _LIGHTS, path.sampling, bsdf_pdf, light_pdf)
            total = total + throughput * any_light.background(lights.environment, ray.d) * weight
            break
        shading = shade(scene, ray, hit, kept)
        point = shading.point
        if point.light >= 0:
            weight = 1.0
            if bsdf_pdf > 0.0:
                shapes = scene.geometry.shapes
                light_pdf = any_light.area_pdf(lights, shapes, previous, normal, point)
                weight = _weight(path.sampling == _LIGHTS, path.sampling, bsdf_pdf, light_pdf)
            emitted = area.emitted(lights.areas, point, shading.at, -ray.d)
            total = total + throughput * emitted * weight
        if depth + 1 >= path.max_depth:
            break
        dimension = sampling.FIRST_BOUNCE + sampling.PER_BOUNCE * depth
        normal = receiver(scene, shading)
        if any_material.is_smooth(scene.materials, point.material):
            light = _next_event(path, scene, shading, normal, sampler, dimension)
            total = total + throughput * light
        u_lobe, u_roulette = 0.5, 0.5
        chooses = any_material.chooses(scene.materials, point.material)
        if chooses or depth + 1 >= path.rr_depth:
            u_lobe, u_roulette = draw_pair(sampler, dimension + sampling.LOBE_AND_ROULETTE)
        u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
        scattered = any_material.sample(scene.materials, shading, u_lobe, u0, u1)
        if scattered.pdf == 0.0:
            break
        throughput = throughput * scattered.weight
        eta *= scattered.eta
        if depth + 1 >= path.rr_depth:
            # eta² undoes the change of radiance in glass: what counts is the power that is left.
            survival = min(max_component(throughput) * eta * eta, ROULETTE_CAP)
            if u_roulette >= survival:
                break
            throughput = throughput * (1.0 / survival)
        bsdf_pdf = 0.0 if scattered.is_delta else scattered.pdf
        previous = point.p
        ray = ray_from(point, to_world(shading.frame, scattered.wi))
    return total


@kernel
def _weight(is_other: bool, mode: int, pdf: float, other: float) -> float:
    """The weight of what one way of sampling found with density `pdf`, and the other could have
    with `other`; all or nothing where one way alone is asked for (`is_other`: the other)."""
    if mode == _BOTH or other == 0.0:
        return power_heuristic(pdf, other)
    return 0.0 if is_other else 1.0


@kernel
def _next_event(
    path: PathSetup,
    scene: SceneTables,
    shading: Shading,
    normal: Vec3,
    sampler: sampling.Sample,
    dimension: int,
) -> Vec3:
    """Direct light from one light picked at random, weighted against the BSDF's own sampling."""
    lights = any_light.count(scene.lights)
    if lights == 0:
        return Vec3(0.0, 0.0, 0.0)
    u_pick = 0.5
    if lights > 1:
        u_pick, _ = draw_pair(sampler, dimension + sampling.LIGHT_PICK)
    picked = any_light.pick(scene.lights, shading.point.p, normal, u_pick)
    if picked.probability == 0.0:
        return Vec3(0.0, 0.0, 0.0)
    u0, u1 = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
    sample = direct(scene, shading, picked.light, u0, u1)
    if max_component(sample.contribution) == 0.0:
        return sample.contribution
    pdf = sample.light.pdf * picked.probability
    if sample.light.is_delta:
        return sample.contribution * (1.0 / pdf)
    bsdf_pdf = any_material.pdf(scene.materials, shading, sample.wi)
    weight = _weight(path.sampling == _BSDF, path.sampling, pdf, bsdf_pdf)
    return sample.contribution * (weight / pdf)
