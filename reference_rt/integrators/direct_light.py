"""Direct light of one light at a surface, and the power heuristic: shared by the integrators."""

from typing import NamedTuple

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt.accel.block_query import closest_hits
from reference_rt.accel.geometry import occluded
from reference_rt.core.ray import (
    Hit,
    HitBlock,
    Ray,
    RayBlock,
    SurfacePoint,
    hit_of,
    put_ray,
    ray_from,
    ray_of,
)
from reference_rt.core.vec3 import Vec3, is_black, to_local
from reference_rt.integrators.scene_tables import KernelScene, surface
from reference_rt.jit.kernel import kernel
from reference_rt.lights import ENVIRONMENT, LightSample, shadow_ray
from reference_rt.materials import Shading

# ---- lamps that are not seen directly: camera rays go on behind them -----------------------------


class Onward(NamedTuple):
    """is_lamp: whether a ray's hit is on an area light;  ray: the rest of the ray behind it."""

    is_lamp: bool
    ray: Ray


@kernel
def onward(scene: KernelScene, ray: Ray, hit: Hit) -> Onward:
    if hit.kind < 0:
        return Onward(False, ray)
    point = surface(scene, ray, hit)
    if not any_light.is_area(point):
        return Onward(False, ray)
    rest = ray_from(point, ray.d)
    return Onward(True, Ray(rest.o, rest.d, ray.t_max - hit.t))


@kernel
def pass_lamps(scene: KernelScene, rays: RayBlock, hits: HitBlock, n: int) -> None:
    """Replace the first n rays of a block by the rest of each behind the area lights that it meets
    before any other surface."""
    is_going = True
    while is_going:
        closest_hits(scene.geometry, rays, hits, n)
        is_going = False
        for j in range(n):
            ray = ray_of(rays, j)
            going = onward(scene, ray, hit_of(hits, j))
            if going.is_lamp:
                put_ray(rays, j, going.ray)
                is_going = True


class Direct(NamedTuple):
    """A light sample scattered towards the viewer.

    wi: the direction to the light, in the shading frame;  contribution: f |cos| L_e, 0 in shadow,
    not divided by a pdf;  bsdf_pdf: solid-angle density with which BSDF sampling draws `wi`.
    """

    light: LightSample
    wi: Vec3
    contribution: Vec3
    bsdf_pdf: float


@kernel
def direct(scene: KernelScene, shading: Shading, k: int, u0: float, u1: float) -> Direct:
    """A sample of light number k at a surface, tested for visibility."""
    shapes, p = scene.shapes, shading.point.p
    light = any_light.sample_one(scene.lights, k, shapes, scene.textures, p, u0, u1)
    return direct_from(scene, shading, light)


@kernel
def direct_from(scene: KernelScene, shading: Shading, light: LightSample) -> Direct:
    """A light sample at a surface, tested for visibility."""
    found = unshadowed(scene, shading, light)
    black = Vec3(0.0, 0.0, 0.0)
    # No shadow ray is needed where the BSDF is 0, such as on the wrong side of the surface.
    if is_black(found.contribution):
        return found
    if occluded(scene.geometry, shadow_ray(shading.point, light)):
        return Direct(light, found.wi, black, found.bsdf_pdf)
    return found


@kernel
def unshadowed(scene: KernelScene, shading: Shading, light: LightSample) -> Direct:
    """A light sample at a surface, without the visibility test."""
    if light.pdf == 0.0:
        black = Vec3(0.0, 0.0, 0.0)
        return Direct(light, black, black, 0.0)
    wi = to_local(shading.frame, light.wi)
    scattered = any_material.eval_pdf(scene.materials, shading, wi)
    return Direct(light, wi, scattered.value * light.radiance, scattered.density)


@kernel
def fixed_lights(scene: KernelScene, shading: Shading, u0: float, u1: float) -> Vec3:
    """Direct light without random numbers: of every point, spot and directional light, and of the
    point (u0, u1) of every area light."""
    total, choice = Vec3(0.0, 0.0, 0.0), scene.lights.choice
    shapes, p = scene.shapes, shading.point.p
    for k in range(len(choice.kind)):
        if choice.kind[k] != ENVIRONMENT and choice.probability[k] > 0.0:
            light = any_light.sample_fixed(scene.lights, k, shapes, scene.textures, p, u0, u1)
            sample = direct_from(scene, shading, light)
            if sample.light.pdf > 0.0:
                total = total + sample.contribution * (1.0 / sample.light.pdf)
    return total


@kernel
def power_heuristic(pdf: float, other: float) -> float:
    """MIS weight p² / (p² + q²) of a sample drawn with density p = `pdf`, which the other strategy
    draws with density q = `other` (Veach 1997, eq. 9.13).  It is computed from q / p, so that no
    square of a density overflows."""
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)


@kernel
def light_selection_normal(scene: KernelScene, point: SurfacePoint) -> Vec3:
    """The shading normal for light selection; 0 if the material takes light from both sides."""
    if any_material.takes_light_from_behind(scene.materials, point.material):
        return Vec3(0.0, 0.0, 0.0)
    return point.ns
