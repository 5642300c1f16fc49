"""How much radiance changes within float32's error of a ray: highlights, textures and bent normals
amplify the error of a point or a direction.

The change is measured with our own tracer, along rays moved by float32's bound.
"""

from collections.abc import Callable, Sequence

import numpy as np

from comparisons.geometry.frame import ROUNDINGS, UNIT_ROUNDOFF
from comparisons.lights import type_of
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.rays import Rays
from reference_rt.core.arrays import FloatArray
from reference_rt.materials import Diffuse, Emissive, Material, Wrapper
from reference_rt.rendering.scene import Scene

STEPS = 8
"""Number of moved rays."""

STEEPEST = 1e-2
"""Fraction of the brightest value: a larger change within float32's bound is an edge, which is left
to the arbiter."""


def is_steep(scene: Scene) -> bool:
    """Whether any material has a glossy lobe, a texture, or is made of others, or a light projects
    an image: untextured diffuse materials, lamps and perfect mirrors are not steep."""

    def is_flat(material: Material) -> bool:
        if isinstance(material, Emissive):
            return not isinstance(material.radiance, str)
        if isinstance(material, Wrapper) or material.oriented:
            return False
        plain = isinstance(material, Diffuse) and not isinstance(material.reflectance, str)
        return plain or not material.smooth

    if any(type_of(light).projects(light) for light in scene.lights):
        return True
    return not all(is_flat(material) for material in scene.materials.values())


def moved(rays: Rays, radius: FloatArray) -> list[Rays]:
    """STEPS versions of the rays: origins moved by `radius` (n,), directions turned by float32's
    error, on the opposite side of the sphere."""
    moves = arbiter.directions(STEPS)
    versions = []
    for move, way in zip(moves, np.roll(moves, STEPS // 2, axis=0), strict=True):
        turned = rays.d + ROUNDINGS * UNIT_ROUNDOFF * way
        turned /= np.linalg.norm(turned, axis=1)[:, None]
        versions.append(Rays(rays.o + radius[:, None] * move, turned))
    return versions


NEAR = 0.01
"""How far from the point that it must hit a turned ray starts, as a fraction of its length: a ray
from further away meets other surfaces."""


def turned(rays: Rays, p: FloatArray, angle: FloatArray) -> list[Rays]:
    """Four versions of the rays that hit the same points p (n, 3), turned about them by `angle`
    (n,), up, down, left and right."""
    length = np.linalg.norm(p - rays.o, axis=1)[:, None]
    forward = rays.d / np.linalg.norm(rays.d, axis=1)[:, None]
    least = np.eye(3)[np.argmin(np.abs(forward), axis=1)]
    right = np.cross(forward, least)
    right /= np.linalg.norm(right, axis=1)[:, None]
    up = np.cross(right, forward)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    versions = []
    for across in (right, up, -right, -up):
        d = cosine * forward + sine * across
        versions.append(Rays(p - NEAR * length * d, d))
    return versions


def slopes(
    value: FloatArray, others: Sequence[Callable[[], FloatArray]], brightest: FloatArray | float
) -> FloatArray:
    """(n,): how far `value` (n, 3) may change, from the values `others` of moved rays.

    Twice the largest change: the directions of the moves are up to a cosine of 0.7 apart.
    """
    largest = np.zeros(len(value))
    for other in others:
        change = np.abs(other() - value).max(axis=1)
        largest = np.maximum(largest, np.where(change <= STEEPEST * brightest, change, 0.0))
    return 2.0 * largest
