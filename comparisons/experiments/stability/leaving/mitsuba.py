"""Mitsuba's rays that leave a surface: `si.spawn_ray`."""

from typing import Any

import numpy as np

from comparisons.experiments.stability.harness.mitsubas import loaded
from comparisons.experiments.stability.leaving.shapes import Placed, Rays
from comparisons.experiments.stability.leaving.tracer import COLUMNS, Departures, Ways, scene_of
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.mitsuba.backend import mitsuba

KINDS = ("sphere", "rectangle", "disk", "triangle", "box", "cylinder", "mesh", "instance")
"""Kinds that it has itself, without proxy geometry."""


def depart(placed: Placed, rays: Rays, ways: Ways) -> Departures:
    """The same rays, in float32; in a scalar variant, which must be set: `scalar`."""
    out = np.zeros((len(rays.o), COLUMNS))
    out[:, 0] = out[:, 13] = np.inf
    mi = mitsuba()
    mi_scene = loaded(scene_of(placed))
    for k, (o, d, way) in enumerate(zip(*(a.tolist() for a in (*rays, *ways)), strict=True)):
        _depart(mi, mi_scene, o, d, way, out[k])
    return Departures.of(out)


def _depart(mi: Any, mi_scene: Any, o: list[float], d: list[float], way: Any, out: Any) -> None:
    si = mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(o), mi.Vector3f(d)))
    if not si.is_valid():
        return
    w = mi.Frame3f(si.n).to_world(mi.Vector3f(way))
    leaving = si.spawn_ray(w)
    met = mi_scene.ray_intersect(leaving)
    out[0] = si.t
    out[1:4], out[4:7], out[7:10], out[10:13] = si.p, si.n, leaving.o, leaving.d
    if met.is_valid():
        out[13], out[14] = met.t, float(np.dot(leaving.d, met.n))


def outer(ways: Ways, found: Departures) -> BoolArray:
    """Whether rays were to leave to the outer side; where float32 cannot decide (cosines below some
    hundred roundings of it), whether they begin there."""
    begun = np.sum((found.start - found.p) * found.n, axis=1) > 0.0
    return np.asarray(np.where(np.abs(ways.local[:, 2]) < 1e-5, begun, ways.outer))
