"""Sunlight on what rays meet: shadows where there are none are seen as speckle."""

import math
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.methods.setting import FloatArray
from comparisons.experiments.stability.harness.family import MITSUBA, OURS, Draw, Shot
from comparisons.experiments.stability.leaving.shapes import Extent, Placed, place
from comparisons.experiments.stability.leaving.tracer import EPSILON, scene_of
from comparisons.geometry import frame
from comparisons.mitsuba import translate
from comparisons.mitsuba.backend import scalar
from reference_rt.accel.geometry import Geometry, closest_hit, occluded, surface
from reference_rt.core.ray import Ray, at, ray_from
from reference_rt.core.vec3 import dot, row
from reference_rt.jit.kernel import entry_kernel

PIXELS = 160
"""Across a picture."""


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
            leaving = ray_from(point, towards)
            if epsilon > 0.0:
                leaving = Ray(at(ray, hit.t) + towards * epsilon, towards, math.inf)
            out[i, 0] = 0.0 if occluded(geometry, leaving) else 1.0
            out[i, 1] = abs(dot(towards, point.n))


def lit(
    contestant: str, scene: rt.Scene, o: FloatArray, d: FloatArray, w: FloatArray
) -> FloatArray:
    """Of what rays meet, (n, 2): 1 where nothing lies towards w, 0 in shadow, -1 for a miss; the
    cosine of w to the surface."""
    out = np.zeros((len(o), 2))
    if contestant == MITSUBA:
        with scalar() as mi:
            mi_scene = translate.load(scene, frame.OURS).mi_scene
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
    _lit(rt.build_tables(scene).geometry, o, d, w, epsilon, out)
    return out


def picture(found: FloatArray) -> Any:
    """(PIXELS, PIXELS, 3): what was met in grey by its cosine, black in shadow, the rest blue."""
    grey = np.where(found[:, 0] > 0.0, 60.0 + 180.0 * found[:, 1], 12.0)
    rgb = np.repeat(grey[:, None], 3, axis=1)
    rgb[found[:, 0] < 0.0] = (40.0, 60.0, 90.0)
    return rgb.reshape(PIXELS, PIXELS, 3).astype(np.uint8)


def shoot(contestant: str, kind: str, extent: Extent, draw: Draw) -> Shot:
    """One of a kind in a sun that stands beside the eye: everything seen is lit, but what lies on
    the far side of its terminator."""
    placed = place(kind, extent, draw)
    o, d = _view(placed)
    sun = np.array([0.6, 0.48, 0.64]) @ _frame(placed).T
    w = np.tile(sun, (len(o), 1))
    found = lit(contestant, scene_of(placed), o, d, w)
    dark = int((found[:, 0] == 0.0).sum())
    caption = (
        f"{contestant}: a {kind} in sunlight, {dark:,} of {int((found[:, 0] >= 0.0).sum()):,} "
        "points in shadow"
    )
    return Shot(picture(found), caption)


def _frame(placed: Placed) -> FloatArray:
    """The axes of a shape, unit; as good as perpendicular."""
    return np.asarray(placed.linear / np.linalg.norm(placed.linear, axis=0))


def _view(placed: Placed) -> tuple[FloatArray, FloatArray]:
    """Parallel rays (n, 3) along the shape's own -z, in its own proportions."""
    ticks = (np.arange(PIXELS) + 0.5) / PIXELS * 2.6 - 1.3
    x, y = np.meshgrid(ticks, -ticks)
    local = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 3.0)])
    d = np.tile(-_frame(placed)[:, 2], (x.size, 1))
    return local @ placed.linear.T + placed.center, d
