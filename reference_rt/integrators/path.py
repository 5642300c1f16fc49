"""Path tracing: the rendering equation by Monte Carlo (Kajiya 1986)."""

from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.description import Description
from reference_rt.geometry import closest_hit, surface
from reference_rt.integrators.integrator import direct, power_heuristic
from reference_rt.kernel import kernel
from reference_rt.lights import area, constant
from reference_rt.ray import Ray, SurfacePoint, ray_from
from reference_rt.sampling import draw_pair
from reference_rt.tables import SceneTables
from reference_rt.vec3 import Frame, Vec3, frame_from_normal, max_component, to_local, to_world

UNLIMITED = 2**31
ROULETTE_CAP = 0.95
"""The highest chance of survival: it ends paths between perfect mirrors."""


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

    def setup(self) -> "PathSetup":
        limit = UNLIMITED if self.max_depth is None else min(self.max_depth, UNLIMITED)
        return PathSetup(limit, min(self.rr_depth, UNLIMITED))


class PathSetup(NamedTuple):
    max_depth: int
    rr_depth: int


@kernel
def radiance(path: PathSetup, scene: SceneTables, ray: Ray, sampler: sampling.Sample) -> Vec3:
    """An estimate of the radiance that arrives along `ray` at its origin; its mean is exact."""
    total = Vec3(0.0, 0.0, 0.0)
    throughput = Vec3(1.0, 1.0, 1.0)
    eta = 1.0
    # How the ray was chosen: from `previous` with this density; 0 for the eye and for delta lobes,
    # whose finds no light sample competes for.
    bsdf_pdf, previous = 0.0, ray.o
    lights = scene.lights
    shapes = scene.geometry.shapes
    for depth in range(path.max_depth):
        hit = closest_hit(scene.geometry, ray)
        if hit.kind < 0:
            weight = 1.0
            if bsdf_pdf > 0.0:
                light_pdf = any_light.environment_pdf(lights.environment, lights.choice)
                weight = power_heuristic(bsdf_pdf, light_pdf)
            total = total + throughput * constant.background(lights.environment) * weight
            break
        point = surface(scene.geometry, ray, hit)
        if point.light >= 0:
            weight = 1.0
            if bsdf_pdf > 0.0:
                light_pdf = any_light.area_pdf(lights.areas, lights.choice, shapes, previous, point)
                weight = power_heuristic(bsdf_pdf, light_pdf)
            total = total + throughput * area.emitted(lights.areas, point, -ray.d) * weight
        if depth + 1 >= path.max_depth:
            break
        frame = frame_from_normal(point.ns)
        wo = to_local(frame, -ray.d)
        dimension = sampling.FIRST_BOUNCE + sampling.PER_BOUNCE * depth
        smooth = any_material.is_smooth(scene.materials, point.material)
        if smooth:
            light = _next_event(scene, lights.choice, point, frame, wo, sampler, dimension)
            total = total + throughput * light
        u_lobe, u_roulette = 0.5, 0.5
        if not smooth or depth + 1 >= path.rr_depth:
            u_lobe, u_roulette = draw_pair(sampler, dimension + sampling.LOBE_AND_ROULETTE)
        u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
        scattered = any_material.sample(scene.materials, point.material, wo, u_lobe, u0, u1)
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
        ray = ray_from(point, to_world(frame, scattered.wi))
    return total


@kernel
def _next_event(
    scene: SceneTables,
    choice: any_light.Choice | None,
    point: SurfacePoint,
    frame: Frame,
    wo: Vec3,
    sampler: sampling.Sample,
    dimension: int,
) -> Vec3:
    """Direct light from one light picked at random, weighted against the BSDF's own sampling."""
    if choice is None:
        return Vec3(0.0, 0.0, 0.0)
    k = 0
    if len(choice.kind) > 1:
        u_pick, _ = draw_pair(sampler, dimension + sampling.LIGHT_PICK)
        k = any_light.pick(choice, u_pick)
    u0, u1 = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
    sample = direct(scene, point, frame, wo, k, u0, u1)
    if max_component(sample.contribution) == 0.0:
        return sample.contribution
    pdf: float = sample.light.pdf * choice.probability[k]
    if sample.light.is_delta:
        return sample.contribution * (1.0 / pdf)
    bsdf_pdf = any_material.pdf(scene.materials, point.material, wo, sample.wi)
    return sample.contribution * (power_heuristic(pdf, bsdf_pdf) / pdf)
