"""The rung of direct light: f cos L of one point of one light at a time."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.coincidence import is_doubled, on_two_surfaces
from comparisons.rungs.rays.lamp_images import is_beside, magnified, slopes_of_image
from comparisons.rungs.rays.light_context import DISTANT, POINT_LIKE, LightContext, kind_of
from comparisons.rungs.rays.light_context import described as described_light
from comparisons.rungs.rays.light_error import bounds, slopes_of
from comparisons.rungs.rays.mitsuba_light import (
    _lamp,
    is_blocked,
    is_dark,
    leads_past,
    mitsuba_direct,
)
from comparisons.rungs.rays.rays import described, mixed_rays
from comparisons.rungs.rays.resolution import (
    NOT_BEYOND,
    elsewhere,
    too_many_elsewhere,
)
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.lights import AREA
from reference_rt.rendering import query
from reference_rt.rendering.query import DirectLight
from reference_rt.rendering.scene import Scene

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

    rays: how many were compared;  lit: how many of these on either side, and `right` of them alike
    (`arbiter.tells`);
    unexplained: indices of those that differ;  ours, theirs (m, 3): their values in W/sr/m²;
    explained: indices of those that the arbiter explains;  unaimed: of those among them whose
    shadow rays miss the lamp, or meet another surface in its place, by geometry;  max_error,
    max_ratio: the largest error, and error over bound, of the rest;  ratio, cosine (m,): of rays
    that differ and are lit on both sides, our value over Mitsuba's, and the cosine at the surface.
    """

    rays: int
    lit: int
    right: int
    unexplained: IntArray
    ours: FloatArray
    theirs: FloatArray
    explained: IntArray
    unaimed: IntArray
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
    if not tables.materials.smooth.any():
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
    explained = sum(len(o.explained) for o in outcomes.values())
    unexplained = sum(len(o.unexplained) for o in outcomes.values())
    numbers: dict[str, Any] = {
        "rays": total,
        "lights": count,
        "lights_tested": len(tested),
        "explained": explained,
        "unexplained": unexplained,
        "lit": sum(o.lit for o in outcomes.values()),
        "lit_right": sum(o.right for o in outcomes.values()),
        "max_error": max(o.max_error for o in outcomes.values()),
        "max_error_over_bound": max(o.max_ratio for o in outcomes.values()),
    }
    numbers["tells"] = arbiter.is_enough(numbers["lit_right"], numbers["lit"])
    numbers |= _ratios(list(outcomes.values()))
    settled = np.concatenate([np.setdiff1d(o.explained, o.unaimed) for o in outcomes.values()])
    numbers["explained_elsewhere"] = too_many_elsewhere(
        scene, tables, counterpart, rays.rows(settled), total
    )
    if unexplained:
        left = np.unique(np.concatenate([o.unexplained for o in outcomes.values()]))
        numbers["elsewhere"] = elsewhere(scene, tables, counterpart, rays.rows(left))
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
    if total == 0:
        reason = "no point of a light is known for any ray"
        return RungResult("direct", "not-applicable", reason, numbers)
    if not numbers["tells"]:
        shadows += f"; only {numbers['lit_right']} of {numbers['lit']} lit values say anything"
    if numbers["explained_elsewhere"]:
        return RungResult("direct", "differ", f"{shadows}, but {NOT_BEYOND}", numbers)
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
    target = _targets(context, light, ours)
    is_known = (hits.shape >= 0) & np.isfinite(target).all(axis=1)
    if kind_of(context, light) == AREA:  # the target is a point
        is_known &= ~_in_plane(context, target)
    known = np.flatnonzero(is_known)
    if len(known) == 0:
        none = np.zeros((0, 3))
        return Outcome(0, 0, 0, known, none, none, known, known, 0.0, 0.0, np.zeros(0), np.zeros(0))
    context, target = context.of(known), target[known]
    rays, hits = context.rays, context.hits
    value = ours.contribution[known]
    theirs, their_cosine = mitsuba_direct(context, light, rays, target)
    bound = bounds(context, light, target, (value, theirs, their_cosine), brightest)
    bound += slopes_of(context, light, u, value)
    scale = magnified(context, light, target, ours.pdf[known])
    bound += slopes_of_image(context, light, u, value, scale)
    error = np.abs(theirs - value).max(axis=1)
    wrong = np.flatnonzero(~(error <= bound))
    # Mitsuba's shadow ray explains that only one side is lit where ours is as our own shadow ray
    # says: not where our light shines elsewhere or from behind the surface, or where it passes
    # through surfaces.
    is_lit = np.asarray(value.any(axis=1), dtype=np.bool_)
    kind = kind_of(context, light)
    is_bounded = kind in POINT_LIKE and POINT_LIKE[kind].is_bounded
    may_flip = is_lit | (ours.pdf[known] > 0.0) | (not is_bounded)
    asked = wrong[may_flip[wrong]]
    may_flip[asked] = is_lit[asked] != is_blocked(context.of(asked), light, target[asked])

    def like_theirs(numbers: IntArray, offsets: FloatArray) -> arbiter.BoolArray:
        there = query.direct_light(
            tables, rays.o[numbers] + offsets, rays.d[numbers], light, u
        ).contribution
        # The move itself shifts the value by as much as the bound: twice is allowed.
        error = np.abs(there - theirs[numbers]).max(axis=1)
        dark = ~theirs[numbers].any(axis=1)
        lit_differs = (is_lit[numbers] == dark) & may_flip[numbers]
        now_dark = is_dark(context.of(numbers), light, target[numbers], offsets, lamp[numbers])
        return np.asarray((error <= 2.0 * bound[numbers]) | (lit_differs & (now_dark == dark)))

    lamp = _lamp(context, light, target)
    radius = context.sizes.frame.delta(rays.o, hits.p, context.sizes.reach_of(hits.shape))
    radius += context.off_by("sag")
    settled = arbiter.explained(wrong, radius[wrong], like_theirs)
    allowed = 2.0 * bound[wrong]
    some = context.of(wrong)
    settled |= is_beside(some, light, u, theirs[wrong], allowed, scale[wrong])
    past = leads_past(some, target[wrong], lamp[wrong], radius[wrong])
    if kind_of(context, light) == AREA:
        doubled = is_doubled(context.sizes, tables, some.hits.p, target[wrong])
        settled, past = settled | doubled, past | doubled
    right, shines = error <= bound, is_lit | theirs.any(axis=1)
    left = wrong[~settled]
    lit = left[value[left].any(axis=1) & theirs[left].any(axis=1)]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.nan_to_num(error[right] / bound[right])
    return Outcome(
        rays=len(known),
        lit=int(np.count_nonzero(shines)),
        right=int(np.count_nonzero(shines & right & arbiter.tells(bound, value, theirs))),
        unexplained=known[left],
        ours=value[left],
        theirs=theirs[left],
        explained=known[wrong[settled]],
        unaimed=known[wrong[settled & past]],
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


def _targets(context: LightContext, light: int, ours: DirectLight) -> FloatArray:
    """(n, 3): the point on the light for each ray; NaN where it is not known.

    Our query returns no point where no light can arrive.  A light without extent has the point of
    its description there, to check that Mitsuba is dark as well; and if a lamp has the same point
    for all rays, so has it.
    """
    seen = ours.pdf > 0.0
    kind = kind_of(context, light)
    if kind in POINT_LIKE:
        p = context.hits.p
        towards = POINT_LIKE[kind].towards(described_light(context, light), p)
        there = towards if kind in DISTANT else p + towards
        return np.where(seen[:, None], ours.target, there)
    target = np.full_like(ours.target, np.nan)
    target[seen] = ours.target[seen]
    if seen.any() and np.ptp(ours.target[seen], axis=0).max() == 0.0:
        target[:] = ours.target[seen][0]
    return target
