"""Light that leaves its source: rays from all lamps of a scene, for light tracing.

No lamp has code for this.  A ray that a lamp sends out crosses a sphere around it once, outwards;
where it does, it is the ray by which the lamp lights that point, and that every lamp can sample
(`sample_one`).  So a ray is drawn from the far end: a point p on a sphere around the lamp, then the
light at p.  With radiance L from the unit direction w, p of density 1 / S over the sphere's part of
area S, outward normal n and the sample's density pdf, the ray's power is L |n w| S / pdf.  For a
lamp at a point, whose sample is the irradiance across w with pdf 1, it is the same formula.

The sphere is large beside the lamp, so that |n w| is nearly 1.  Of it only the part is used that
the lamp's rays can reach (`LightBounds`): half for a flat lamp, a cap for a spot light.

Light from infinitely far away comes through the disk, across its direction, of the sphere around
the scene.
"""

import math
from typing import NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import Vec3, dot, frame_from_normal, row, to_world
from reference_rt.jit.kernel import kernel
from reference_rt.lights.dispatch import sample_one
from reference_rt.lights.tables import LightTables
from reference_rt.sampling.distribution import count_up_to
from reference_rt.sampling.warp import concentric_disk, on_circle
from reference_rt.shapes import Shapes
from reference_rt.textures import Textures


class Emission(NamedTuple):
    """For the n lights of a scene that can be picked: probability (n,) and its running sums
    cumulative (n,), which end with 1;  centre (n, 3) and radius (n,) of the sphere around a light,
    of the scene's for light from infinitely far away, whose number in `is_far` (n,) is 1;  axis (n,
    3), and height (n,), from 0 to 2, of the sphere's cap around it, over the radius."""

    probability: FloatArray
    cumulative: FloatArray
    centre: FloatArray
    radius: FloatArray
    is_far: FloatArray
    axis: FloatArray
    height: FloatArray


def no_emission(n: int) -> Emission:
    """Rows of zeros."""
    return Emission(*(np.zeros(shape) for shape in (n, n, (n, 3), n, n, (n, 3), n)))


class Emitted(NamedTuple):
    """A ray from a lamp.  power: over its density, in W, linear sRGB; black if none is sent;
    is_delta: whether the lamp has no extent."""

    ray: Ray
    power: Vec3
    is_delta: bool


@kernel
def emit(
    lights: LightTables,
    emission: Emission,
    shapes: Shapes,
    textures: Textures | None,
    u_pick: float,
    at: tuple[float, float],
    around: tuple[float, float],
) -> Emitted:
    """A ray from a lamp.  at: numbers for the light's sample;  around: for the point on the sphere
    or the disk."""
    k = min(count_up_to(emission.cumulative, u_pick), len(emission.cumulative) - 1)
    centre, radius, chance = row(emission.centre, k), emission.radius[k], emission.probability[k]
    if emission.is_far[k] != 0.0:
        far = sample_one(lights, k, shapes, textures, centre, at[0], at[1])
        if far.pdf == 0.0:
            return Emitted(Ray(centre, far.wi, 0.0), Vec3(0.0, 0.0, 0.0), False)
        x, y = concentric_disk(around[0], around[1])
        o = centre + to_world(frame_from_normal(far.wi), Vec3(x, y, 1.0)) * radius
        area = math.pi * radius * radius
        power = far.radiance * (area / (far.pdf * chance))
        return Emitted(Ray(o, -far.wi, math.inf), power, far.is_delta)
    below = around[0] * emission.height[k]
    across, (cosine, sine) = math.sqrt(below * (2.0 - below)), on_circle(around[1])
    frame = frame_from_normal(row(emission.axis, k))
    n = to_world(frame, Vec3(across * cosine, across * sine, 1.0 - below))
    near = sample_one(lights, k, shapes, textures, centre + n * radius, at[0], at[1])
    if near.pdf == 0.0:
        return Emitted(Ray(centre, n, 0.0), Vec3(0.0, 0.0, 0.0), False)
    area = 2.0 * math.pi * emission.height[k] * radius * radius
    power = near.radiance * (abs(dot(n, near.wi)) * area / (near.pdf * chance))
    return Emitted(Ray(near.target, -near.wi, math.inf), power, near.is_delta)
