"""The sample that the kernels of lights return, and what lights at a point share."""

import math
from typing import NamedTuple

from reference_rt.core.ray import Ray, SurfacePoint, ray_from, segment_to
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
