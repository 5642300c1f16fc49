"""The rung of geometry: the same rays hit the same surfaces at the same points."""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.hits import BoolArray, MitsubaHits, rows_of
from comparisons.referee.referee import Referee
from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult, Status
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.aimed import aimed_rays
from comparisons.rungs.rays.any_hit import any_hits
from comparisons.rungs.rays.camera import compare_camera
from comparisons.rungs.rays.coincidence import coincident, in_one_place
from comparisons.rungs.rays.comparer import DISCRETE, KINDS, Comparer
from comparisons.rungs.rays.judgement import MOST_JUDGED, Judgement, judged
from comparisons.rungs.rays.media import media_along
from comparisons.rungs.rays.rays import Rays, described, joined, mixed_rays
from comparisons.rungs.rays.resolution import resolution
from reference_rt.cameras.film import Film
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene

BY_EXACT_ARITHMETIC = "by our fault (exact arithmetic decides)"
"""In the reason: where float32 decides otherwise than we do, the arbiter may find that ours is
wrong."""

PIXELS = 16_700
"""Most camera rays, evenly strided.  Random and secondary rays make them 50,000; 50,000 more are
aimed at edges: see `mixed_rays` and `aimed_rays`."""


class TracedRays(NamedTuple):
    """Rays and their hits in both tracers;  ratios (n, KINDS): errors over bounds;  radius (n,):
    how far the arbiter may move each ray."""

    rays: Rays
    ours: Intersections
    theirs: MitsubaHits
    ratios: FloatArray
    radius: FloatArray


def geometry(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    pixels: int = PIXELS,
    seed: int = 0,
    *,
    resolved: bool = True,
) -> RungResult:
    """Compare the cameras, and the first hits of rays: 3 `pixels` of the camera, at random and from
    hits, and as many that are aimed at edges, drawn with `seed`.

    Both tracers get the same float32 numbers.  Agreement needs every ray's hit, shape, face, t,
    normals and uv to be within float32's bound, or the arbiter to find that float32 cannot resolve
    the ray.  For what remains exact arithmetic decides which tracer is wrong.  Any-hit queries are
    compared with closest hits, and with rays through every triangle of meshes.

    resolved: whether `resolution` is measured too.
    """
    camera = compare_camera(scene, counterpart, pixels)
    sizes = ShapeSizes(scene, counterpart.frame)
    unaimed = mixed_rays(scene, tables, sizes, pixels, seed, counterpart.sags())
    aimed = aimed_rays(tables, sizes, len(unaimed.o), seed)
    rays = joined(unaimed, aimed)
    is_aimed = np.arange(len(rays.o)) >= len(unaimed.o)
    comparer = Comparer(sizes)
    traced, beyond = _traced(tables, counterpart, comparer, rays)
    wrong = np.flatnonzero((traced.ratios > 1.0).any(axis=1))
    settled = _explained(tables, comparer, traced, wrong)
    left = wrong[~settled]
    together = coincident(scene, counterpart, comparer, traced, left)
    mismatches = left[~together]
    # What the arbiter explained may lie in one place too.
    apart = wrong[settled][~in_one_place(comparer, traced, wrong[settled])]
    mismatches = mismatches[np.argsort(is_aimed[mismatches], kind="stable")]
    verdict = judged(Referee(sizes, TOGETHER), rays, traced.ours, traced.theirs, mismatches)
    mismatches = mismatches[~np.isin(mismatches, verdict.both)]
    explained = apart
    shadows = any_hits(tables, counterpart, sizes, rays, traced.ours, seed)
    right = traced.ratios[(traced.ratios <= 1.0).all(axis=1)]
    say = partial(_describe, traced, scene.film, pixels)
    numbers: dict[str, Any] = {
        "rays": len(rays.o),
        "hits": int(np.count_nonzero(traced.ours.shape >= 0)),
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
            kind: int(np.count_nonzero(traced.ratios[mismatches, k] > 1.0))
            for k, kind in enumerate(KINDS)
        },
        "mitsuba_wrong": [say(k) for k in verdict.mitsuba[:LISTED].tolist()],
        "stand_ins": {
            f"shape_{shape}": [s._asdict() for s in found]
            for shape, found in counterpart.stand_ins().items()
        },
        "any_hit_rays": shadows.rays,
        "any_hit_triangles": shadows.triangles,
        "any_hit_wrong": shadows.wrong,
        "any_hit_mitsuba_wrong": shadows.mitsuba_wrong,
        **camera.numbers,
    }
    if resolved and not isinstance(scene.integrator, RayCast):
        found = resolution(scene, tables, counterpart, seed)
        numbers |= {"resolution": found._asdict(), "is_limited": found.is_limited}
    along = media_along(scene, counterpart, sizes) if scene.media else None
    if along is not None:
        numbers |= {f"media_{key}": value for key, value in along._asdict().items()}
    if camera.problem:
        return RungResult("geometry", "differ", camera.problem, numbers)
    status, reason = _outcome(traced, verdict, is_aimed, numbers, say)
    if shadows.wrong and status != "differ":
        status = "differ"
        reason = f"{shadows.wrong} of {shadows.rays} shadow rays are wrong; {shadows.first}"
    if along is not None and along.too_many and status != "differ":
        status = "differ"
        reason = f"{along.wrong} of {along.rays} rays are in other media; {along.first}"
    if along is not None and along.is_limited and status == "agree":
        status = "reference-limited"
        reason = (
            f"{along.lost} of {along.rays} rays cross two surfaces that are nearer to each other "
            "than Mitsuba's ray epsilon, and are in other media behind them"
        )
    return RungResult("geometry", status, reason, numbers)


FEW = 1e-4
"""Largest fraction of rays, not aimed at edges, that Mitsuba may get wrong by rounding.  More means
that its scene is a different one."""

TOGETHER = 2.0**-40
"""See `Referee`: a thousand times the rounding of tables, and a thousandth of the tolerance of our
t, `SHARE`."""

LISTED = 20
"""Most rays that are listed of those that Mitsuba gets wrong."""


def _outcome(
    traced: TracedRays,
    verdict: Judgement,
    is_aimed: BoolArray,
    numbers: dict[str, Any],
    say: Callable[[int], str],
) -> tuple[Status, str]:
    """The status and the reason;  say: describes a ray.

    Few hits that Mitsuba alone gets wrong are its precision; many mean that its scene is another
    one.
    """
    total, mitsuba = len(is_aimed), verdict.mitsuba
    count = int(np.count_nonzero(~is_aimed))
    unaimed = int(np.count_nonzero(~is_aimed[mitsuba]))
    ours = np.concatenate([verdict.ours, verdict.undecided])
    if len(ours) and (len(verdict.ours) or not _is_rest(traced, verdict, is_aimed)):
        text = f"{numbers['mismatches']} of {total} rays differ"
        if len(verdict.ours):
            text += f", {len(verdict.ours)} {BY_EXACT_ARITHMETIC}"
        first = int((verdict.ours if len(verdict.ours) else ours)[0])
        return "differ", f"{text}; the first: {say(first)}"
    if arbiter.too_many(unaimed, count, FEW):
        where = say(int(mitsuba[0]))
        return "differ", (
            f"{numbers['mismatches']} of {total} rays differ; by exact arithmetic our hits are "
            f"right, so Mitsuba's scene is a different one; the first: {where}"
        )
    text = (
        f"{numbers['explained']} of {count} rays pass too close to an edge for float32 "
        f"({numbers['aimed_explained']} of {total - count} rays aimed at edges)"
    )
    if numbers["coincident"]:
        text += f"; {numbers['coincident']} rays hit coincident surfaces"
    if numbers["beyond_planes"]:
        text += (
            f"; {numbers['beyond_planes']} rays hit an infinite plane beyond the finite mesh that "
            "stands in for it"
        )
    if numbers["mismatches"]:
        aimed = numbers["aimed_mismatches"]
        text += (
            f"; by exact arithmetic Mitsuba's hit is wrong for {unaimed} rays and {aimed} rays "
            "aimed at edges"
        )
    many_aimed = arbiter.too_many(numbers["aimed_mismatches"], total - count)
    if arbiter.too_many(numbers["explained"], count) or unaimed or many_aimed:
        numbers["tells"] = arbiter.is_enough(count - numbers["explained"] - unaimed, count)
        return "reference-limited", text
    worst = max(v for k, v in numbers.items() if k.endswith("error_over_bound"))
    return "agree", f"{total} rays agree, within {worst:.2g} of float32's bound; {text}"


def _is_rest(traced: TracedRays, verdict: Judgement, is_aimed: BoolArray) -> bool:
    """Whether all undecided mismatches are aimed rays beyond MOST_JUDGED, and Mitsuba was wrong for
    all that were judged."""
    count = len(verdict.mitsuba) + len(verdict.undecided)
    return (
        len(verdict.mitsuba) == MOST_JUDGED < count
        and bool(is_aimed[verdict.undecided].all())
        and bool((traced.ratios[verdict.undecided, :DISCRETE] > 1.0).any(axis=1).all())
    )


def _traced(
    tables: SceneTables, counterpart: Counterpart, comparer: Comparer, rays: Rays
) -> tuple[TracedRays, int]:
    """The hits of both tracers, and how many rays are left out: those that hit an infinite plane
    beyond the finite mesh that stands in for it."""
    ours, theirs = query.intersect(tables, rays.o, rays.d), trace(counterpart, rays.o, rays.d)
    ratios = comparer.ratios(rays, ours, theirs)
    beyond = counterpart.beyond_planes(ours, theirs)
    ratios[beyond | theirs.at_origin] = 0.0
    sizes = comparer.sizes
    reach = np.maximum(sizes.reach_of(ours.shape), sizes.reach_of(theirs.shape))
    radius = sizes.frame.delta(rays.o, np.where(ours.shape[:, None] >= 0, ours.p, theirs.p), reach)
    radius += np.maximum(*(counterpart.off_by(hits.shape, "sag") for hits in (ours, theirs)))
    return TracedRays(rays, ours, theirs, ratios, radius), int(np.count_nonzero(beyond))


def _explained(
    tables: SceneTables, comparer: Comparer, traced: TracedRays, wrong: IntArray
) -> BoolArray:
    """Which of the rays `wrong` (m,) float32 cannot resolve: a ray next to them has Mitsuba's hit
    in our tracer.

    Or two rays next to them have it together: one reaches as far as Mitsuba's hit, and one that
    starts just before that hits the same surface.  At an edge Mitsuba may miss the front face and
    hit the back face from behind, as no single ray can; between two faces that meet there, such as
    the side of a cylinder and its cap, it may miss both.  Or the ray begins in the plane that
    Mitsuba hits, but for its rounding, and runs along it: no ray next to it has the same distance.
    """
    rays, radius = traced.rays, traced.radius
    explained = arbiter.explained(wrong, radius[wrong], _same_hit(tables, comparer, traced))
    rest = np.flatnonzero(~explained & (traced.theirs.shape[wrong] >= 0))
    numbers = wrong[rest]
    theirs = rows_of(traced.theirs, numbers)
    near = rays.rows(numbers)
    length = np.linalg.norm(near.d, axis=1)
    along = np.abs(np.sum(theirs.n * near.d, axis=1)) / length
    margin = 4.0 * radius[numbers] / np.maximum(along, 1.0 / STEEPEST) / length

    def comes_so_far(rows: IntArray, offsets: FloatArray) -> BoolArray:
        moved = query.intersect(tables, near.o[rows] + offsets, near.d[rows])
        return np.asarray(moved.t >= (theirs.t - margin)[rows])

    ours = rows_of(traced.ours, numbers)

    def meets_another_face(rows: IntArray, offsets: FloatArray) -> BoolArray:
        moved = query.intersect(tables, near.o[rows] + offsets, near.d[rows])
        before = moved.t < (theirs.t - margin)[rows]
        face = np.column_stack([moved.shape, moved.instance, moved.part, moved.primitive])
        own = np.column_stack([ours.shape, ours.instance, ours.part, ours.primitive])[rows]
        return np.asarray(before & (face != own).any(axis=1))

    here = np.arange(len(numbers))
    comes = arbiter.explained(here, radius[numbers], comes_so_far)
    leaks = np.flatnonzero(~comes & (ours.shape >= 0) & (ours.t < theirs.t))
    comes[leaks] = arbiter.explained(leaks, radius[numbers[leaks]], meets_another_face)
    meets = np.zeros(len(numbers), bool)
    for way in (1.0, -1.0):  # start just before Mitsuba's hit, or just behind it and go back
        start = near.o + near.d * (theirs.t - way * margin)[:, None]
        some = dataclasses.replace(theirs, t=margin)
        beside = traced._replace(rays=Rays(start, way * near.d), theirs=some)
        open_ = np.flatnonzero(comes & ~meets)
        same = _same_hit(tables, comparer, beside)
        meets[open_] = arbiter.explained(open_, radius[numbers[open_]], same)
    height = np.abs(np.sum(theirs.n * (near.o - theirs.p), axis=1))
    explained[rest] = meets | (height <= radius[numbers])
    return explained


STEEPEST = 64.0
"""Cap of one over the cosine, for how far before a hit a ray starts."""


def _same_hit(
    tables: SceneTables, comparer: Comparer, traced: TracedRays
) -> Callable[[IntArray, FloatArray], BoolArray]:
    """The arbiter's test: whether moved rays have Mitsuba's hit in our tracer."""
    rays, theirs = traced.rays, traced.theirs

    def like_theirs(numbers: IntArray, offsets: FloatArray) -> BoolArray:
        moved = Rays(rays.o[numbers] + offsets, rays.d[numbers])
        again = query.intersect(tables, moved.o, moved.d)
        ratios = comparer.ratios(moved, again, rows_of(theirs, numbers))
        # The move itself shifts t and uv by as much as the bound: twice is allowed.
        return np.asarray((ratios <= 2.0).all(axis=1))

    return like_theirs


def _describe(traced: TracedRays, film: Film, most: int, k: int) -> str:
    kind = KINDS[int(np.argmax(traced.ratios[k]))]
    sides = [
        f"{who}: shape {hits.shape[k]}, part {hits.part[k]}, primitive {hits.primitive[k]}, "
        f"instance {hits.instance[k]}, t = {hits.t[k]:.9g}, n = {hits.n[k]}"
        for who, hits in (("ours", traced.ours), ("Mitsuba's", traced.theirs))
    ]
    return f"{kind} of {described(film, most, traced.rays, k)}: {'; '.join(sides)}"
