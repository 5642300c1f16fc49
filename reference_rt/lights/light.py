"""The sample that the kernels of lights return, and what lights at a point share."""

import math
from typing import NamedTuple

from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import (
    BLOCK,
    Ray,
    SurfacePoint,
    put_vector,
    ray_from,
    segment_to,
    vector_of,
)
from reference_rt.core.vec3 import Vec3, dot
from reference_rt.jit.kernel import kernel


class LightSample(NamedTuple):
    """Light that arrives at a point unless it is occluded.

    wi: unit direction towards the light;  radiance: that from wi, or for a point light the
    irradiance across wi, intensity / distance²;  pdf: per solid angle, or 1 for a point light; 0
    means that nothing arrives;  target: the point on the light, moved off its surface, or far away;
    distance: infinite for an environment;  is_delta: whether no BSDF sample can find the light.
    """

    wi: Vec3
    radiance: Vec3
    pdf: float
    target: Vec3
    distance: float
    is_delta: bool


_ZERO = Vec3(0.0, 0.0, 0.0)

NO_LIGHT = LightSample(_ZERO, _ZERO, 0.0, _ZERO, 0.0, False)
"""Nothing arrives."""


@kernel
def from_position(position: Vec3, intensity: Vec3, falloff: float, p: Vec3) -> LightSample:
    """A light at one point: the fraction `falloff` of its intensity goes towards `p`, where
    intensity / distance² arrives (the inverse square law)."""
    w = position - p
    distance2 = dot(w, w)
    if distance2 == 0.0:
        return NO_LIGHT  # no direction leads there
    distance = math.sqrt(distance2)
    pdf = 1.0 if falloff > 0.0 else 0.0
    radiance = intensity * (falloff / distance2)
    return LightSample(w * (1.0 / distance), radiance, pdf, position, distance, True)


@kernel
def shadow_ray(point: SurfacePoint, light: LightSample) -> Ray:
    """The ray that tests visibility: from a surface to a light sample."""
    if light.distance < math.inf:
        return segment_to(point, light.target)
    return ray_from(point, light.wi)


LIGHT_FLOATS, LIGHT_INTEGERS = 15 * BLOCK, 3 * BLOCK


class LightBlock(NamedTuple):
    """Light samples of up to BLOCK paths as SoA: numbers (LIGHT_FLOATS,), columns of wi, radiance,
    pdf, target, distance, is_delta, and of the random numbers u0 and u1 and the probability of
    picking the light;  codes (LIGHT_INTEGERS,), table of all lights, -1 where none is sampled, then
    row and number."""

    numbers: FloatArray
    codes: IntArray


@kernel
def put_light(lit: LightBlock, j: int, light: LightSample) -> None:
    numbers = lit.numbers
    put_vector(numbers, 0, j, light.wi)
    put_vector(numbers, 3, j, light.radiance)
    numbers[6 * BLOCK + j] = light.pdf
    put_vector(numbers, 7, j, light.target)
    numbers[10 * BLOCK + j] = light.distance
    numbers[11 * BLOCK + j] = 1.0 if light.is_delta else 0.0


@kernel
def light_of(lit: LightBlock, j: int) -> LightSample:
    """Light sample j."""
    numbers = lit.numbers
    return LightSample(
        vector_of(numbers, 0, j),
        vector_of(numbers, 3, j),
        numbers[6 * BLOCK + j],
        vector_of(numbers, 7, j),
        numbers[10 * BLOCK + j],
        numbers[11 * BLOCK + j] != 0.0,
    )


@kernel
def ask_for_no_light(lit: LightBlock, j: int) -> None:
    """Path j has no light sample, unless it asks for one: its pdf is 0."""
    lit.codes[j], lit.numbers[6 * BLOCK + j] = -1, 0.0


class Background(NamedTuple):
    """radiance: of the environment along a ray that hits nothing;  density: of the environment's
    samples in its direction."""

    radiance: Vec3
    density: float


@kernel
def put_background(lit: LightBlock, j: int, background: Background) -> None:
    """Of path j, whose ray hits nothing, in the columns of radiance and pdf."""
    put_vector(lit.numbers, 3, j, background.radiance)
    lit.numbers[6 * BLOCK + j] = background.density


@kernel
def background_in(lit: LightBlock, j: int) -> Background:
    return Background(vector_of(lit.numbers, 3, j), lit.numbers[6 * BLOCK + j])
