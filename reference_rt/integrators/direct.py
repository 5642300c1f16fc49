"""Direct illumination: emission, and light that one surface scatters towards the camera.

L = L_e + the integral of f |cos| L_e over directions, estimated at the first hit by n light samples
and m BSDF samples with multiple importance sampling (`path` says which integral each one is).

On a `grid`, which has no random numbers, the integral is a sum over all lights.  It is exact, for
the scene is then checked to have no lights but points and directions, which no BSDF sample finds.
"""

from typing import Annotated, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt import sampling
from reference_rt.accel.geometry import closest_hit
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description
from reference_rt.core.ray import Ray, ray_from
from reference_rt.core.vec3 import Vec3, max_component, to_world
from reference_rt.integrators.direct_light import (
    behind_lamps,
    direct_from,
    fixed_lights,
    light_selection_normal,
    power_heuristic,
    unshadowed,
)
from reference_rt.integrators.path import Path, PathSetup
from reference_rt.integrators.scene_tables import SceneTables, shapes_of, surface
from reference_rt.integrators.shading import place, shade
from reference_rt.jit.kernel import ByClass, kernel, local_floats
from reference_rt.materials import Shading
from reference_rt.materials.textured import evaluate_textures, lookup_cache_size
from reference_rt.sampling import Sample, draw_pair
from reference_rt.sampling.blocks import BlockSample
from reference_rt.sampling.grid import GridSample
from reference_rt.sampling.independent import IndependentSample
from reference_rt.sampling.sobol import SobolSample

_Count = Annotated[int, Field(ge=0, le=1024)]


class Direct(Description):
    """Emission, and light that is scattered once, by sampling lights and materials with multiple
    importance sampling."""

    deterministic: ClassVar[bool] = False
    type: Literal["direct"] = "direct"
    light_samples: _Count = 1
    """Samples of lights for each camera ray, from 0 to 1024.  With 0, light of points and
    directions is missing."""
    bsdf_samples: _Count = 1
    """Directions that are sampled from the material for each camera ray, from 0 to 1024."""
    hide_emitters: bool = False
    """Whether lamps are not seen directly, and the background is black: camera rays pass through
    surfaces that emit.  Their light, mirrors that show them, and `layers` do not change."""
    shadows: bool = True
    """Whether surfaces block light.  Without shadows, as in rasterisers that compute none,
    directions are not sampled from materials, so that mirrors are black."""

    @model_validator(mode="after")
    def _any(self) -> Self:
        if not self.shadows and self.light_samples == 0:
            raise ValueError("no shadows and no samples of lights; expected light_samples above 0")
        if self.light_samples + self.bsdf_samples == 0:
            raise ValueError("no samples at all; expected light_samples or bsdf_samples above 0")
        return self

    @property
    def follows_scattered(self) -> bool:
        """Whether BSDF-sampled rays collect emission that light sampling can sample, too."""
        return self.shadows and self.bsdf_samples > 0

    def as_path(self) -> PathSetup | None:
        """The path tracer that draws the same samples of the same numbers, or None: with one sample
        of each kind, paths of two edges.  It traces the rays of a block together, which takes 0.85
        of the time (measured: a sky of 256 x 128 over four balls)."""
        if self.light_samples == self.bsdf_samples == 1 and self.shadows:
            return Path(max_depth=2, hide_emitters=self.hide_emitters).setup()
        return None

    def setup(self) -> "DirectSetup":
        bsdf_samples = self.bsdf_samples if self.shadows else 0
        return DirectSetup(self.light_samples, bsdf_samples, self.hide_emitters, self.shadows)


class DirectSetup(NamedTuple):
    light_samples: int
    bsdf_samples: int
    hides_lamps: bool
    shadows: bool


@kernel
def radiance(setup: DirectSetup, scene: SceneTables, ray: Ray, sampler: Sample) -> Vec3:
    """An unbiased estimate of the radiance along `ray`, by paths of at most two edges."""
    lights = scene.lights
    if setup.hides_lamps:
        ray = behind_lamps(scene, ray)
    hit = closest_hit(scene.geometry, ray)
    if hit.kind < 0:
        if setup.hides_lamps:
            return Vec3(0.0, 0.0, 0.0)
        behind: Vec3 = any_light.background(lights, ray.d)
        return behind
    kept = local_floats(any_material.scratch_floats(scene.materials))
    shading = shade(scene, ray, hit, kept)
    emitted = any_light.emitted(lights, shading.point, shading.at, -ray.d)
    scattered: Vec3 = _scattered(sampler, setup, scene, shading)
    return emitted + scattered


@kernel
def _of_samples(sampler: Sample, setup: DirectSetup, scene: SceneTables, shading: Shading) -> Vec3:
    """The scattered light, by samples of lights and of the material."""
    total = Vec3(0.0, 0.0, 0.0)
    normal = light_selection_normal(scene, shading)
    if any_material.is_smooth(scene.materials, shading.point.material):
        for k in range(setup.light_samples):
            total = total + _light_sample(setup, scene, shading, normal, sampler, k)
    elsewhere = local_floats(lookup_cache_size(scene.materials.textured))
    for k in range(setup.bsdf_samples):
        total = total + _bsdf_sample(setup, scene, shading, normal, sampler, k, elsewhere)
    return total


@kernel
def _of_all_lights(
    sampler: GridSample, setup: DirectSetup, scene: SceneTables, shading: Shading
) -> Vec3:
    """The same without random numbers."""
    smooth = any_material.is_smooth(scene.materials, shading.point.material)
    if setup.light_samples == 0 or not smooth:
        return Vec3(0.0, 0.0, 0.0)
    light: Vec3 = fixed_lights(scene, scene.lights.choice, shading, 0.5, 0.5, setup.shadows)
    return light


_choice = ByClass("scattered")
for _sample in (SobolSample, BlockSample, IndependentSample):
    _choice.register(_sample, _of_samples)
_choice.register(GridSample, _of_all_lights)
_scattered = _choice.function


@kernel
def _light_sample(
    setup: DirectSetup, scene: SceneTables, shading: Shading, normal: Vec3, sampler: Sample, k: int
) -> Vec3:
    """What light sample k of n adds to the estimate: its MIS-weighted f |cos| L_e / (n pdf)."""
    black = Vec3(0.0, 0.0, 0.0)
    if any_light.count(scene.lights) == 0:
        return black
    dimension = sampling.PER_BOUNCE * k
    u_pick, _ = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
    picked = any_light.pick(scene.lights, shading.point.p, normal, u_pick)
    if picked.probability == 0.0:
        return black
    u0, u1 = draw_pair(sampler, dimension + sampling.LIGHT_POINT)
    shapes, p = shapes_of(scene), shading.point.p
    light = any_light.sample_one(scene.lights, picked.light, shapes, scene.textures, p, u0, u1)
    if setup.shadows:
        sample = direct_from(scene, shading, light)
    else:
        sample = unshadowed(scene, shading, light)
    if max_component(sample.contribution) == 0.0:
        return black
    pdf = sample.light.pdf * picked.probability
    n = float(setup.light_samples)
    if sample.light.is_delta:
        return sample.contribution * (1.0 / (n * pdf))
    weight = power_heuristic(n * pdf, setup.bsdf_samples * sample.bsdf_pdf)
    return sample.contribution * (weight / (n * pdf))


@kernel
def _bsdf_sample(
    setup: DirectSetup,
    scene: SceneTables,
    shading: Shading,
    normal: Vec3,
    sampler: Sample,
    k: int,
    kept: FloatArray,
) -> Vec3:
    """What BSDF sample k of m adds to the estimate: its MIS-weighted f |cos| L_e / (m pdf)."""
    black = Vec3(0.0, 0.0, 0.0)
    lights = scene.lights
    dimension = sampling.PER_BOUNCE * k
    _, u_lobe = draw_pair(sampler, dimension + sampling.LIGHT_AND_LOBE)
    u0, u1 = draw_pair(sampler, dimension + sampling.BSDF_DIRECTION)
    scattered = any_material.sample(scene.materials, shading, u_lobe, u0, u1)
    if scattered.pdf == 0.0:
        return black
    ray = ray_from(shading.point, to_world(shading.frame, scattered.wi))
    hit = closest_hit(scene.geometry, ray)
    p = shading.point.p
    if hit.kind < 0:
        arriving: Vec3 = any_light.background(lights, ray.d)
        light_pdf = any_light.environment_pdf(lights, p, normal, arriving)
    else:
        there = surface(scene, ray, hit)
        here = place(scene, there.material, ray, hit)
        at = evaluate_textures(scene.materials.textured, there.material, here, kept)
        arriving = any_light.emitted(lights, there, at, -ray.d)
        light_pdf = any_light.area_pdf(lights, shapes_of(scene), p, normal, there)
    weight = 1.0
    m = float(setup.bsdf_samples)
    if not scattered.is_delta:
        weight = power_heuristic(m * scattered.pdf, setup.light_samples * light_pdf)
    return scattered.weight * arriving * (weight / m)
