"""Array queries of a scene: rays, points and directions in, hits, densities and radiance out.

`hits`: first hits, and occlusion;  `crossings`: all crossings along a ray;  `bsdf`: evaluate and
sample a material;  `light`: light samples and densities;  `radiance`: any integrator along given
rays;  `tracing`: the entry kernels, and which of them traces how many rays;  `links`: a scene's
tables behind links, as these kernels take them;  `rays`: checks, broadcasting, threads; camera
rays.
A scene has the queries as methods; most functions here take the scene's tables instead.

Contract: all arrays are float64 or int64.  Origins and directions are (..., 3) in world coordinates
and scene units, and broadcast.  Directions may have any length; t counts in units of |d|.  A ray
misses if one of its numbers is not finite, if its direction is 0, or if its hit would have a point
or t beyond float64's range.  Arrays of other shapes, and arrays that are not numeric, raise
ValueError.

To add a query: a function here with its entry kernel, exported below; a line in `scene.py`.  The
kernel takes links with the operations that it calls (`link_to_geometry`, `link_to_scene` or
`links.linked`), so that all scenes share it.
"""

from reference_rt.rendering.query.bsdf import Bsdf, BsdfSamples
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
from reference_rt.rendering.query.rays import CameraRays, camera_rays

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
]
