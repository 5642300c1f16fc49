"""Solids by Mitsuba's hits: all crossings of each operand, then the set operation in NumPy.

Each operand is a Mitsuba scene of its own, so that faces that coincide are all seen.  Nothing is
shared with `reference_rt.shapes.csg`, and nothing of how it works: there, a program runs on the
states of operands as a ray passes them; here, crossings of all rays are sorted and trees of Boolean
arrays evaluated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry.flatten import Leaf, Tree
from comparisons.geometry.float32 import delta, round32
from comparisons.mitsuba.hits import Answers, BoolArray, nothing, put, read, rows_of
from comparisons.mitsuba.scene import first_hits
from comparisons.mitsuba.stand_ins import Piece
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.shapes import Plane
from reference_rt.shapes.shape import Place

MOST_CROSSINGS = 200
"""Of a ray with one operand, after which the search is given up: the knot has a dozen."""

STEEPEST = 64.0
"""How far along a ray float32 may put a surface grows as 1 over the cosine; a walk takes no steps,
and tells no two crossings apart, by more than this many times as far as head-on."""


SLIGHT = 0.125
"""Of float32's bound: one rounding, by which faces that coincide are apart."""


class Crossings(NamedTuple):
    """Where k rays cross the surface of an operand next.

    rays (k,): numbers of the rays;  enters: whether they go in;  slack (k,): how far float32 may
    have moved t;  at: the hits, t counted from the rays' own origins.
    """

    rays: IntArray
    enters: BoolArray
    slack: FloatArray
    at: Answers


class Operand(NamedTuple):
    """mi_scene: the operand's own;  pieces: by id;  leaf, place: what it is and where it stands."""

    mi_scene: Any
    pieces: Mapping[str, Piece]
    leaf: Leaf
    place: Place

    def walk(self, o: FloatArray, d: FloatArray) -> tuple[BoolArray, list[Crossings]]:
        """Whether rays begin inside, and all their crossings in order."""
        ids = {name: k for k, name in enumerate(self.pieces)}
        pieces = list(self.pieces.values())
        box = self.mi_scene.bbox()
        reach = float(np.abs([np.array(box.min), np.array(box.max)]).max())
        if isinstance(self.leaf.shape, Plane):
            reach = 0.0  # its corners are far away from what rays meet
        rays, origin = np.arange(len(o)), o.copy()
        length2 = np.sum(d * d, axis=1)
        found: list[Crossings] = []
        inside = self._inside(ids, pieces, o, d)
        within = inside.copy()
        for _ in range(MOST_CROSSINGS):
            if len(rays) == 0:
                break
            hits = read(first_hits(self.mi_scene, ids, origin, d[rays]), pieces, origin)
            met = hits.shape >= 0
            rays, origin, hits = rays[met], origin[met], rows_of(hits, met)
            way = np.sum(hits.n * d[rays], axis=1)
            size = delta(o[rays], hits.p, np.full(len(rays), reach)) + hits.sag
            length = np.sqrt(length2[rays])
            slack = size / length / np.maximum(np.abs(way) / length, 1.0 / STEEPEST)
            along = np.sum((origin - o[rays]) * d[rays], axis=1) / length2[rays]
            hits.t[:] += along
            enters = way < 0.0
            # Else met again from behind, or at an edge, of which the other side was missed.
            new = enters != within[rays]
            within[rays] = enters
            found.append(Crossings(rays[new], enters[new], slack[new], rows_of(hits, new)))
            origin = round32(o[rays] + d[rays] * (hits.t + 0.5 * slack)[:, None])
        return inside, found

    def _inside(
        self, ids: Mapping[str, int], pieces: list[Piece], o: FloatArray, d: FloatArray
    ) -> BoolArray:
        """Where rays begin inside: what lies behind them is left that way.

        Behind and not ahead, as that may be an edge that they are aimed at.
        """
        if isinstance(self.leaf.shape, Plane):
            to_local = transform.invert(self.leaf.shape.map_in(self.place))
            return transform.apply_points(to_local, o)[:, 2] < 0.0
        behind = read(first_hits(self.mi_scene, ids, o, -d), pieces, o)
        return np.asarray((behind.shape >= 0) & (np.sum(behind.n * d, axis=1) < 0.0))


@dataclass(frozen=True)
class SolidTwin:
    """Operands, by the numbers that the leaves of the tree are."""

    operands: Sequence[Operand]
    tree: Tree

    @property
    def place(self) -> tuple[int, int]:
        """The shape, and the instance, that the solid is."""
        piece = next(iter(self.operands[0].pieces.values()))
        return piece.shape, piece.instance

    def near(self, o: FloatArray, d: FloatArray) -> IntArray:
        """The rays (k,) that come near any of the operands."""
        if any(isinstance(operand.leaf.shape, Plane) for operand in self.operands):
            return np.arange(len(o))
        boxes = [operand.mi_scene.bbox() for operand in self.operands]
        lower = np.min([np.array(b.min, np.float64) for b in boxes], axis=0)
        upper = np.max([np.array(b.max, np.float64) for b in boxes], axis=0)
        margin = 1e-3 * (upper - lower).max()
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (lower - margin - o) / d, (upper + margin - o) / d
        # A ray within a plane of the box: 0/0 does not limit it.
        t_in = np.nan_to_num(np.minimum(a, b), nan=-np.inf).max(axis=1)
        t_out = np.nan_to_num(np.maximum(a, b), nan=np.inf).min(axis=1)
        return np.flatnonzero((t_in <= t_out) & (t_out > 0.0))

    def trace(self, o: FloatArray, d: FloatArray, tolerance: float = SLIGHT) -> Answers:
        """The first points of the solid's surface.

        Crossings that are closer together than `tolerance` times float32's bound are passed at
        once: faces that coincide leave no film between them.
        """
        n = len(o)
        states = np.zeros((len(self.operands), n), bool)
        crossings: list[Crossings] = []
        whose: list[int] = []
        for k, operand in enumerate(self.operands):
            states[k], some = operand.walk(o, d)
            crossings += some
            whose += [k] * len(some)
        result = nothing(n)
        if not crossings:
            return result
        column = np.full((len(crossings), n), -1)  # the row of a ray in each set of crossings
        t, slack = np.full((2, len(crossings), n), np.inf)
        for j, crossing in enumerate(crossings):
            column[j, crossing.rays] = np.arange(len(crossing.rays))
            t[j, crossing.rays], slack[j, crossing.rays] = crossing.at.t, crossing.slack
        order = np.argsort(t, axis=0, kind="stable")
        t, slack = np.take_along_axis(t, order, axis=0), np.take_along_axis(slack, order, axis=0)
        slack[np.isfinite(slack)] *= tolerance
        changed = self._first_change(states, crossings, whose, (order, column, t, slack))
        for j, crossing in enumerate(crossings):
            rays = np.flatnonzero(changed == j)
            some_hits = rows_of(crossing.at, column[j, rays])
            put(result, rays, some_hits)
        return self._facing(result, d, evaluated(self.tree, states))

    def meets(
        self, o: FloatArray, d: FloatArray, part: IntArray, t: FloatArray, primitive: IntArray
    ) -> BoolArray:
        """Whether the operands with the numbers `part` (n,) have a crossing, of this primitive, at
        t to within float32."""
        found = np.zeros(len(o), bool)
        for operand in self.operands:
            rows = np.flatnonzero(part == operand.leaf.part)
            if len(rows) == 0:
                continue
            _, crossings = operand.walk(o[rows], d[rows])
            for crossing in crossings:
                mine = rows[crossing.rays]
                near = np.abs(crossing.at.t - t[mine]) <= crossing.slack
                found[mine] |= near & (crossing.at.primitive == primitive[mine])
        return found

    def _first_change(
        self,
        states: BoolArray,
        crossings: list[Crossings],
        whose: list[int],
        sorted_: tuple[IntArray, IntArray, FloatArray, FloatArray],
    ) -> IntArray:
        """Which crossing (n,) is the first where rays come in or out of the solid, -1 for none: of
        those that are passed at once, the last at which the inside changes."""
        order, column, t, slack = sorted_
        n = t.shape[1]
        everything = np.arange(n)
        states = states.copy()
        began = evaluated(self.tree, states)  # before the crossings that are passed at once
        inside, candidate = began.copy(), np.full(n, -1)
        changed = np.full(n, -1)
        done = np.zeros(n, bool)
        for k in range(len(order)):
            j = order[k]
            active = ~done & np.isfinite(t[k])
            if not active.any():
                break
            for number in np.unique(j[active]):
                rays = everything[active & (j == number)]
                states[whose[number], rays] = crossings[number].enters[column[number, rays]]
            now = evaluated(self.tree, states)
            candidate = np.where(active & (now != inside), j, candidate)
            inside = np.where(active, now, inside)
            # The last of its group where the next one is clearly further.
            if k + 1 < len(order):
                with np.errstate(invalid="ignore"):
                    last = ~(t[k + 1] - t[k] <= slack[k] + slack[k + 1])
                last |= ~np.isfinite(t[k + 1])
            else:
                last = np.ones(n, bool)
            ends = active & last
            flipped = ends & (inside != began)
            changed[flipped] = candidate[flipped]
            done |= flipped
            began = np.where(ends, inside, began)
        return changed

    def _facing(self, hits: Answers, d: FloatArray, inside: BoolArray) -> Answers:
        """The hits with the normals of the solid: towards the ray where it comes in."""
        away = np.sum(hits.n * d, axis=1) > 0.0
        turned = away != inside
        for normal in (hits.n, hits.ns):
            normal[turned] *= -1.0
        return hits


def evaluated(tree: Tree | int, states: BoolArray) -> BoolArray:
    """Who is inside the solid (n,), of states (operands, n): who is inside each operand."""
    if isinstance(tree, int):
        return np.asarray(states[tree])
    values = [evaluated(part, states) for part in tree.of]
    if tree.operation == "union":
        return np.asarray(np.any(values, axis=0))
    if tree.operation == "intersection":
        return np.asarray(np.all(values, axis=0))
    rest = np.zeros(len(values[0]), bool) if len(values) == 1 else np.any(values[1:], axis=0)
    return np.asarray(values[0] & ~rest)
