"""CSG solids from Mitsuba's hits: all crossings of each operand, then the set operation in NumPy.

Each operand is a Mitsuba scene of its own, so that coincident faces are all found.  Code and method
are independent of `reference_rt.shapes.csg`: there a program updates the operands' states along
each ray; here the crossings of all rays are sorted, and CSG trees of Boolean arrays evaluated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.flatten import Leaf, Tree
from comparisons.geometry.frame import delta, round32
from comparisons.mitsuba.hits import (
    BoolArray,
    MitsubaHits,
    MitsubaShape,
    assign,
    misses,
    read,
    rows_of,
)
from comparisons.mitsuba.scene import first_hits
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.shapes import Plane
from reference_rt.shapes.shape import TabulationContext

MOST_CROSSINGS = 200
"""Most crossings of a ray with one operand; the torus knot has a dozen."""

STEEPEST = 64.0
"""Cap of one over the cosine: float32 moves a crossing along the ray by the error at normal
incidence over the cosine.  The step of a walk, and the distance of crossings that count as one, use
this cap."""


TINY = np.finfo(np.float64).tiny

SLIGHT = 0.125
"""Fraction of float32's bound, one rounding: how far apart coincident faces may be."""


class Crossings(NamedTuple):
    """The next crossings of k rays with the surface of an operand.

    rays (k,): indices of the rays;  enters (k,): whether they enter it;  slack (k,): how far
    float32 may have moved t;  at: the hits, with t from the rays' own origins.
    """

    rays: IntArray
    enters: BoolArray
    slack: FloatArray
    at: MitsubaHits


class Box(NamedTuple):
    """lower, upper (3,): corners of a box."""

    lower: FloatArray
    upper: FloatArray

    def near(self, o: FloatArray, d: FloatArray) -> IntArray:
        """Indices (k,) of the rays that meet the box."""
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (self.lower - o) / d, (self.upper - o) / d
        # A ray in a plane of the box: 0/0 sets no limit.
        t_in = np.nan_to_num(np.minimum(a, b), nan=-np.inf).max(axis=1)
        t_out = np.nan_to_num(np.maximum(a, b), nan=np.inf).min(axis=1)
        return np.flatnonzero((t_in <= t_out) & (t_out > 0.0))

    def around(self, o: FloatArray) -> BoolArray:
        """(n,): whether points are in the box."""
        return np.asarray(((o >= self.lower) & (o <= self.upper)).all(axis=1))


EVERYWHERE = Box(np.full(3, -np.inf), np.full(3, np.inf))


class Operand(NamedTuple):
    """mi_scene: the operand's own Mitsuba scene;  mi_shapes: its shapes, by id;  leaf, place: the
    primitive and its placement."""

    mi_scene: Any
    mi_shapes: Mapping[str, MitsubaShape]
    leaf: Leaf
    place: TabulationContext

    def box(self) -> Box:
        """A box around it, larger by a thousandth than Mitsuba's."""
        if isinstance(self.leaf.shape, Plane):
            return EVERYWHERE
        box = self.mi_scene.bbox()
        lower, upper = np.array(box.min, np.float64), np.array(box.max, np.float64)
        margin = 1e-3 * (upper - lower).max()
        return Box(lower - margin, upper + margin)

    def reach(self) -> float:
        """The largest coordinate on the operand; 0 for a plane, the corners of whose mesh are far
        from where rays hit."""
        if isinstance(self.leaf.shape, Plane):
            return 0.0
        box = self.mi_scene.bbox()
        return float(np.abs([np.array(box.min), np.array(box.max)]).max())

    def walk(self, o: FloatArray, d: FloatArray) -> tuple[BoolArray, list[Crossings]]:
        """Whether rays start inside (n,), and all their crossings in order."""
        ids = {name: k for k, name in enumerate(self.mi_shapes)}
        mi_shapes = list(self.mi_shapes.values())
        reach = self.reach()
        box = self.box()
        rays = box.near(o, d)
        origin = o[rays]
        length2 = np.sum(d * d, axis=1)
        crossings: list[Crossings] = []
        inside = np.zeros(len(o), bool)
        started = rays[box.around(origin)]
        inside[started] = self._inside(ids, mi_shapes, o[started], d[started])
        within = inside.copy()
        for _ in range(MOST_CROSSINGS):
            if len(rays) == 0:
                break
            hits = read(first_hits(self.mi_scene, ids, origin, d[rays]), mi_shapes, origin)
            met = hits.shape >= 0
            rays, origin, hits = rays[met], origin[met], rows_of(hits, met)
            way = np.sum(hits.n * d[rays], axis=1)
            size = delta(o[rays], hits.p, np.full(len(rays), reach)) + hits.sag
            length = np.sqrt(length2[rays])
            slack = size / length / np.maximum(np.abs(way) / length, 1.0 / STEEPEST)
            along = np.sum((origin - o[rays]) * d[rays], axis=1) / length2[rays]
            hits.t[:] += along
            enters = way < 0.0
            # Otherwise the ray hits the same face again, or an edge whose other side it missed.
            new = enters != within[rays]
            within[rays] = enters
            crossings.append(Crossings(rays[new], enters[new], slack[new], rows_of(hits, new)))
            origin = round32(o[rays] + d[rays] * (hits.t + 0.5 * slack)[:, None])
        return inside, crossings

    def _inside(
        self, ids: Mapping[str, int], mi_shapes: list[MitsubaShape], o: FloatArray, d: FloatArray
    ) -> BoolArray:
        """(n,): whether rays start inside: a ray traced backwards then leaves the operand.

        Backwards, since ahead may be an edge that the rays are aimed at.
        """
        if isinstance(self.leaf.shape, Plane):
            to_local = affine.invert(affine.map_in(self.leaf.shape, self.place))
            return affine.apply_points(to_local, o)[:, 2] < 0.0
        if len(o) == 0:  # Dr.Jit does not accept empty arrays
            return np.zeros(0, bool)
        behind = read(first_hits(self.mi_scene, ids, o, -d), mi_shapes, o)
        return np.asarray((behind.shape >= 0) & (np.sum(behind.n * d, axis=1) < 0.0))


@dataclass(frozen=True)
class SolidCounterpart:
    """The counterpart of a CSG solid: its operands, in the order of the tree's leaves."""

    operands: Sequence[Operand]
    tree: Tree

    @property
    def place(self) -> tuple[int, int]:
        """(shape, instance) of the solid."""
        mi_shape = next(iter(self.operands[0].mi_shapes.values()))
        return mi_shape.shape, mi_shape.instance

    def box(self) -> Box:
        """A box around all operands."""
        boxes = [operand.box() for operand in self.operands]
        return Box(
            np.min([box.lower for box in boxes], axis=0),
            np.max([box.upper for box in boxes], axis=0),
        )

    def trace(self, o: FloatArray, d: FloatArray, tolerance: float = SLIGHT) -> MitsubaHits:
        """The first hits of the solid's surface.

        Crossings closer together than `tolerance` times float32's bound count as one, so that
        coincident faces leave no thin film between them.
        """
        n = len(o)
        states = np.zeros((len(self.operands), n), bool)
        crossings: list[Crossings] = []
        whose: list[int] = []
        for k, operand in enumerate(self.operands):
            states[k], some = operand.walk(o, d)
            crossings += some
            whose += [k] * len(some)
        result = misses(n)
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
            assign(result, rays, some_hits)
        return self._facing(result, d, evaluated(self.tree, states))

    def meets(
        self, o: FloatArray, d: FloatArray, part: IdArray, t: FloatArray, primitive: IdArray
    ) -> BoolArray:
        """(n,): whether the ray crosses face `primitive` of operand `part` at t, within float32's
        bound."""
        met = np.zeros(len(o), bool)
        for operand in self.operands:
            rows = np.flatnonzero(part == operand.leaf.part)
            if len(rows) == 0:
                continue
            _, crossings = operand.walk(o[rows], d[rows])
            for crossing in crossings:
                mine = rows[crossing.rays]
                # A step of a walk caps one over the cosine, which is not wanted here.
                cosine = np.abs(np.sum(crossing.at.n * d[mine], axis=1))
                cosine /= np.linalg.norm(d[mine], axis=1)
                more = np.maximum(1.0 / (STEEPEST * np.maximum(cosine, TINY)), 1.0)
                near = np.abs(crossing.at.t - t[mine]) <= crossing.slack * more
                met[mine] |= near & (crossing.at.primitive == primitive[mine])
        return met

    def _first_change(
        self,
        states: BoolArray,
        crossings: list[Crossings],
        whose: list[int],
        sorted_: tuple[IntArray, IntArray, FloatArray, FloatArray],
    ) -> IntArray:
        """(n,): the index of the first crossing at which the ray enters or leaves the solid, -1 for
        none; among crossings that count as one, the last that changes the solid's state."""
        order, column, t, slack = sorted_
        n = t.shape[1]
        everything = np.arange(n)
        states = states.copy()
        # Copies: of a single operand, `evaluated` returns its row of the states.
        began = evaluated(self.tree, states).copy()  # before the current group of crossings
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
            now = evaluated(self.tree, states).copy()
            candidate = np.where(active & (now != inside), j, candidate)
            inside = np.where(active, now, inside)
            # A crossing ends its group if the next one is clearly further.
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

    def _facing(self, hits: MitsubaHits, d: FloatArray, inside: BoolArray) -> MitsubaHits:
        """The hits with outward normals of the solid: against the ray where it enters."""
        away = np.sum(hits.n * d, axis=1) > 0.0
        turned = away != inside
        for normal in (hits.n, hits.ns):
            normal[turned] *= -1.0
        return hits


def evaluated(tree: Tree | int, states: Any) -> Any:
    """Whether points are inside the solid;  states: whether they are inside each operand.  Values
    are arrays of NumPy or Dr.Jit, or bools."""
    if isinstance(tree, int):
        return states[tree]
    first, *others = (evaluated(part, states) for part in tree.of)
    for value in others:
        if tree.operation == "union":
            first = first | value
        else:
            first = first & (value if tree.operation == "intersection" else value ^ True)
    return first
