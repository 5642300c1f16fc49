"""The first rung: the same rays hit the same places."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry.exact.referee import Referee
from comparisons.mitsuba.counterpart import Twin, trace
from comparisons.mitsuba.hits import Answers, BoolArray, rows_of
from comparisons.results.case import Status, Tier
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.adversarial_rays import aimed_rays
from comparisons.rungs.rays.bounds import ShapeSizes
from comparisons.rungs.rays.camera import compare_camera
from comparisons.rungs.rays.coincidence import coincident, in_one_place
from comparisons.rungs.rays.comparer import DISCRETE, KINDS, Comparer
from comparisons.rungs.rays.judgement import FEW, MOST_JUDGED, Judgement, judged
from comparisons.rungs.rays.rays import Rays, mixed_rays
from comparisons.rungs.rays.resolution import resolution
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene

PIXELS = 16_700
"""Camera rays that are compared at most, evenly strided.  With these make 50,000 random rays and
rays from hits; 50,000 more are aimed: see `mixed_rays` and `aimed_rays`."""


class Answered(NamedTuple):
    """Rays, what ours and Mitsuba's found, errors over bounds (n, KINDS), and how far a ray may be
    moved for the arbiter (n,)."""

    rays: Rays
    ours: Intersections
    theirs: Answers
    ratios: FloatArray
    radius: FloatArray


def geometry(
    scene: Scene, tables: SceneTables, twin: Twin, pixels: int = PIXELS, seed: int = 0
) -> Tier:
    """Compare camera rays, and what rays hit: 3 `pixels` of the camera, at random and from hits,
    and as many that are aimed at edges, drawn with `seed`.

    Both tracers get the same float32 numbers.  Agreement needs every ray's hit, shape, face, t,
    normals and uv to be within float32's bound, or the arbiter to say that float32 cannot resolve
    the ray.  What remains is told, and whose fault it is.
    """
    camera = compare_camera(scene, twin, pixels)
    sizes = ShapeSizes(scene, twin.frame)
    unaimed = mixed_rays(scene, tables, sizes, pixels, seed)
    aimed = aimed_rays(tables, sizes, len(unaimed.o), seed)
    rays = Rays(*(np.concatenate(pair) for pair in zip(unaimed, aimed, strict=True)))
    is_aimed = np.arange(len(rays.o)) >= len(unaimed.o)
    comparer = Comparer(sizes)
    answered, beyond = _answered(tables, twin, comparer, rays)
    wrong = np.flatnonzero((answered.ratios > 1.0).any(axis=1))
    settled = _explained(tables, comparer, answered, wrong)
    left = wrong[~settled]
    together = coincident(scene, twin, comparer, answered, left)
    mismatches = left[~together]
    # What the arbiter explained may lie in one place too.
    apart = wrong[settled][~in_one_place(comparer, answered, wrong[settled])]
    mismatches = mismatches[np.argsort(is_aimed[mismatches], kind="stable")]
    verdict = judged(Referee(sizes), rays, answered.ours, answered.theirs, mismatches)
    explained = apart
    right = answered.ratios[(answered.ratios <= 1.0).all(axis=1)]
    numbers: dict[str, Any] = {
        "rays": len(rays.o),
        "hits": int(np.count_nonzero(answered.ours.shape >= 0)),
        "mismatches": len(mismatches),
        "decided_ours": len(verdict.ours),
        "decided_mitsuba": len(verdict.mitsuba),
        "undecided": len(verdict.undecided),
        "explained": int(np.count_nonzero(~is_aimed[explained])),
        "aimed_rays": int(np.count_nonzero(is_aimed)),
        "aimed_mismatches": int(np.count_nonzero(is_aimed[mismatches])),
        "aimed_explained": int(np.count_nonzero(is_aimed[explained])),
        "coincident": len(wrong) - len(mismatches) - len(explained),
        "beyond_planes": beyond,
        **{
            f"max_{kind}_error_over_bound": float(right[:, k].max(initial=0.0))
            for k, kind in enumerate(KINDS)
            if k >= DISCRETE
        },
        "mismatches_by_kind": {
            kind: int(np.count_nonzero(answered.ratios[mismatches, k] > 1.0))
            for k, kind in enumerate(KINDS)
        },
        "mitsuba_wrong": [_describe(answered, k) for k in verdict.mitsuba[:LISTED].tolist()],
        "stand_ins": {
            f"shape_{shape}": [s._asdict() for s in found]
            for shape, found in twin.stand_ins().items()
        },
        **camera.numbers,
    }
    if not isinstance(scene.integrator, RayCast):
        numbers["resolution"] = resolution(scene, tables, twin, seed)._asdict()
    if camera.problem:
        return Tier("geometry", "differ", camera.problem, numbers)
    status, reason = _outcome(answered, verdict, is_aimed, numbers)
    return Tier("geometry", status, reason, numbers)


LISTED = 20
"""Rays that Mitsuba gets wrong, of those that are listed."""


def _outcome(
    answered: Answered, verdict: Judgement, is_aimed: BoolArray, numbers: dict[str, Any]
) -> tuple[Status, str]:
    """What the mismatches mean: those that are Mitsuba's own are its limit, where they are few."""
    total, mitsuba = len(is_aimed), verdict.mitsuba
    count = int(np.count_nonzero(~is_aimed))
    unaimed = int(np.count_nonzero(~is_aimed[mitsuba]))
    ours = np.concatenate([verdict.ours, verdict.undecided])
    if len(ours) and (len(verdict.ours) or not _is_rest(answered, verdict, is_aimed)):
        told = f"{numbers['mismatches']} of {total} rays differ"
        if len(verdict.ours):
            told += f", {len(verdict.ours)} by our fault"
        first = int((verdict.ours if len(verdict.ours) else ours)[0])
        return "differ", f"{told}; the first: {_describe(answered, first)}"
    if arbiter.too_many(unaimed, count, FEW):
        where = _describe(answered, int(mitsuba[0]))
        return "differ", (
            f"{numbers['mismatches']} of {total} rays differ, and ours are right about what they "
            f"meet: Mitsuba's scene is another; the first: {where}"
        )
    told = (
        f"{numbers['explained']} of {count} rays meet edges that float32 cannot resolve "
        f"({numbers['aimed_explained']} of {total - count} aimed at edges)"
    )
    if numbers["coincident"]:
        told += f", {numbers['coincident']} two surfaces in one place"
    if numbers["beyond_planes"]:
        told += f", {numbers['beyond_planes']} an infinite plane beyond its twin"
    if numbers["mismatches"]:
        aimed = numbers["aimed_mismatches"]
        told += f"; {unaimed} and {aimed} aimed are Mitsuba's mistakes, by exact arithmetic"
    many_aimed = arbiter.too_many(numbers["aimed_mismatches"], total - count)
    if arbiter.too_many(numbers["explained"], count) or unaimed or many_aimed:
        return "reference-limited", told
    worst = max(v for k, v in numbers.items() if k.endswith("error_over_bound"))
    return "agree", f"{total} rays agree to {worst:.2g} of float32's bound; {told}"


def _is_rest(answered: Answered, verdict: Judgement, is_aimed: BoolArray) -> bool:
    """Whether what is undecided are aimed rays for which there was no time, all others of which
    were found to be Mitsuba's."""
    count = len(verdict.mitsuba) + len(verdict.undecided)
    return (
        len(verdict.mitsuba) == MOST_JUDGED < count
        and bool(is_aimed[verdict.undecided].all())
        and bool((answered.ratios[verdict.undecided, :DISCRETE] > 1.0).any(axis=1).all())
    )


def _answered(
    tables: SceneTables, twin: Twin, comparer: Comparer, rays: Rays
) -> tuple[Answered, int]:
    """What both found, and how many rays are left out: those that meet an infinite plane beyond
    what there is of it in Mitsuba."""
    ours, theirs = query.intersect(tables, rays.o, rays.d), trace(twin, rays.o, rays.d)
    ratios = comparer.ratios(rays, ours, theirs)
    beyond = _beyond(twin, ours)
    ratios[beyond] = 0.0
    sizes = comparer.sizes
    reach = np.maximum(sizes.reach_of(ours.shape), sizes.reach_of(theirs.shape))
    sag = np.zeros(len(sizes.reach) + 1)
    for shape, found in twin.stand_ins().items():
        sag[shape] = max(s.sag for s in found)
    radius = sizes.frame.delta(rays.o, np.where(ours.shape[:, None] >= 0, ours.p, theirs.p), reach)
    radius += np.maximum(sag[ours.shape], sag[theirs.shape])
    return Answered(rays, ours, theirs, ratios, radius), int(np.count_nonzero(beyond))


def _beyond(twin: Twin, ours: Intersections) -> BoolArray:
    beyond = np.zeros(len(ours.t), bool)
    for shape, extent in twin.extents().items():
        far = np.linalg.norm(ours.p - extent.middle, axis=1) > extent.radius
        beyond |= (ours.shape == shape) & far
    return beyond


def _explained(
    tables: SceneTables, comparer: Comparer, answered: Answered, wrong: IntArray
) -> BoolArray:
    """Which of the rays `wrong` (m,) float32 cannot resolve: beside them, ours has Mitsuba's
    answer.

    Or two rays beside have it together: one comes as far as Mitsuba's hit, and one that begins just
    before meets what it hit.  Along an edge Mitsuba may miss one side and yet hit the other from
    behind, as no single ray can.
    """
    rays, radius = answered.rays, answered.radius
    found = arbiter.explained(wrong, radius[wrong], _same_answer(tables, comparer, answered))
    rest = np.flatnonzero(~found & (answered.theirs.shape[wrong] >= 0))
    numbers = wrong[rest]
    theirs = rows_of(answered.theirs, numbers)
    near = rows_of_rays(rays, numbers)
    length = np.linalg.norm(near.d, axis=1)
    along = np.abs(np.sum(theirs.n * near.d, axis=1)) / length
    margin = 4.0 * radius[numbers] / np.maximum(along, 1.0 / STEEPEST) / length

    def comes_so_far(rows: IntArray, offsets: FloatArray) -> BoolArray:
        moved = query.intersect(tables, near.o[rows] + offsets, near.d[rows])
        return np.asarray(moved.t >= (theirs.t - margin)[rows])

    here = np.arange(len(numbers))
    comes = arbiter.explained(here, radius[numbers], comes_so_far)
    meets = np.zeros(len(numbers), bool)
    for way in (1.0, -1.0):  # from just before Mitsuba's hit, and from just behind it, back
        start = near.o + near.d * (theirs.t - way * margin)[:, None]
        some = dataclasses.replace(theirs, t=margin)
        beside = answered._replace(rays=Rays(start, way * near.d), theirs=some)
        open_ = np.flatnonzero(comes & ~meets)
        same = _same_answer(tables, comparer, beside)
        meets[open_] = arbiter.explained(open_, radius[numbers[open_]], same)
    found[rest] = meets
    return found


def rows_of_rays(rays: Rays, rows: IntArray) -> Rays:
    return Rays(rays.o[rows], rays.d[rows])


STEEPEST = 64.0
"""Of one over the cosine, for where a ray begins just before a hit."""


def _same_answer(
    tables: SceneTables, comparer: Comparer, answered: Answered
) -> Callable[[IntArray, FloatArray], BoolArray]:
    """Whether rays that are moved have Mitsuba's answer in ours."""
    rays, theirs = answered.rays, answered.theirs

    def like_theirs(numbers: IntArray, offsets: FloatArray) -> BoolArray:
        moved = Rays(rays.o[numbers] + offsets, rays.d[numbers])
        again = query.intersect(tables, moved.o, moved.d)
        ratios = comparer.ratios(moved, again, rows_of(theirs, numbers))
        # The move itself shifts t and uv by as much as the bound: twice is allowed.
        return np.asarray((ratios <= 2.0).all(axis=1))

    return like_theirs


def _describe(answered: Answered, k: int) -> str:
    rays = answered.rays
    kind = KINDS[int(np.argmax(answered.ratios[k]))]
    sides = [
        f"{who} shape {hits.shape[k]} part {hits.part[k]} primitive {hits.primitive[k]} instance "
        f"{hits.instance[k]} at t = {hits.t[k]:.9g}, n = {hits.n[k]}"
        for who, hits in (("ours", answered.ours), ("Mitsuba's", answered.theirs))
    ]
    return f"{kind}, from {rays.o[k].tolist()} along {rays.d[k].tolist()}: {'; '.join(sides)}"
