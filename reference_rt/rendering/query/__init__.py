"""What can be asked about a scene with arrays of rays, points and directions.

`Scene` has all of it as methods; most functions here take the scene's tables, for callers that have
these.  `hits` and `crossings`: which surfaces rays meet;  `light`:
samples of lights and their densities;  `bsdf`: what a material scatters;  `camera`: the camera's
rays;  `radiance`: the light along given rays, by any integrator;  `rays`: how arrays are checked.

All arrays are float64 or int64; origins and directions are (..., 3) in world coordinates and scene
units, and broadcast; directions need not have unit length: t counts in units of |d|.  A ray of
which a number is not finite, or whose direction is 0, meets nothing; neither does one that would at
a point, or a t, beyond float64's range.  Arrays of other shapes, and what is not numbers, raise
ValueError.
"""

import warnings
from typing import Any

import numpy.typing as npt

from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.query.bsdf import Bsdf, BsdfSamples
from reference_rt.rendering.query.camera import CameraRays, camera_rays
from reference_rt.rendering.query.crossings import Crossings, crossings
from reference_rt.rendering.query.hits import (
    Closest,
    Hits,
    Intersections,
    closest_primitives,
    first_hits,
    intersect,
    occluded,
)
from reference_rt.rendering.query.light import (
    DirectLight,
    LightSamples,
    LightSources,
    direct_light,
    light_pdf,
    light_sources,
    sample_lights,
)
from reference_rt.rendering.query.radiance import Radiance, radiance, radiance_without_noise


def closest(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    threads: int | None = None,
) -> Closest:
    """Deprecated: `first_hits` tells the numbers of shapes in place of internal codes."""
    warnings.warn(
        "query.closest tells internal codes; use Scene.first_hits or query.first_hits",
        DeprecationWarning,
        stacklevel=2,
    )
    return closest_primitives(scene, origins, directions, threads)


def whitted_radiance(
    scene: SceneTables, integrator: Any, origins: npt.ArrayLike, directions: npt.ArrayLike
) -> FloatArray:
    """Deprecated: the name of `radiance_without_noise` says what it does."""
    warnings.warn(
        "query.whitted_radiance is now query.radiance_without_noise; see also Scene.radiance",
        DeprecationWarning,
        stacklevel=2,
    )
    return radiance_without_noise(scene, integrator, origins, directions)


__all__ = [
    "Bsdf",
    "BsdfSamples",
    "CameraRays",
    "Closest",
    "Crossings",
    "DirectLight",
    "Hits",
    "Intersections",
    "LightSamples",
    "LightSources",
    "Radiance",
    "camera_rays",
    "closest",
    "closest_primitives",
    "crossings",
    "direct_light",
    "first_hits",
    "intersect",
    "light_pdf",
    "light_sources",
    "occluded",
    "radiance",
    "radiance_without_noise",
    "sample_lights",
    "whitted_radiance",
]
