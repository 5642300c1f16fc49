"""Direct light in Mitsuba: its value, and where its shadow-ray epsilons make it dark."""

from functools import reduce
from operator import or_
from typing import Any

import numpy as np

from comparisons.geometry.frame import SHADOW_EPSILON
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.plugins.base import is_wide
from comparisons.mitsuba.plugins.whitted import is_shape, without
from comparisons.mitsuba.scene import for_rays, light_id
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.light_context import (
    DISTANT,
    POINT_LIKE,
    LightContext,
    kind_of,
    number_of,
)
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.resolution import AROUND, off_surface, own_error
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.lights import AREA
from reference_rt.rendering import query
from reference_rt.shapes import TABLES as SHAPE_TABLES


def mitsuba_direct(
    context: LightContext, light: int, rays: Rays, target: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """f cos L (n, 3) and the cosine at the surface (n,), by Mitsuba's own hit, BSDF, visibility and
    emitter."""
    import drjit as dr

    mi, scene, kind = mitsuba(), context.counterpart.lit, kind_of(context, light)
    emitter = _point_emitter(context, light) if kind in POINT_LIKE else None
    lamps = _lamps(context, light) if kind == AREA else []
    is_far = kind in DISTANT

    def value(o: Any, d: Any, at: Any) -> tuple[Any, ...]:
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(o), d))
        active = si.is_valid()
        if not dr.any(active):
            return mi.Color3f(0.0), mi.Float(0.0)
        wi = at if is_far else dr.normalize(at - si.p)
        ray = si.spawn_ray(wi) if is_far else si.spawn_ray_to(mi.Point3f(at))
        visible = without(active, scene.ray_test(ray, active))
        if emitter is not None:
            sample, radiance = emitter.sample_direction(si, mi.Point2f(0.5, 0.5), active)
            wi = sample.d
        else:
            ray.maxt = dr.inf
            # The first hit along the unshortened shadow ray must be the front of the light itself:
            # not the sky that a ray sees which passes a lamp by, nor a lamp right in front.
            found = scene.ray_intersect(ray, visible)
            radiance = scene.emitted(found, visible)
            if kind == AREA:
                visible = visible & found.is_valid()
                if lamps and is_wide(mi):
                    visible = visible & reduce(or_, (is_shape(mi, found, x) for x in lamps))
                elif lamps and visible:
                    visible = found.shape.id() in {lamp.id() for lamp in lamps}
        local = si.to_local(wi)
        f_cos = si.bsdf().eval(mi.BSDFContext(), si, local, visible)
        return dr.select(visible, f_cos * radiance, 0.0), local.z

    frame = context.counterpart.frame
    there = target if is_far else frame.into(target)
    contribution, cosine = for_rays(value, frame.into(rays.o), rays.d, there)
    return contribution, cosine


def _lamps(context: LightContext, light: int) -> list[Any]:
    """Mitsuba's shapes for the one that is an area light, or has it among its faces."""
    choice, areas = context.tables.lights.choice, context.tables.lights.areas
    if choice is None or areas is None:
        return []
    row = int(choice.row[light])
    field = next(field for code, field, _, _ in SHAPE_TABLES if code == areas.kind[row])
    # A mesh alone has one number for all its triangles.
    owners = getattr(context.tables.geometry.shapes, field).owner
    owner = int(owners[areas.row[row] if len(owners) > 1 else 0])
    counterpart = context.counterpart
    names = {name for name, one in counterpart.mi_shapes.items() if one.shape == owner}
    return [one for one in counterpart.lit.shapes() if one.id() in names]


def _point_emitter(context: LightContext, light: int) -> Any:
    """Mitsuba's emitter of a point, spot or directional light."""
    wanted = light_id(number_of(context, light))
    for emitter in context.counterpart.lit.emitters():
        if emitter.id() == wanted:
            return emitter
    raise LookupError(f"Mitsuba's scene has no emitter {wanted}")


def is_dark(
    context: LightContext, light: int, target: FloatArray, offsets: FloatArray, lamp: IntArray
) -> arbiter.BoolArray:
    """(n,): whether Mitsuba's shadow ray, shortened by its epsilons, is blocked in our tracer, or
    meets another surface than the light behind its end;  lamp: the light's shape, -1 if unknown.

    It starts on that side of the surface to which Mitsuba's geometric normal tells it: on a mesh
    that stands in for a curved shape, that of a flat triangle.
    """
    hits, theirs = context.hits, context.theirs
    n = np.where((theirs.shape == hits.shape)[:, None], theirs.n, hits.n)
    kind = kind_of(context, light)
    is_far = kind in DISTANT
    w = target if is_far else target - hits.p
    side = np.where(np.sum(w * n, axis=1) < 0.0, -1.0, 1.0)
    height = side * context.counterpart.frame.epsilon(hits.p)
    o = hits.p + hits.n * height[:, None] + offsets
    if is_far:
        return query.occluded(context.tables, o, w)
    if kind in POINT_LIKE:
        return query.occluded(context.tables, o, target - o, 1.0 - SHADOW_EPSILON)
    # From the moved origin the ray may see the light's back, or miss its rim; float32 moves the
    # point on the light as much as the origin, so that the ray may miss a smaller light.
    met = query.intersect(context.tables, o, target - offsets - o)
    facing = np.sum(met.n * (target - o), axis=1) < 0.0
    passed_by = met.t > 1.0 + SHADOW_EPSILON
    before = (lamp >= 0) & (met.shape != lamp)
    return np.asarray((met.t < 1.0 - SHADOW_EPSILON) | passed_by | ~facing | before)


def is_blocked(context: LightContext, light: int, target: FloatArray) -> arbiter.BoolArray:
    """(n,): whether our own shadow ray, as exact as float64 is, meets a surface."""
    hits, sizes = context.hits, context.sizes
    is_far = kind_of(context, light) in DISTANT
    w = target if is_far else target - hits.p
    o = off_surface(sizes, hits, w)
    if is_far:
        return np.asarray(query.occluded(context.tables, o, w))
    end = 1.0 - own_error(sizes, hits) / np.linalg.norm(w, axis=1)
    return np.asarray(query.occluded(context.tables, o, target - o, end))


JUST_BEFORE = 1e-7
"""The fraction of a shadow ray, before its end, from which the light's own shape is met."""


def lamp_at(context: LightContext, target: FloatArray) -> query.Intersections:
    """What lies at the points (n, 3) on an area light: the light's own surface."""
    step = JUST_BEFORE * (target - context.hits.p)
    return query.intersect(context.tables, target - step, 2.0 * step)


def leads_past(
    context: LightContext, target: FloatArray, lamp: IntArray, radius: FloatArray
) -> arbiter.BoolArray:
    """(n,): whether a shadow ray towards a point on a lamp meets another shape, another face, or
    none, for a move of the point by float32's error, (n,): the lamp is narrower than that, or the
    point at its rim or at an edge of its faces.  No light is asked."""
    o = off_surface(context.sizes, context.hits, target - context.hits.p)
    face = lamp_at(context, target).primitive
    past = np.zeros(len(target), bool)
    for move in arbiter.directions(AROUND):
        met = query.intersect(context.tables, o, target + radius[:, None] * move - o)
        past |= (met.shape != lamp) | (met.primitive != face)
    return past & (lamp >= 0)


def _lamp(context: LightContext, light: int, target: FloatArray) -> IntArray:
    """(n,): the shape that the points on an area light lie on; -1 if that is not known."""
    if kind_of(context, light) != AREA:
        return np.full(len(target), -1)
    return lamp_at(context, target).shape.astype(np.int64)
