"""How many secondary rays hit the wrong surface in Mitsuba: predicted from its precision, and
measured.

Mitsuba starts a ray that leaves a surface at p at the height h = (1 + max |p|) RAY_EPSILON above
it, and float32 may move the surface by e = `Frame.delta` to either side.  So the ray starts
anywhere between h - e and h + e: it skips thinner gaps and features, and if e exceeds h it may
start behind its own surface and hit it again.  Prediction: our own tracer, started at these
heights, hits another surface than from the exact point, or two that coincide.  Measurement:
Mitsuba's tracer, started as Mitsuba does, hits another surface."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from comparisons.lights import type_of
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.hits import BoolArray, rows_of
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.rays import Rays, mixed_rays
from comparisons.translator.accuracy import lets_pass
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene

RAYS = 2000
"""A third of the rays whose hits are the starting points."""

STRAIGHT_ON = 4
"""Most transparent surfaces that rays are followed through straight, for more starting points."""

STEEPEST = 64.0
"""Cap of one over the cosine: how far the next hit may slide along its surface."""

MOST_ASKED = 2000
"""Most rays that differ of which it is asked whether they are beyond Mitsuba's precision."""

AROUND = 12
"""Rays next to each ray that show whether it passes an edge."""

MOST_LIGHTS = 4
"""Most point, spot and directional lights that rays are sent towards from every hit."""


class Resolution(NamedTuple):
    """Counts of starting points.

    hits: all;  foretold: those with a predicted wrong hit;  found: with a measured one;  missed:
    measured but not predicted;  epsilon, rounding: the medians of h and e, of the predicted points
    if there are any.
    """

    hits: int
    foretold: int
    found: int
    missed: int
    epsilon: float
    rounding: float

    @property
    def is_limited(self) -> bool:
        """Whether, by prediction and by measurement, too many points are unresolved: secondary rays
        then show Mitsuba's precision instead of the scene."""
        return all(arbiter.too_many(count, self.hits) for count in (self.foretold, self.found))

    @property
    def description(self) -> str:
        return (
            f"beyond Mitsuba's precision: rays that leave a surface hit a wrong one from "
            f"{self.foretold} of {self.hits} points by prediction, and from {self.found} as "
            f"measured; Mitsuba starts them {self.epsilon:.2g} off a surface whose position "
            f"float32 resolves to {self.rounding:.2g}"
        )


def resolution(
    scene: Scene, tables: SceneTables, counterpart: Counterpart, seed: int = 0
) -> Resolution:
    """Trace rays from the hits of camera, random and secondary rays, and from those behind
    transparent surfaces: towards lights, at random, and straight through glass."""
    sizes = ShapeSizes(scene, counterpart.frame)
    rays = mixed_rays(scene, tables, sizes, RAYS, seed, counterpart.sags())
    d = rays.d
    ours, theirs = query.intersect(tables, rays.o, d), trace(counterpart, rays.o, d)
    # Only hits on which the tracers agree are starting points.
    slack = STEEPEST * counterpart.frame.delta(rays.o, ours.p, sizes.reach_of(ours.shape))
    same = np.flatnonzero((ours.shape >= 0) & ~_differs(ours, theirs, slack))
    some, met = rays.rows(same), (rows_of(ours, same), rows_of(theirs, same))
    leavings = [
        _left_behind(tables, counterpart, sizes, level.rays, level.ours, level.theirs, seed, scene)
        for level in _levels(scene, tables, sizes, some, *met)
    ]
    columns = [np.concatenate(column) for column in zip(*leavings, strict=True)]
    foretold, found, missed, height, rounding = columns
    counts = (int(np.count_nonzero(some)) for some in (foretold, found, missed))
    few = foretold if foretold.any() else np.ones(len(foretold), bool)
    medians = (float(np.median(x[few])) if len(x) else 0.0 for x in (height, rounding))
    return Resolution(len(foretold), *counts, *medians)


class _Level(NamedTuple):
    """Hits from which rays leave.  rows: of the rays that came first;  rays: those that hit here;
    theirs: Mitsuba's hits of the same rays; behind a transparent surface, ours."""

    rows: IntArray
    rays: Rays
    ours: Intersections
    theirs: Intersections


def _levels(
    scene: Scene,
    tables: SceneTables,
    sizes: ShapeSizes,
    rays: Rays,
    ours: Intersections,
    theirs: Intersections,
) -> Iterator[_Level]:
    """The hits of rays, all of which hit, and those behind transparent surfaces, straight on."""
    rows, d, hits = np.arange(len(rays.o)), rays.d, ours
    yield _Level(rows, rays, ours, theirs)
    for _ in range(STRAIGHT_ON):
        clear = np.flatnonzero(_is_clear(scene, sizes, hits))
        hits, d, rows = rows_of(hits, clear), d[clear], rows[clear]
        o = off_surface(sizes, hits, d)
        hits = query.intersect(tables, o, d)
        met = np.flatnonzero(hits.shape >= 0)
        o, d, hits, rows = o[met], d[met], rows_of(hits, met), rows[met]
        if len(rows) == 0:
            return
        yield _Level(rows, Rays(o, d), hits, hits)


Following = Callable[[Rays], tuple[IntArray, Rays]]
"""All rays (k,) of the trees of some rays, and of which of these each is, (k,)."""


def beyond_precision(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    rays: Rays,
    seed: int = 0,
    following: Following | None = None,
) -> BoolArray:
    """(n,): of which rays Mitsuba's precision may change what they show, by geometry alone.

    Either float32 may move the ray over an edge: rays next to it hit another surface.  Or a ray
    that leaves its hit, or one behind transparent surfaces, may hit a wrong one.  Or a ray of its
    tree, where `following` knows them, is moved over an edge, or hits two surfaces in one place.
    All are foretold by our tracer and by the reference's errors: no light is asked, so that a fault
    of light makes no ray seem to be beyond them.
    """
    sizes = ShapeSizes(scene, counterpart.frame)
    ours, beyond = _at_edges(tables, counterpart, sizes, rays)
    if following is not None and len(rays.o):
        rows, further = following(rays)
        hits, unsure = _at_edges(tables, counterpart, sizes, further)
        e = sizes.frame.delta(further.o, hits.p, sizes.reach_of(hits.shape))
        unsure |= _doubled(tables, sizes, hits, further.d, e)
        beyond |= np.bincount(rows[unsure], minlength=len(beyond)) > 0
    hit = np.flatnonzero(ours.shape >= 0)
    some, hits = rays.rows(hit), rows_of(ours, hit)
    for level in _levels(scene, tables, sizes, some, hits, hits):
        foretold, *_ = _left_behind(
            tables, counterpart, sizes, level.rays, level.ours, level.theirs, seed, scene
        )
        beyond[hit[level.rows]] |= foretold
    return beyond


def _at_edges(
    tables: SceneTables, counterpart: Counterpart, sizes: ShapeSizes, rays: Rays
) -> tuple[Intersections, BoolArray]:
    """Our hits of n rays, and which rays hit another surface when float32 moves them, (n,)."""
    ours = query.intersect(tables, rays.o, rays.d)
    reach = np.full(len(rays.o), sizes.reach.max(initial=0.0))
    there = np.where(ours.shape[:, None] >= 0, ours.p, rays.o)
    radius = sizes.frame.delta(rays.o, there, reach) + counterpart.off_by(ours.shape, "sag")
    at_edge = np.zeros(len(rays.o), bool)
    for move in arbiter.directions(AROUND):
        moved = query.intersect(tables, rays.o + radius[:, None] * move, rays.d)
        at_edge |= _differs(ours, moved, STEEPEST * radius)
    return ours, at_edge


def too_many_elsewhere(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    rays: Rays,
    total: int,
    following: Following | None = None,
) -> int:
    """Of rays that the arbiter explains, among `total`: how many Mitsuba's precision does not
    concern, if that is more than such rays may be; else 0.

    Those that hit a shape for which a mesh stands in are not asked: its edges are wider, and also
    change what lies beyond the hit.
    """
    hits = query.intersect(tables, rays.o, rays.d)
    is_exact = counterpart.off_by(hits.shape, "sag") == 0.0
    asked = rays.rows(np.flatnonzero(is_exact))
    if not arbiter.too_many(len(asked.o), total):
        return 0
    count = elsewhere(scene, tables, counterpart, asked, following)
    return count if arbiter.too_many(count, min(total, MOST_ASKED)) else 0


NOT_BEYOND = "too many of their rays are not beyond Mitsuba's precision by their own geometry"
"""Why values that the arbiter explains differ even so: rays next to them show Mitsuba's values, but
not because of an edge or of a surface that a ray may miss."""


def elsewhere(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    rays: Rays,
    following: Following | None = None,
) -> int:
    """How many of the rays, of at most MOST_ASKED, Mitsuba's precision does not concern."""
    step = -(-len(rays.o) // MOST_ASKED)
    some = rays.rows(np.arange(0, len(rays.o), max(step, 1)))
    beyond = beyond_precision(scene, tables, counterpart, some, following=following)
    return int(np.count_nonzero(~beyond))


def _left_behind(
    tables: SceneTables,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    rays: Rays,
    ours: Intersections,
    theirs: Intersections,
    seed: int,
    scene: Scene,
) -> tuple[BoolArray, BoolArray, BoolArray, FloatArray, FloatArray]:
    """For each hit (n,): whether a wrong next hit is predicted, measured, and measured but not
    predicted;  h and e."""
    frame, count = sizes.frame, len(ours.t)
    height = frame.epsilon(ours.p)
    rounding = frame.delta(rays.o, ours.p, sizes.reach_of(ours.shape))
    foretold, found, missed = np.zeros((3, count), bool)
    for w in _ways(scene, sizes, rays.d, ours, seed):
        leaves = np.flatnonzero(np.any(w != 0.0, axis=1))
        if len(leaves) == 0:
            continue
        w, hits, met = w[leaves], rows_of(ours, leaves), rows_of(theirs, leaves)
        right = query.intersect(tables, off_surface(sizes, hits, w), w)
        e = frame.delta(hits.p, right.p, sizes.reach_of(right.shape))
        slack = STEEPEST * ((height + rounding)[leaves] + e)
        expected = _doubled(tables, sizes, right, w, e)
        # float32 may move the next surface behind the ray's origin.
        there_is = right.shape >= 0
        height_there = np.where(there_is, right.t, 0.0) * np.abs(np.sum(right.n * w, axis=1))
        expected |= there_is & (height_there <= e)
        for start in (height - rounding, height, height + rounding):
            o = hits.p + _side(hits, w) * start[leaves, None]
            expected |= _differs(right, query.intersect(tables, o, w), slack)
        o = met.p + _side(met, w) * frame.epsilon(met.p)[:, None]
        there = _differs(right, trace(counterpart, o, w), slack)
        foretold[leaves] |= expected
        found[leaves] |= there
        missed[leaves] |= there & ~expected
    return foretold, found, missed, height, rounding


def _doubled(
    tables: SceneTables, sizes: ShapeSizes, right: Intersections, w: FloatArray, e: FloatArray
) -> BoolArray:
    """(n,): whether rays along w hit two surfaces that float32 cannot separate: at most 2 e apart
    along the normal."""
    met = np.flatnonzero(right.shape >= 0)
    doubled = np.zeros(len(w), bool)
    if len(met):
        front, along = rows_of(right, met), w[met]
        behind = query.intersect(tables, off_surface(sizes, front, along), along)
        doubled[met] = behind.t * np.abs(np.sum(front.n * along, axis=1)) <= 2.0 * e[met]
    return doubled


def _side(hits: Intersections, w: FloatArray) -> FloatArray:
    """(n, 3): the normals, on the side of w."""
    return np.asarray(hits.n * np.where(np.sum(w * hits.n, axis=1) < 0.0, -1.0, 1.0)[:, None])


def off_surface(sizes: ShapeSizes, hits: Intersections, w: FloatArray) -> FloatArray:
    """(n, 3): origins on w's side of the hit surface, as near as float64 allows."""
    return np.asarray(hits.p + _side(hits, w) * own_error(sizes, hits)[:, None])


def own_error(sizes: ShapeSizes, hits: Intersections) -> FloatArray:
    """(n,): `reference_rt.core.ray.surface_error` for the scene's largest coordinates."""
    reach = np.abs([sizes.lower, sizes.upper]).max()
    return np.asarray(16.0 * 3.0**0.5 * UNIT_ROUNDOFF * (np.abs(hits.p).max(axis=1) + 2.0 * reach))


def _differs(a: Intersections, b: Intersections, slack: FloatArray | float) -> BoolArray:
    """(n,): whether the hits are on different shapes, or more than `slack` apart.  The operand of a
    solid is not compared: operands may share faces."""
    other = (a.shape != b.shape) | (a.instance != b.instance)
    with np.errstate(invalid="ignore"):
        return np.asarray(other | (np.linalg.norm(a.p - b.p, axis=1) > slack))


def _ways(
    scene: Scene, sizes: ShapeSizes, d: FloatArray, hits: Intersections, seed: int
) -> list[FloatArray]:
    """Unit directions (n, 3) of rays from the hits, 0 for hits without such a ray."""
    rng = np.random.default_rng([seed, 2])
    front = hits.n * np.where(np.sum(d * hits.n, axis=1) > 0.0, -1.0, 1.0)[:, None]
    random = rng.normal(size=d.shape)
    random /= np.linalg.norm(random, axis=1)[:, None]
    random *= np.where(np.sum(random * front, axis=1) < 0.0, -1.0, 1.0)[:, None]
    ways = [random]
    lights = [light for light in scene.lights if type_of(light).has_no_extent]
    for light in lights[:MOST_LIGHTS]:
        to_light = type_of(light).towards(light, hits.p)
        length = np.linalg.norm(to_light, axis=1)[:, None]
        faces = np.sum(to_light * front, axis=1) > 0.0
        ways.append(np.where(faces[:, None], to_light / length, 0.0))
    through = _is_clear(scene, sizes, hits)
    if through.any():
        ways.append(np.where(through[:, None], d, 0.0))
    return ways


def _is_clear(scene: Scene, sizes: ShapeSizes, hits: Intersections) -> BoolArray:
    """(n,): whether the hit surface lets light pass."""
    clear = [lets_pass(scene, leaf.material) for leaf in sizes.leaves]
    return np.array([*clear, False])[sizes.leaf_of(hits)]
