"""How steep what surfaces send is: highlights, textures and tilted normals turn float32's error of
a point or of a direction into one of light, many times as large in parts.

It is measured, by asking our own tracer along rays that are moved by float32's bound.
"""

from collections.abc import Callable, Sequence

import numpy as np

from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.bounds import ROUNDINGS, UNIT_ROUNDOFF
from comparisons.rungs.rays.rays import Rays
from reference_rt.core.arrays import FloatArray
from reference_rt.materials import Diffuse, Emissive, Material, Wrapper
from reference_rt.rendering.scene import Scene

STEPS = 8
"""Moved rays."""

STEEPEST = 1e-2
"""Of the brightest value: what float32's bound moves by more is an edge, which is for the
arbiter."""


def is_steep(scene: Scene) -> bool:
    """Whether any surface sends anything but the same to all sides from everywhere, or mirrors."""

    def is_flat(material: Material) -> bool:
        if isinstance(material, Emissive):
            return not isinstance(material.radiance, str)
        if isinstance(material, Wrapper) or material.oriented:
            return False
        plain = isinstance(material, Diffuse) and not isinstance(material.reflectance, str)
        return plain or not material.smooth

    return not all(is_flat(material) for material in scene.materials.values())


def moved(rays: Rays, radius: FloatArray) -> list[Rays]:
    """The rays, begun up to `radius` (n,) away and turned by float32's error, the opposite way
    round the sphere."""
    moves = arbiter.directions(STEPS)
    found = []
    for move, way in zip(moves, np.roll(moves, STEPS // 2, axis=0), strict=True):
        turned = rays.d + ROUNDINGS * UNIT_ROUNDOFF * way
        turned /= np.linalg.norm(turned, axis=1)[:, None]
        found.append(Rays(rays.o + radius[:, None] * move, turned))
    return found


def slopes(
    value: FloatArray, others: Sequence[Callable[[], FloatArray]], brightest: float
) -> FloatArray:
    """(n,): how far `value` (n, 3) may move, from what `others` give for moved rays.

    The moves leave gaps of a cosine of 0.7 between them: twice what was found is allowed.
    """
    found = np.zeros(len(value))
    for other in others:
        apart = np.abs(other() - value).max(axis=1)
        found = np.maximum(found, np.where(apart <= STEEPEST * brightest, apart, 0.0))
    return 2.0 * found
