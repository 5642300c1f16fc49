"""Rays that leave a surface: how far off they may begin, and whether they meet light."""

import math
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.in_mitsuba import loaded
from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS, FloatArray, U
from comparisons.mitsuba.backend import scalar
from reference_rt.accel.geometry import Geometry, closest_hit, occluded, surface
from reference_rt.core.ray import Ray, SurfacePoint, ray_from
from reference_rt.core.vec3 import Vec3, dot, row
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.rendering.kept_links import link_to_geometry

PIXELS = 160
"""Across a picture."""

EPSILON = 1e-4
"""Of the textbook's offset."""

CONTACT = 4.0
"""Bounds B: a shape that is thicker must not be lost, nor a neighbour that is farther away."""


def bound(largest: float, size: float) -> float:
    """B: how far a ray may begin off the surface, whatever the shape is: `surface_error`'s
    16 sqrt(3) u (|anchor| + |p| + extent), where anchors and points have coordinates below
    `largest`, that of the middle, + sqrt(3) size, and extents about the anchor are below 3 size;
    and the rounding of the sum, another sqrt(3) u of a part of that."""
    return 17.0 * math.sqrt(3.0) * U * (2.0 * largest + 6.0 * size)


@kernel
def ray_leaving(ray: Ray, t: float, point: SurfacePoint, w: Vec3, epsilon: float) -> Ray:
    """Ours, or for an epsilon above 0 the textbook's ray: it begins at o + t d, and what is nearer
    than epsilon does not count, so that it might as well begin there."""
    if epsilon > 0.0:
        return Ray(ray.o + ray.d * t + w * epsilon, w, math.inf)
    return ray_from(point, w)


@entry_kernel
def _lit(
    geometry: Geometry, o: FloatArray, d: FloatArray, w: FloatArray, epsilon: float, out: FloatArray
) -> None:
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        hit = closest_hit(geometry, ray)
        out[i, 0] = -1.0
        if hit.kind >= 0:
            point, towards = surface(geometry, ray, hit), row(w, i)
            leaving = ray_leaving(ray, hit.t, point, towards, epsilon)
            out[i, 0] = 0.0 if occluded(geometry, leaving) else 1.0
            out[i, 1] = abs(dot(towards, point.n))


def lit(
    contestant: str, scene: rt.Scene, o: FloatArray, d: FloatArray, w: FloatArray
) -> FloatArray:
    """(n, 2) of rays: 1 where the surface that they meet is lit from w, 0 in shadow, -1 for a miss;
    the cosine of w to the surface."""
    out = np.zeros((len(o), 2))
    if contestant == MITSUBA:
        with scalar() as mi:
            mi_scene = loaded(scene)
            for k, (begin, way, to) in enumerate(
                zip(o.tolist(), d.tolist(), w.tolist(), strict=True)
            ):
                si = mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(begin), mi.Vector3f(way)))
                out[k, 0] = -1.0
                if si.is_valid():
                    out[k, 0] = not mi_scene.ray_test(si.spawn_ray(mi.Vector3f(to)))
                    out[k, 1] = abs(float(np.dot(si.n, to)))
        return out
    epsilon = 0.0 if contestant == OURS else EPSILON
    found = link_to_geometry(rt.build_tables(scene), "closest_hit", "surface", "occluded")
    _lit(found.tables, o, d, w, epsilon, out)
    return out


def light_picture(found: FloatArray) -> Any:
    """(PIXELS, PIXELS, 3): surfaces in grey by their cosine, black in shadow; misses are blue."""
    grey = np.where(found[:, 0] > 0.0, 60.0 + 180.0 * found[:, 1], 12.0)
    rgb = np.repeat(grey[:, None], 3, axis=1)
    rgb[found[:, 0] < 0.0] = (40.0, 60.0, 90.0)
    return rgb.reshape(PIXELS, PIXELS, 3).astype(np.uint8)
