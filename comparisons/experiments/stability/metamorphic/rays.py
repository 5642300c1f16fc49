"""What rays hit in a scene and in the same scene transformed."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import reference_rt as rt
from comparisons.experiments.relations import Identities, Motion, Names, differ, identities_of
from comparisons.experiments.stability.harness.in_mitsuba import traced
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    Columns,
    FloatArray,
    Outcome,
    Outcomes,
    hexed,
    outcome,
)
from comparisons.experiments.stability.harness.scenes import GRID
from comparisons.experiments.stability.harness.solids import Truth, truths
from comparisons.geometry.affine import unit_rows
from comparisons.geometry.exact.dyadic import BoolArray, nearest
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import scalar
from comparisons.referee.referee import Referee
from comparisons.referee.referee import Truth as First
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.arbiter import directions
from reference_rt.core.arrays import IntArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.shapes.csg import Solid

# What rays may hit in a scene with solids: exact arithmetic, and F7's law on what is resolved.
#
# Crossings of operands further apart than twice the sum of the widths which ours states can be told
# apart (`harness.solids.truths`); what lies between others may show or not.  No number is chosen
# here.


class Met(NamedTuple):
    """What one ray meets: solids: of each by its number in the scene;  others: of everything else
    together;  t: of that, inf for none."""

    solids: dict[int, Truth]
    others: First
    t: float

    @property
    def touching(self) -> bool:
        return self.others.touching or any(truth.touching for truth in self.solids.values())

    def allows(self, name: IntArray, t: float) -> bool:
        """Whether something of this name (4,) at t, or nothing (-1, at inf), can be what is
        first."""
        shape, _, part, _ = identity = tuple(name.tolist())
        slack = 0.0
        for number, truth in self.solids.items():
            if any(stretch.inside and stretch.t0 < t for stretch in truth.stretches):
                return False  # it would be seen before
            if number == shape:
                near = np.abs(truth.crossings - t) <= 2.0 * truth.widths
                if part not in truth.operands[near] or not _may_change(truth, t):
                    return False
                slack = float(2.0 * truth.widths[near].max())
        if shape in self.solids or shape < 0:
            return self.t >= t - slack
        return identity in self.others.identities


def _may_change(truth: Truth, t: float) -> bool:
    """Whether the solid may begin at t, between stretches of which the one before is outside: it is
    there behind it, or between crossings that are not told apart."""
    behind = next(stretch for stretch in truth.stretches if stretch.t1 > t)
    reach = max((stretch.t1 for stretch in truth.stretches if stretch.t1 <= t), default=0.0)
    crossings = truth.crossings[(truth.crossings >= reach) & (truth.crossings <= behind.t0)]
    return behind.inside or len(crossings) > 1


class Judge:
    """Of rays in one scene, whose solids are made of what `rt.csg` lists and stand in no groups."""

    def __init__(self, scene: rt.Scene) -> None:
        self.scene = scene
        sizes = ShapeSizes(scene)
        self.bounds = np.array([sizes.lower, sizes.upper])
        numbered = list(enumerate(scene.shapes))
        self.solids = {k: shape for k, shape in numbered if isinstance(shape, Solid)}
        self.number = [k for k, _ in numbered if k not in self.solids]
        others = tuple(shape for k, shape in numbered if k not in self.solids)
        self.referee = Referee(ShapeSizes(scene.changed(shapes=others)))

    def decide(self, o: FloatArray, d: FloatArray) -> list[Met]:
        if len(o) == 0:
            return []
        solids = {k: truths(s, self.scene.folder, o, d) for k, s in self.solids.items()}
        found = []
        for ray, first in enumerate(self.referee.decide(o, d)):
            first.identities = [(self.number[s], i, p, k) for s, i, p, k in first.identities]
            t = float(nearest(np.array([first.t], dtype=object))[0])
            found.append(Met({k: some[ray] for k, some in solids.items()}, first, t))
        return found


HALVINGS = 50
"""Steps that close in on an edge: until two rays differ by float64's rounding."""


class Rays(NamedTuple):
    """o, d (n, 3): dyadic origins, directions of about unit length;  coarse (n,): those that
    float32 holds and that pass every edge at 2^-14 of the way or more, which Mitsuba is asked."""

    o: FloatArray
    d: FloatArray
    coarse: BoolArray


class Found(NamedTuple):
    """t (n,), inf for a miss, and identities (n, 4): shape, instance, part, primitive; -1 in the
    first for a miss."""

    t: FloatArray
    identities: Identities


def found_of(hits: Intersections) -> Found:
    return Found(hits.t, identities_of(hits))


def ours(tables: SceneTables, o: FloatArray, d: FloatArray) -> Found:
    return found_of(query.intersect(tables, o, d))


def mitsubas(scene: rt.Scene, o: FloatArray, d: FloatArray) -> Found:
    """Mitsuba's scalar variant, which solves spheres and cylinders in float64; -2 for every shape
    where it refuses the scene."""
    try:
        with scalar(), np.errstate(over="ignore", invalid="ignore"):
            # What float32 cannot hold becomes infinite.
            return found_of(traced(scene, o, d))
    except RuntimeError:
        return Found(np.full(len(o), np.inf), np.full((len(o), 4), -2))


def aimed(tables: SceneTables, n: int, rng: np.random.Generator) -> Rays:
    """A third anywhere, a third at edges (silhouettes, borders of faces and triangles), at 2^-4 to
    2^-14 of the way to them, a third at edges down to float64's rounding.

    An edge is where two rays from one origin hit different things: between them by bisection.
    """
    o = (1.0, 2.0, 7.0) + np.rint(rng.uniform(-1.0, 1.0, (n, 3)) * GRID) / GRID
    ends = rng.uniform(-3.0, 3.0, (2, n, 3)) - o
    a, b = (round32(unit_rows(end)) for end in ends)
    kind = np.arange(n) % 3
    pairs = np.flatnonzero(
        (kind > 0) & differ(ours(tables, o, a).identities, ours(tables, o, b).identities)
    )
    low, high = np.zeros(len(pairs)), np.ones(len(pairs))
    p, q, e = a[pairs], b[pairs], o[pairs]
    first = ours(tables, e, p).identities
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        other = differ(ours(tables, e, p + middle[:, None] * (q - p)).identities, first)
        low, high = np.where(other, low, middle), np.where(other, middle, high)
    far = kind[pairs] == 1
    depth = np.where(far, rng.uniform(4, 14, len(pairs)), rng.uniform(14, HALVINGS, len(pairs)))
    side = rng.choice([-1.0, 1.0], len(pairs))
    d = p + (0.5 * (low + high) + side * 2.0**-depth)[:, None] * (q - p)
    a[pairs] = np.where(far[:, None], round32(d), d)
    coarse = np.ones(n, bool)
    coarse[pairs[~far]] = False
    return Rays(o, a, coarse)


def through(motion: Motion, rays: Rays) -> tuple[FloatArray, FloatArray]:
    """Origins and directions, transformed as the scene is; t grows by the factor."""
    return motion.points(rays.o), motion.vectors(rays.d)


class Traced(NamedTuple):
    """Rays, and what they found in a scene;  names: the identities in terms of the scene that this
    one is compared with, where shapes have other numbers there."""

    scene: rt.Scene
    o: FloatArray
    d: FloatArray
    found: Found
    names: Identities | None = None


def _changed(before: Traced, after: Traced) -> BoolArray:
    names = after.found.identities if after.names is None else after.names
    return differ(before.found.identities, names)


BAND = 8.0
"""Roundings u, of the largest coordinate L, by which a ray may have been moved relative to the
surface that it meets.  Exact arithmetic takes ray and tables as they are in float64, rounded
already; what is left is how a shape sees the ray: o - anchor rounds by u |o - anchor|, products
with unit rows and their sums by 3 u |o - anchor|.  No anchor is further than 12 from an origin here
and L is 6 at least: 4 u 12 = 8 u 6.  What is then solved rounds more; to allow less is stricter."""

AROUND = np.concatenate([directions(16), 0.3 * directions(8)])
"""Moves, of that size, at which exact arithmetic repeats a differing ray."""


def judged(
    before: Traced, after: Traced, factor: float, exact: bool, unmoved: bool = False
) -> Outcome:
    """Ours.  exact: the transformed numbers are the numbers meant, and the answers must be the
    same to the last bit of t;  else where answers differ each must be right in its own scene, by
    exact arithmetic: where rounding the scene has really changed what is there, both are;
    unmoved: each must be right in the scene before.
    """
    changed, moved, worst = _compared(before, after, factor)
    open_ = np.zeros(len(changed), bool)
    if exact:
        wrong = changed | moved
    else:
        wrong = changed.copy()
        rows = np.flatnonzero(changed)
        judged_as = before._replace(found=after.found) if unmoved else after
        right, open_[rows] = _both_right(before, judged_as, rows)
        wrong[rows[right]] = False
    return outcome(wrong, {"before": _shown(before), "after": _shown(after)}, open_, worst)


def _both_right(
    before: Traced, after: Traced, rows: npt.NDArray[np.int64]
) -> tuple[BoolArray, BoolArray]:
    """Of some rays: whether both answers are those of exact arithmetic for a ray within BAND, and
    whether the arbiter leaves one open."""
    right, touching = np.ones(len(rows), bool), np.zeros(len(rows), bool)
    for case in (before, after):
        # What is wrong before is wrong.
        left = np.flatnonzero(right)
        right[left], touching[left] = _right(case, rows[left])
    return right, touching


def _right(case: Traced, rows: npt.NDArray[np.int64]) -> tuple[BoolArray, BoolArray]:
    """Most are right for the very ray: only the others, some 3 ms each, are repeated around it."""
    if len(rows) == 0:
        return np.ones(0, bool), np.zeros(0, bool)
    judge, o, d = Judge(case.scene), case.o[rows], case.d[rows]
    names, t = case.found.identities[rows], case.found.t[rows]
    met = judge.decide(o, d)
    right = np.array([m.allows(*answer) for m, *answer in zip(met, names, t, strict=True)])
    touching = np.array([m.touching for m in met])
    rest = np.flatnonzero(~right)
    # An infinite plane counts as far as the ray goes.
    extent = np.maximum(np.abs(o).max(axis=1), np.abs(judge.bounds).max())
    moves = BAND * UNIT_ROUNDOFF * extent[rest, None, None] * AROUND
    origins = (o[rest, None] + moves).reshape(-1, 3)
    met = judge.decide(origins, np.repeat(d[rest], len(AROUND), axis=0))
    for k, ray in enumerate(rest.tolist()):
        some = met[k * len(AROUND) : (k + 1) * len(AROUND)]
        right[ray] = any(m.allows(names[ray], t[ray]) for m in some)
    return right, touching


def judged_mitsuba(before: Traced, after: Traced, factor: float) -> Outcome:
    """Its rays pass every edge at more than 1e-5 of the way: what float64's rounding of the scene
    moves, 1e-16 of its size, changes none of them."""
    wrong, _, worst = _compared(before, after, factor)
    return outcome(wrong, {"before": _shown(before), "after": _shown(after)}, worst=worst)


def _compared(before: Traced, after: Traced, factor: float) -> tuple[BoolArray, BoolArray, float]:
    """Which rays hit something else; which hit the same at another t; by how much at most, of t."""
    changed = _changed(before, after)
    t0, t1 = before.found.t, after.found.t / factor
    same = np.isfinite(t0) & ~changed
    off = np.abs(t1[same] - t0[same]) / t0[same]
    return changed, same & (t0 != t1), float(off.max(initial=0.0))


def _shown(case: Traced) -> Callable[[int], dict[str, Any]]:
    columns: Columns = {"o": case.o, "d": case.d, "t": case.found.t}
    columns["shape, instance, part, primitive"] = case.found.identities
    return lambda k: {name: hexed(column[k]) for name, column in columns.items()}


class Bench:
    """A scene, its rays, and what they find in it before it is transformed."""

    def __init__(
        self, scene: rt.Scene, cases: int, rng: np.random.Generator, mitsuba: bool = False
    ) -> None:
        tables = rt.build_tables(scene)
        self.rays = aimed(tables, cases, rng)
        o, d, coarse = self.rays
        self.ours = Traced(scene, o, d, ours(tables, o, d))
        self.mitsuba = None
        if mitsuba:
            o, d = o[coarse], d[coarse]
            self.mitsuba = Traced(scene, o, d, mitsubas(scene, o, d))

    def compared(
        self,
        scene: rt.Scene,
        o: FloatArray,
        d: FloatArray,
        names: Names | None = None,
        factor: float = 1.0,
        exact: bool = False,
        unmoved: bool = False,
    ) -> Outcomes:
        """The rays, as they are transformed, in the scene transformed.  names: identities in terms
        of the scene before, of those after;  factor, exact, unmoved: see `judged`."""

        def case(o: FloatArray, d: FloatArray, found: Found) -> Traced:
            return Traced(scene, o, d, found, names(found.identities) if names else None)

        after = case(o, d, self.found_after(scene, o, d))
        outcomes = {OURS: judged(self.ours, after, factor, exact, unmoved)}
        if self.mitsuba is not None:
            o, d = o[self.rays.coarse], d[self.rays.coarse]
            after = case(o, d, mitsubas(scene, o, d))
            outcomes[MITSUBA] = judged_mitsuba(self.mitsuba, after, factor)
        return outcomes

    @staticmethod
    def found_after(scene: rt.Scene, o: FloatArray, d: FloatArray) -> Found:
        """By ours."""
        return ours(rt.build_tables(scene), o, d)
