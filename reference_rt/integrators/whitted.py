"""Whitted: recursive ray tracing (Whitted 1980), deterministic.

At each hit: L = L_e + ambient + the direct light of every light at its middle point + for each
perfect mirror or refraction its reflectance or transmittance times L along that ray.
"""

import math
from typing import Annotated, ClassVar, Literal, NamedTuple

from pydantic import Field

from reference_rt import lights as any_light
from reference_rt import materials as any_material
from reference_rt.accel.geometry import closest_hit
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import Description, Examples
from reference_rt.core.ray import Ray, ray_from
from reference_rt.core.vec3 import Vec3, max_component, to_world
from reference_rt.integrators.direct_light import fixed_lights
from reference_rt.integrators.scene_tables import KernelScene
from reference_rt.integrators.shading import shade
from reference_rt.jit.kernel import kernel, local_floats
from reference_rt.sampling import Sample


class Whitted(Description):
    """Recursive ray tracing: ambient and direct light with shadows, mirrored and refracted rays,
    the background.

    Every area light is one point, its middle.  An environment is seen, directly and in mirrors and
    glass, but lights nothing else.
    """

    EXAMPLES: ClassVar[Examples] = ({}, {"max_depth": 3, "min_contribution": 0.01})
    deterministic: ClassVar[bool] = True
    follows_scattered: ClassVar[bool] = False
    type: Literal["whitted"] = "whitted"
    max_depth: Annotated[int, Field(ge=0, le=4096)] = 8
    """Most reflections and refractions in a row, from 0 to 4096."""
    min_contribution: Annotated[float, Field(ge=0, lt=1)] = 1e-4
    """Rays whose weight in the pixel is below this fraction are not traced, from 0 to below 1."""

    def setup(self) -> "WhittedSetup":
        return WhittedSetup(self.max_depth, self.min_contribution, 0.5, 0.5)


class WhittedSetup(NamedTuple):
    """u0, u1: the point of every area light that represents it, its middle at 0.5 and 0.5."""

    max_depth: int
    min_contribution: float
    u0: float
    u1: float


@kernel
def _push(stack: FloatArray, top: int, ray: Ray, weight: Vec3, depth: int) -> None:
    k = 10 * top
    stack[k], stack[k + 1], stack[k + 2] = ray.o
    stack[k + 3], stack[k + 4], stack[k + 5] = ray.d
    stack[k + 6], stack[k + 7], stack[k + 8] = weight
    stack[k + 9] = depth


@kernel
def _vector(stack: FloatArray, k: int) -> Vec3:
    return Vec3(stack[k], stack[k + 1], stack[k + 2])


@kernel
def radiance(whitted: WhittedSetup, scene: KernelScene, ray: Ray, sampler: Sample) -> Vec3:
    """The radiance along `ray`: a depth-first walk of the ray tree with an explicit stack.  Each
    level leaves at most all its branches but one on the stack."""
    waiting = 2 * any_material.most_branches(scene.materials) - 1
    stack = local_floats(10 * (waiting * whitted.max_depth + 2))
    kept = local_floats(any_material.scratch_floats(scene.materials))
    _push(stack, 0, ray, Vec3(1.0, 1.0, 1.0), 0)
    top, end = 1, ray.t_max
    total = Vec3(0.0, 0.0, 0.0)
    while top > 0:
        top -= 1
        k = 10 * top
        weight, depth = _vector(stack, k + 6), int(stack[k + 9])
        t_max = end if depth == 0 else math.inf
        ray = Ray(_vector(stack, k), _vector(stack, k + 3), t_max)
        hit = closest_hit(scene.geometry, ray)
        if hit.kind < 0:
            background = any_light.background(scene.lights, ray.d)
            total = total + weight * background
            continue
        shading = shade(scene, ray, hit, kept)
        point = shading.point
        total = total + weight * any_light.emitted(scene.lights, point, shading.at, -ray.d)
        ambient = any_material.ambient(scene.materials, shading) * any_light.ambient(scene.lights)
        total = total + weight * ambient
        if any_material.is_smooth(scene.materials, point.material):
            u0, u1 = whitted.u0, whitted.u1
            light = fixed_lights(scene, shading, u0, u1)
            total = total + weight * light
        if depth == whitted.max_depth:
            continue
        for k in range(any_material.branch_count(scene.materials, point.material)):
            branch = any_material.branches(scene.materials, shading, k)
            mirrored = weight * branch.reflectance
            if max_component(mirrored) > whitted.min_contribution:
                next_ray = ray_from(point, to_world(shading.frame, branch.reflected))
                _push(stack, top, next_ray, mirrored, depth + 1)
                top += 1
            refracted = weight * branch.transmittance
            if max_component(refracted) > whitted.min_contribution:
                next_ray = ray_from(point, to_world(shading.frame, branch.refracted))
                _push(stack, top, next_ray, refracted, depth + 1)
                top += 1
    return total
