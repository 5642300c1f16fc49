"""Path tracing as a lecture writes it: one path, one loop, without blocks, light computed ahead, or
an order of work that saves time (as PBR 4ed, 13.2, has its simple path integrator).

It renders nothing.  Tests hold `path.radiances` to it, bit for bit; docs/course/path.md quotes it.
"""

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.accel.geometry import closest_hit, occluded
from reference_rt.core.ray import Ray, ray_from
from reference_rt.core.vec3 import Vec3, max_component, to_local, to_world
from reference_rt.integrators.direct_light import light_selection_normal, power_heuristic
from reference_rt.integrators.path import ROULETTE_CAP, PathSetup
from reference_rt.integrators.scene_tables import KernelScene
from reference_rt.integrators.shading import shade
from reference_rt.jit.kernel import kernel, local_floats
from reference_rt.lights import shadow_ray
from reference_rt.sampling import Sample, draw_pair


@kernel
def radiance(path: PathSetup, scene: KernelScene, ray: Ray, sampler: Sample) -> Vec3:
    """An unbiased estimate of the radiance along a camera ray, with both samples of direct light
    (`Path.sampling`)."""
    materials, lights, textures = scene.materials, scene.lights, scene.textures
    shapes, kept = scene.shapes, local_floats(any_material.scratch_floats(materials))
    light, throughput, eta = Vec3(0.0, 0.0, 0.0), Vec3(1.0, 1.0, 1.0), 1.0
    # The density with which the ray's direction was drawn, and the point and the normal from which
    # a light might have been; 0 where none could: for the camera's ray and for perfect mirrors.
    bsdf_pdf, previous, normal = 0.0, ray.o, ray.d
    for depth in range(path.max_depth):
        dimension = sampling.PER_BOUNCE * depth
        hit = closest_hit(scene.geometry, ray)

        # Emission that the ray meets.
        if hit.kind < 0:
            weight = 1.0
            if bsdf_pdf > 0.0:
                light_pdf = any_light.environment_pdf(lights, previous, normal, ray.d)
                weight = power_heuristic(bsdf_pdf, light_pdf)
            return light + throughput * any_light.background(lights, ray.d) * weight
        shading = shade(scene, ray, hit, kept)
        point = shading.point
        if any_light.is_area(point):
            weight = 1.0
            if bsdf_pdf > 0.0:
                light_pdf = any_light.area_pdf(lights, shapes, previous, normal, point)
                weight = power_heuristic(bsdf_pdf, light_pdf)
            emitted = any_light.emitted(lights, point, shading.at, -ray.d)
            light = light + throughput * emitted * weight
        if depth + 1 == path.max_depth:
            break
        normal = light_selection_normal(scene, point)

        # Next event estimation: a point on one light, if nothing is between.
        u_light, u_lobe = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
        u0, u1 = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
        picked = any_light.pick(lights, point.p, normal, u_light)
        if picked.probability > 0.0 and any_material.is_smooth(materials, point.material):
            lit = any_light.sample_one(lights, picked.light, shapes, textures, point.p, u0, u1)
            if lit.pdf > 0.0 and not occluded(scene.geometry, shadow_ray(point, lit)):
                wi = to_local(shading.frame, lit.wi)
                scattered = any_material.eval_pdf(materials, shading, wi)
                pdf = lit.pdf * picked.probability
                weight = 1.0 if lit.is_delta else power_heuristic(pdf, scattered.density)
                arriving = scattered.value * lit.radiance * (weight / pdf)
                light = light + throughput * arriving

        # The material scatters the path into a new direction.
        u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
        bounce = any_material.sample(materials, shading, u_lobe, u0, u1)
        if bounce.pdf == 0.0:
            break
        throughput, eta = throughput * bounce.weight, eta * bounce.eta

        # Russian roulette ends paths that carry little; the others carry the more.
        if depth + 1 >= path.rr_depth:
            survival = min(max_component(throughput) * eta * eta, ROULETTE_CAP)
            u_roulette, _ = draw_pair(sampler, dimension + sampling.ROULETTE)
            if not u_roulette < survival:
                break
            throughput = throughput * (1.0 / survival)

        bsdf_pdf, previous = 0.0 if bounce.is_delta else bounce.pdf, point.p
        ray = ray_from(point, to_world(shading.frame, bounce.wi))
    return light
