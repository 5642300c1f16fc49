"""What integrators share: direct light from one light, and the heuristic that joins estimators."""

from typing import NamedTuple

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt.accel.geometry import occluded
from reference_rt.core.vec3 import Vec3, is_black, to_local
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import kernel
from reference_rt.lights import LightSample, shadow_ray
from reference_rt.materials import Shading


class Direct(NamedTuple):
    """What one light sample sends to the viewer: f cos L, 0 in shadow, not yet divided by a pdf;
    bsdf_pdf: the density with which the material's own sampling picks `wi`."""

    light: LightSample
    wi: Vec3
    contribution: Vec3
    bsdf_pdf: float


@kernel
def direct(scene: SceneTables, shading: Shading, k: int, u0: float, u1: float) -> Direct:
    """Light k of the scene's choice at a surface; the result's `wi` is local."""
    shapes, p = scene.geometry.shapes, shading.point.p
    light = any_light.sample_one(scene.lights, k, shapes, scene.textures, p, u0, u1)
    return direct_from(scene, shading, light)


@kernel
def direct_from(scene: SceneTables, shading: Shading, light: LightSample) -> Direct:
    """A light sample at a surface; the result's `wi` is local."""
    found = unshadowed(scene, shading, light)
    black = Vec3(0.0, 0.0, 0.0)
    # Most shadow rays to the wrong side of a surface are spared here.
    if is_black(found.contribution):
        return found
    if occluded(scene.geometry, shadow_ray(shading.point, light)):
        return Direct(light, found.wi, black, found.bsdf_pdf)
    return found


@kernel
def unshadowed(scene: SceneTables, shading: Shading, light: LightSample) -> Direct:
    """The same, whatever may be in the way."""
    if light.pdf == 0.0:
        black = Vec3(0.0, 0.0, 0.0)
        return Direct(light, black, black, 0.0)
    wi = to_local(shading.frame, light.wi)
    scattered = any_material.both(scene.materials, shading, wi)
    return Direct(light, wi, scattered.value * light.radiance, scattered.density)


@kernel
def power_heuristic(pdf: float, other: float) -> float:
    """The weight of a sample of density `pdf` that `other` could have found too: p² / (p² + q²)
    (Veach 1997, eq. 9.13), as a ratio, which cannot overflow."""
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)


@kernel
def receiver(scene: SceneTables, shading: Shading) -> Vec3:
    """The normal that lights are picked for: none where light may come from both sides."""
    if any_material.takes_light_from_behind(scene.materials, shading.point.material):
        return Vec3(0.0, 0.0, 0.0)
    return shading.frame.n
