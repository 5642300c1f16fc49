"""Which departures break the law, by exact arithmetic on the rays as they begin."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from comparisons.experiments.stability.harness.outcomes import EXAMPLES, Outcome, hexed
from comparisons.experiments.stability.harness.shadows import CONTACT
from comparisons.experiments.stability.leaving.departures import Departures, Subject
from comparisons.experiments.stability.leaving.shapes import KINDS, Placed, Rays, scene_of
from comparisons.geometry.exact.dyadic import NEVER, BoolArray, nearest
from comparisons.referee import all_hits, columns_of, first_of
from comparisons.referee.referee import Referee
from comparisons.referee.sizes import ShapeSizes
from reference_rt.core.arrays import FloatArray, IntArray

CLOSE = 0.01
"""Sizes: how near a neighbour is that others than ours must not lose."""

NEAR = 100.0
"""Bounds: a closed shape that is met again within these is checked, on whichever side."""

Exact = Callable[[FloatArray, FloatArray], tuple[FloatArray, BoolArray]]
"""Of rays: (t of the first crossing, inf for none; whether an odd number of crossings is ahead,
which is to begin inside of a closed shape)."""


def exact_of(placed: Placed, subject: Subject) -> Exact:
    """The exact answers for one shape, as our tables hold it."""
    if subject.kind < 0:
        referee = Referee(ShapeSizes(scene_of(placed)))

        def of_scene(o: FloatArray, d: FloatArray) -> tuple[FloatArray, BoolArray]:
            truths = np.array([truth.t for truth in referee.decide(o, d)], dtype=object)
            back = np.array([truth.t for truth in referee.decide(o, -d)], dtype=object)
            # Of a convex shape; for the others this is not used.
            return nearest(truths), np.asarray((truths != NEVER) & (back != NEVER))

        return of_scene
    row = row_of(subject)

    def of_row(o: FloatArray, d: FloatArray) -> tuple[FloatArray, BoolArray]:
        crossings = all_hits(subject.field, row, o, d)
        ahead = (crossings.t > 0) & (crossings.t < NEVER)
        return first_of(crossings).t, np.asarray(ahead.sum(axis=1) % 2 == 1)

    return of_row


def row_of(subject: Subject) -> dict[str, Any]:
    """The columns of a subject's row; a polygon's outline, and what is the same for all triangles,
    is one of all."""
    columns = columns_of(subject.table).items()
    return {
        name: column if name == "outline" or len(column) == 1 else column[[subject.row]]
        for name, column in columns
        if column is not None
    }


@dataclass
class Tally:
    """Counts and examples that become an `Outcome`."""

    cases: int = 0
    open: int = 0
    worst: float = 0.0
    why: dict[str, int] = field(default_factory=dict)
    examples: list[dict[str, Any]] = field(default_factory=list)

    @property
    def failures(self) -> int:
        return sum(self.why.values())

    def fail(self, why: str, which: IntArray, note: Callable[[int], dict[str, Any]]) -> None:
        if len(which) == 0:
            return
        self.why[why] = self.why.get(why, 0) + len(which)
        for i in which[: EXAMPLES - len(self.examples)].tolist():
            self.examples.append({"what": why, **note(i)})

    def outcome(self) -> Outcome:
        return Outcome(
            self.cases, self.failures, self.worst, self.open, tuple(self.examples[:EXAMPLES])
        )


class Judge:
    """Of departures from one shape.

    outer (n,): whether rays were to leave to the outer side;  sample: how many of those that are
    not suspicious are checked all the same.
    """

    def __init__(self, placed: Placed, subject: Subject, sample: int) -> None:
        self.placed, self.sample = placed, sample
        self.kind = KINDS[placed.kind]
        self.exact = exact_of(placed, subject)
        self.row = row_of(subject) if subject.kind >= 0 else {}

    def __call__(
        self, tally: Tally, rays: Rays, outer: BoolArray, found: Departures, bounded: bool
    ) -> None:
        """bounded: whether rays have to begin within the stated bound, else in `CLOSE` sizes."""
        left = np.isfinite(found.t)
        note = self._noted(rays, found)
        self._primary(tally, rays, np.flatnonzero(~left), note)
        tally.cases += int(left.sum())
        moved = np.where(left, np.linalg.norm(found.start - found.p, axis=1), 0.0)
        allowed = self.placed.bound if bounded else max(self.placed.bound, CLOSE * self.placed.size)
        if self.placed.kind == "plane":  # it goes on beyond its size
            away = np.linalg.norm(found.p - self.placed.center, axis=1) / self.placed.size
            moved = np.where(left, moved / np.maximum(1.0, away), 0.0)
        tally.worst = max(tally.worst, float(moved.max(initial=0.0)) / self.placed.bound)
        failed = moved > allowed
        tally.fail("begins too far off", np.flatnonzero(failed), note)
        checked = left & ~failed & (self._doubtful(outer, found) | self._sampled(left))
        for leaves, decide in ((True, self._outside), (False, self._inside)):
            which = np.flatnonzero(checked & (outer == leaves))
            if len(which):
                decide(tally, which, found, note)

    def _sampled(self, left: BoolArray) -> BoolArray:
        chosen = np.zeros(len(left), bool)
        chosen[np.flatnonzero(left)[: self.sample]] = True
        return chosen

    def _doubtful(self, outer: BoolArray, found: Departures) -> BoolArray:
        """Suspicious departures.  Expected is that nothing is met again, or, of a ray that goes
        into a closed shape, a far wall, left through its outer side."""
        hit = np.isfinite(found.again)
        near = hit & (found.again < NEAR * self.placed.bound)
        into = ~hit | (found.cosine <= 0.0) | near
        if not self.kind.closed:
            return hit
        out = hit if self.kind.convex else hit & ((found.cosine >= 0.0) | near)
        return np.asarray(np.where(outer, out, into))

    def _noted(self, rays: Rays, found: Departures) -> Callable[[int], dict[str, Any]]:
        def note(i: int) -> dict[str, Any]:
            return {
                "kind": self.placed.kind,
                "shape": self.placed.shape.model_dump(mode="json", exclude_defaults=True),
                "o": hexed(rays.o[i]),
                "d": hexed(rays.d[i]),
                "from": hexed(found.start[i]),
                "towards": hexed(found.w[i]),
                "met again at": found.again[i].hex(),
            }

        return note

    def _primary(self, tally: Tally, rays: Rays, which: IntArray, note: Any) -> None:
        """Rays that meet nothing: rightly, or the shape is lost; open where moving the ray by what
        its own numbers round decides it."""
        if len(which) == 0:
            return
        o, d = rays.o[which], rays.d[which]
        meets = np.isfinite(self.exact(o, d)[0])
        sure = meets.copy()
        for k in range(3):
            for step in (-self.placed.bound, self.placed.bound):
                moved = o.copy()
                moved[:, k] += step
                sure &= np.isfinite(self.exact(moved, d)[0])
        tally.cases += int((~meets | sure).sum())
        tally.open += int((meets & ~sure).sum())
        tally.fail("the shape is not met", which[sure], note)

    def _outside(self, tally: Tally, which: IntArray, found: Departures, note: Any) -> None:
        if self.kind.convex:
            self._nothing(tally, which, found, note)
            return
        start, w, again = found.start[which], found.w[which], found.again[which]
        t, inside = self.exact(start, w)
        bound = self.placed.bound
        wrong = inside if self.placed.kind == "torus" else np.zeros(len(which), bool)
        differs = ~wrong & ~_alike(again, t)
        lost = differs & ~np.isfinite(again)
        # A ray that passes something within the bounds may meet it or not.
        open_ = np.zeros(len(which), bool)
        for step in (CONTACT * bound, -CONTACT * bound):
            for axis in (found.n[which], np.cross(found.n[which], w)):
                there, _ = self.exact(start + step * axis, w)
                open_ |= differs & _alike(again, there)
        # A hole that is thinner than a few bounds cannot be entered: two walls are within them.
        if wrong.any():
            walls = self._walls(found.p[which], found.n[which])
            open_ |= wrong & (walls >= 2)
            wrong &= ~open_
        self._put_open(tally, open_)
        tally.fail("begins inside", which[wrong], note)
        tally.fail("lost", which[lost & ~open_], note)
        tally.fail("met again", which[differs & ~lost & ~open_], note)

    def _nothing(self, tally: Tally, which: IntArray, found: Departures, note: Any) -> None:
        """Nothing must be met, neither by the tracer nor by the exact ray."""
        bad = np.isfinite(found.again[which])
        checked = np.ones(len(which), bool) if self.placed.kind == "plane" else ~bad
        t = np.full(len(which), np.inf)
        t[checked] = self.exact(found.start[which[checked]], found.w[which[checked]])[0]
        bad |= np.isfinite(t)
        if self.placed.kind == "plane":
            # Without end, it is met far away by rays that rounding turned towards it.
            bad &= ~((t > NEAR * self.placed.bound) & _alike(found.again[which], t))
        tally.fail("met again", which[bad], note)

    def _inside(self, tally: Tally, which: IntArray, found: Departures, note: Any) -> None:
        if not self.kind.closed:
            self._nothing(tally, which, found, note)
            return
        start, w, again = found.start[which], found.w[which], found.again[which]
        t, inside = self.exact(start, w)
        if self.placed.kind == "solid":
            inside = np.isfinite(t)
        # The same wall: what it is off by across it is at most a few bounds.
        with np.errstate(invalid="ignore"):
            same = np.abs(again - t) * found.cosine[which] <= CONTACT * self.placed.bound
        right = inside & (_alike(again, t) | same) & (found.cosine[which] > 0.0)
        # What is thinner than a few bounds cannot be left: the walls are one.
        rest = np.flatnonzero(~right)
        if len(rest) == 0:
            return
        thin = self._thickness(which[rest], found) < CONTACT * self.placed.bound
        self._put_open(tally, thin)
        lost = ~np.isfinite(again[rest])
        tally.fail("lost", which[rest[lost & ~thin]], note)
        tally.fail("met again", which[rest[~lost & ~thin]], note)

    def _put_open(self, tally: Tally, open_: BoolArray) -> None:
        count = int(open_.sum())
        tally.cases -= count
        tally.open += count

    def _walls(self, p: FloatArray, n: FloatArray) -> IntArray:
        """How many crossings of a torus there are within a few bounds of points, along normals."""
        t = nearest(all_hits("tori", self.row, p, n).t)
        return np.asarray((np.abs(t) < CONTACT * self.placed.bound).sum(axis=1))

    def _thickness(self, which: IntArray, found: Departures) -> FloatArray:
        """How much of the shape lies below the surface where rays left it, along the normal and
        along the way that they went, whichever is less.  The points are off by B sideways too: it
        is the least that lies below a point that near."""
        n = found.n[which]
        across = np.cross(n, np.eye(3)[np.argmin(np.abs(n), axis=1)])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        ahead, inside = self.exact(found.start[which], found.w[which])
        least = np.where(inside, ahead, np.inf)
        for step in (0.0 * n, across, -across, np.cross(n, across), -np.cross(n, across)):
            point = found.p[which] + step * self.placed.bound
            least = np.minimum(least, self._below(point, n))
        return np.asarray(least)

    def _below(self, p: FloatArray, n: FloatArray) -> FloatArray:
        """The same of points p near the surface, along their normals; 0 beside the shape."""
        bound = self.placed.bound
        above = p + n * (CONTACT * bound)
        near, _ = self.exact(above, -n)
        # A hair further than where the normal comes in: what is thinner than that counts as none.
        begin = above - n * (np.where(np.isfinite(near), near, 0.0) + bound / 16.0)[:, None]
        far, inside = self.exact(begin, -n)
        if self.placed.kind == "solid":
            inside = np.isfinite(far)
        return np.asarray(np.where(np.isfinite(near) & inside, far, 0.0))


def _alike(a: FloatArray, b: FloatArray) -> BoolArray:
    """Whether two are the same crossing, roughly: F1 and F4 say how precise they are."""
    both = np.isfinite(a) & np.isfinite(b)
    with np.errstate(invalid="ignore"):
        same = both & (a <= 2.0 * b) & (b <= 2.0 * a)
    return np.asarray(same | (~np.isfinite(a) & ~np.isfinite(b)))
