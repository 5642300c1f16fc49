"""The rung of direct light: f cos L of one point of one light at a time."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry.frame import SHADOW_EPSILON
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.plugins.whitted import without
from comparisons.mitsuba.scene import for_rays, light_id
from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.coincidence import is_doubled, on_two_surfaces
from comparisons.rungs.rays.lamp_images import is_beside, magnified, slopes_of_image
from comparisons.rungs.rays.light_error import (
    DISTANT,
    POINT_LIKE,
    LightContext,
    bounds,
    kind_of,
    number_of,
    of_stand_ins,
    slopes_of,
)
from comparisons.rungs.rays.rays import Rays, described, mixed_rays
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import AREA
from reference_rt.materials import any_smooth
from reference_rt.rendering import query
from reference_rt.rendering.query import DirectLight
from reference_rt.rendering.scene import Scene

# ---- direct light in Mitsuba: its value, and where its shadow-ray epsilons make it dark ----------


def mitsuba_direct(
    context: LightContext, light: int, rays: Rays, target: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """f cos L (n, 3) and the cosine at the surface (n,), by Mitsuba's own hit, BSDF, visibility and
    emitter."""
    import drjit as dr

    mi, scene, kind = mitsuba(), context.counterpart.lit, kind_of(context, light)
    emitter = _point_emitter(context, light) if kind in POINT_LIKE else None
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
            # The first hit along the unshortened shadow ray must be the front of the light itself.
            found = scene.ray_intersect(ray, visible)
            radiance = scene.emitted(found, visible)
        local = si.to_local(wi)
        f_cos = si.bsdf().eval(mi.BSDFContext(), si, local, visible)
        return dr.select(visible, f_cos * radiance, 0.0), local.z

    frame = context.counterpart.frame
    there = target if is_far else frame.into(target)
    contribution, cosine = for_rays(value, frame.into(rays.o), rays.d, there)
    return contribution, cosine


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


JUST_BEFORE = 1e-7
"""The fraction of a shadow ray, before its end, from which the light's own shape is met."""


def _lamp(context: LightContext, light: int, target: FloatArray) -> IntArray:
    """(n,): the shape that the points on an area light lie on; -1 if that is not known."""
    if kind_of(context, light) != AREA:
        return np.full(len(target), -1)
    step = JUST_BEFORE * (target - context.hits.p)
    return query.intersect(context.tables, target - step, 2.0 * step).shape.astype(np.int64)


PIXELS = 1024
"""Most camera rays; as many random and as many secondary rays are added."""

LIGHTS = 8
"""Most lights that are tested, evenly spread over the scene's."""

POINTS = ((0.47, 0.41), (0.13, 0.71), (0.83, 0.22), (0.37, 0.93))
"""(u, v) that pick a point on a light: none on the edge of a face of any shape, or on an axis of a
disk, which is an edge of texels if their number is even."""

FEWEST = 20
"""Least number of differing values for which the statistics of their ratio are reported."""


class Outcome(NamedTuple):
    """The comparison at one point of one light.

    rays: how many were compared;  unexplained: indices of those that differ;  ours, theirs (m, 3):
    their values in W/sr/m²;  explained: how many the arbiter explains;  max_error, max_ratio: the
    largest error, and error over bound, of the rest;  ratio, cosine (m,): of rays that differ and
    are lit on both sides, our value over Mitsuba's, and the cosine at the surface.
    """

    rays: int
    unexplained: IntArray
    ours: FloatArray
    theirs: FloatArray
    explained: int
    max_error: float
    max_ratio: float
    ratio: FloatArray
    cosine: FloatArray


def direct(
    scene: Scene, tables: SceneTables, counterpart: Counterpart, pixels: int = PIXELS, seed: int = 0
) -> RungResult:
    """Compare f cos L of single lights where camera, random and secondary rays hit.

    At most LIGHTS of the scene's lights, at POINTS each.  Where only one renderer sees the light,
    the arbiter traces Mitsuba's shadow ray, with its epsilons, in our tracer.
    """
    choice = tables.lights.choice
    if choice is None:
        return RungResult("direct", "not-applicable", "the scene has no light")
    if counterpart.no_light_reason:
        return RungResult("direct", "not-comparable", counterpart.no_light_reason)
    if not any_smooth(tables.materials):
        reason = "no material has a diffuse or glossy lobe, so that lights are not sampled"
        return RungResult("direct", "not-applicable", reason)
    sizes = ShapeSizes(scene, counterpart.frame)
    rays = mixed_rays(scene, tables, sizes, pixels, seed, counterpart.sags())
    hits, theirs = query.intersect(tables, rays.o, rays.d), trace(counterpart, rays.o, rays.d)
    hits.shape[theirs.at_origin | on_two_surfaces(sizes, tables, rays, hits, theirs)] = -1
    context = LightContext(scene, tables, counterpart, rays, hits, theirs, sizes)
    lights = np.flatnonzero(choice.probability > 0.0)
    count = len(lights)
    tested = lights[np.unique(np.linspace(0, count - 1, min(count, LIGHTS)).round().astype(int))]
    answers: dict[tuple[int, tuple[float, float]], DirectLight] = {}
    for light in tested.tolist():
        points = POINTS[:1] if choice.kind[light] in POINT_LIKE else POINTS
        for u in points:
            answers[light, u] = query.direct_light(tables, rays.o, rays.d, light, u)
    brightest = max((float(a.contribution.max(initial=0.0)) for a in answers.values()), default=0.0)
    outcomes = {
        (light, u): _compare(context, light, u, ours, brightest)
        for (light, u), ours in answers.items()
    }
    total = sum(o.rays for o in outcomes.values())
    explained = sum(o.explained for o in outcomes.values())
    unexplained = sum(len(o.unexplained) for o in outcomes.values())
    numbers: dict[str, Any] = {
        "rays": total,
        "lights": count,
        "lights_tested": len(tested),
        "explained": explained,
        "unexplained": unexplained,
        "max_error": max(o.max_error for o in outcomes.values()),
        "max_error_over_bound": max(o.max_ratio for o in outcomes.values()),
    }
    numbers |= _ratios(list(outcomes.values()))
    for (light, u), outcome in outcomes.items():
        if len(outcome.unexplained):
            k = int(outcome.unexplained[0])
            reason = (
                f"{unexplained} of {total} values differ by more than float32 explains; the first: "
                f"light {light}, point u = {u}, {described(scene.film, pixels, rays, k)}: "
                f"ours {outcome.ours[0]}, Mitsuba's {outcome.theirs[0]} W/sr/m²"
            )
            return RungResult("direct", "differ", reason, numbers)
    shadows = (
        f"{explained} of {total} values are not resolved by Mitsuba: at edges, or within its "
        "shadow epsilon"
    )
    if arbiter.too_many(explained, total):
        return RungResult("direct", "reference-limited", shadows, numbers)
    reason = (
        f"{len(tested)} of {count} lights compared; the largest error is "
        f"{numbers['max_error_over_bound']:.2g} times float32's bound; {shadows}"
    )
    return RungResult("direct", "agree", reason, numbers)


def _ratios(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """The ratio of ours to Mitsuba's where they differ: its median, and its spread (between the
    quartiles, over the median), as it is and times the cosine at the surface.  Empty for fewer than
    FEWEST values."""
    ratio = np.concatenate([outcome.ratio for outcome in outcomes])
    cosine = np.concatenate([outcome.cosine for outcome in outcomes])
    if len(ratio) < FEWEST:
        return {}
    return {
        "ratio_median": float(np.median(ratio)),
        "ratio_spread": _spread(ratio),
        "ratio_times_cosine_spread": _spread(ratio * cosine),
    }


def _spread(values: FloatArray) -> float:
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
    return float((high - low) / abs(middle)) if middle else math.inf


def _compare(
    context: LightContext, light: int, u: tuple[float, float], ours: DirectLight, brightest: float
) -> Outcome:
    """One point of one light at all hits;  brightest: the largest value of all lights' points."""
    rays, hits, tables = context.rays, context.hits, context.tables
    target = _targets(ours)
    is_known = (hits.shape >= 0) & np.isfinite(target).all(axis=1)
    if kind_of(context, light) == AREA:  # the target is a point
        is_known &= ~_in_plane(context, target)
    known = np.flatnonzero(is_known)
    if len(known) == 0:
        none = np.zeros((0, 3))
        return Outcome(0, known, none, none, 0, 0.0, 0.0, np.zeros(0), np.zeros(0))
    context, target = context.of(known), target[known]
    rays, hits = context.rays, context.hits
    value = ours.contribution[known]
    theirs, their_cosine = mitsuba_direct(context, light, rays, target)
    bound = bounds(context, light, target, (value, theirs, their_cosine), brightest)
    bound += slopes_of(context, light, u, value)
    scale = magnified(context, light, target, ours.pdf[known])
    bound += slopes_of_image(context, light, u, value, scale)
    # Where a light does not shine, no shadow ray explains that Mitsuba's does.
    kind = kind_of(context, light)
    is_bounded = kind in POINT_LIKE and POINT_LIKE[kind].is_bounded
    of_shadow = (ours.pdf[known] > 0.0) | (not is_bounded)
    error = np.abs(theirs - value).max(axis=1)
    wrong = np.flatnonzero(~(error <= bound))

    def like_theirs(numbers: IntArray, offsets: FloatArray) -> arbiter.BoolArray:
        there = query.direct_light(
            tables, rays.o[numbers] + offsets, rays.d[numbers], light, u
        ).contribution
        # The move itself shifts the value by as much as the bound: twice is allowed.
        error = np.abs(there - theirs[numbers]).max(axis=1)
        dark = ~theirs[numbers].any(axis=1)
        lit_differs = (value[numbers].any(axis=1) == dark) & of_shadow[numbers]
        now_dark = is_dark(context.of(numbers), light, target[numbers], offsets, lamp[numbers])
        return np.asarray((error <= 2.0 * bound[numbers]) | (lit_differs & (now_dark == dark)))

    lamp = _lamp(context, light, target)
    radius = context.sizes.frame.delta(rays.o, hits.p, context.sizes.reach_of(hits.shape))
    radius += of_stand_ins(context, "sag")
    settled = arbiter.explained(wrong, radius[wrong], like_theirs)
    allowed = 2.0 * bound[wrong]
    some = context.of(wrong)
    settled |= is_beside(some, light, u, theirs[wrong], allowed, scale[wrong])
    if kind_of(context, light) == AREA:
        settled |= is_doubled(context.sizes, tables, some.hits.p, target[wrong])
    right = error <= bound
    left = wrong[~settled]
    lit = left[value[left].any(axis=1) & theirs[left].any(axis=1)]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nan_to_num(error[right] / bound[right])
    return Outcome(
        rays=len(known),
        unexplained=known[left],
        ours=value[left],
        theirs=theirs[left],
        explained=int(np.count_nonzero(settled)),
        max_error=float(error[right].max(initial=0.0)),
        max_ratio=float(ratio.max(initial=0.0)),
        ratio=value[lit].sum(axis=1) / theirs[lit].sum(axis=1),
        cosine=np.abs(their_cosine[lit]),
    )


def _in_plane(context: LightContext, target: FloatArray) -> arbiter.BoolArray:
    """(n,): whether the point on the light lies in the plane of the surface that is lit, within
    float32's error: on the lamp's own triangle, for example.  Which side it lights is not known."""
    rays, hits, sizes = context.rays, context.hits, context.sizes
    height = np.abs(np.sum((target - hits.p) * hits.n, axis=1))
    return np.asarray(height <= sizes.frame.delta(rays.o, hits.p, sizes.reach_of(hits.shape)))


def _targets(ours: DirectLight) -> FloatArray:
    """(n, 3): the point on the light for each ray; NaN where it is not known.

    Our query returns no point where no light can arrive.  If a light has the same point for all
    rays, that point is used there too, to check that Mitsuba is dark as well.
    """
    seen = ours.pdf > 0.0
    target = np.full_like(ours.target, np.nan)
    target[seen] = ours.target[seen]
    if seen.any() and np.ptp(ours.target[seen], axis=0).max() == 0.0:
        target[:] = ours.target[seen][0]
    return target
