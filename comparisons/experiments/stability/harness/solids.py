"""Where rays go in and out of a solid: by ours, by the textbook's methods, and exactly."""

import dataclasses
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons.experiments.stability.harness.meshes import BALL
from comparisons.experiments.stability.harness.outcomes import OURS, FloatArray
from comparisons.geometry.exact.dyadic import Dyadic, nearest
from comparisons.geometry.flatten import Tree, member_of
from comparisons.referee.referee import crossings_of, evaluated
from comparisons.referee.sizes import LeafSizes
from reference_rt import textbook
from reference_rt.core.arrays import IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.query.crossings import SolidCrossings, solid_crossings
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import csg
from reference_rt.shapes.shape import TabulationContext
from reference_rt.textbook.csg import interval_list
from reference_rt.textbook.operands import CsgParameters

INTERVALS, INSIDE_TESTS = "csg.intervals", "csg.inside_tests"

MOST = 256
"""Crossings of a ray: of 130 operands, of which two in three are convex."""


def scene_of(solid: Any, folder: Path) -> Scene:
    """The solid and, behind it, one of each kind of table: all scenes are traced by one set of
    kernels."""
    others = (rt.Sphere(), rt.Box(), rt.Cylinder(capped=True), rt.Torus(), rt.Mesh(file=BALL))
    scene = rt.Scene(shapes=(solid, *others))
    scene._folder = folder
    return scene


class Lists(NamedTuple):
    """t (n, k): inf where there are fewer;  width (n, k): how far rounding may have moved t."""

    t: FloatArray
    width: FloatArray


def ours(solid: Any, folder: Path, o: FloatArray, d: FloatArray) -> Lists:
    return _lists(solid_crossings(scene_of(solid, folder).tables, 0, o, d, MOST))


def _lists(found: SolidCrossings) -> Lists:
    assert found.count.max(initial=0) <= MOST
    k = int(found.count.max(initial=0))
    return Lists(found.t[:, :k], found.width[:, :k])


def intervals(solid: Any, folder: Path, o: FloatArray, d: FloatArray) -> FloatArray:
    """The whole list of the textbook's intervals: (n, k)."""
    tree = textbook.METHODS[INTERVALS].prepare(CsgParameters(solid, folder))
    with np.errstate(all="ignore"):
        found = interval_list(tree, o, d)
    ahead = np.sort(np.where(found > 0.0, found, np.inf), axis=1)
    return np.asarray(ahead)


def inside_tests(solid: Any, folder: Path, o: FloatArray, d: FloatArray) -> FloatArray:
    """The first crossing alone: (n, 1)."""
    return textbook.intersect(INSIDE_TESTS, CsgParameters(solid, folder), o, d)[:, None]


LISTS: Mapping[str, Callable[[Any, Path, FloatArray, FloatArray], FloatArray]] = {
    OURS: lambda *arguments: ours(*arguments).t,
    INTERVALS: intervals,
    INSIDE_TESTS: inside_tests,
}
"""Crossings (n, k) of a solid, its folder and rays, by contestant."""


def same(a: FloatArray, b: FloatArray) -> Any:
    """Which rows (n,) hold the same numbers."""
    k = max(a.shape[1], b.shape[1])
    wide = [np.pad(x, ((0, 0), (0, k - x.shape[1])), constant_values=np.inf) for x in (a, b)]
    return (wide[0] == wide[1]).all(axis=1)


class Stretch(NamedTuple):
    """Between crossings of operands that are further apart than rounding can move them: from t0 to
    t1, and whether the solid is there."""

    t0: float
    t1: float
    inside: bool


class Truth(NamedTuple):
    """The truth about one ray.  stretches: in order, those between crossings that rounding can tell
    apart;  touching: it runs exactly through an edge;  crossings, widths, operands: t of each
    crossing of an operand, how far rounding may have moved it, and the operand's number."""

    stretches: list[Stretch]
    touching: bool
    crossings: FloatArray
    widths: FloatArray
    operands: IntArray


def truths(solid: Any, folder: Path, o: FloatArray, d: FloatArray) -> list[Truth]:
    """By exact arithmetic on the operands as they are tabulated, seen from the solid's anchor;
    widths by what ours states of each operand's crossings."""
    tree = member_of(solid, 0).tree
    assert isinstance(tree, Tree)
    anchor, operands = csg.anchored(solid)
    exact = (Dyadic.of(o) - Dyadic.of(anchor[None]), Dyadic.of(d))
    seen = exact[0].floats()
    leaves = [
        LeafSizes(shape, None, shape.tabulate(TabulationContext(folder=folder, outer=outer)))
        for shape, outer in operands
    ]
    found = [crossings_of(leaf, (seen, d), exact) for leaf in leaves]
    tables = scene_of(solid, folder).tables
    stated = [_alone(tables, k, o, d) for k in range(len(operands))]
    return [
        _truth(
            tree,
            [lists[k] for lists, _ in found],
            any(bool(flags[k]) for _, flags in found),
            [Lists(s.t[k], s.width[k]) for s in stated],
        )
        for k in range(len(o))
    ]


def _alone(tables: SceneTables, k: int, o: FloatArray, d: FloatArray) -> Lists:
    """The crossings of operand k as ours states them within solid 0: as a shape of its own it would
    have another local origin, and round otherwise."""
    solids = tables.geometry.solids
    assert solids is not None
    one, zero = np.ones(1, np.int64), np.zeros(1, np.int64)
    alone = solids._replace(
        first=solids.first + k,
        operands=one,
        tree=-one,
        asked_first=zero,
        asked_count=one,
        asked=solids.first[:1] + k,
        gate_first=zero,
        gates=one,
        up=np.zeros_like(solids.up),
        gate_up=-one,
        gate_start=zero,
    )
    geometry = tables.geometry._replace(solids=alone)
    return _lists(solid_crossings(dataclasses.replace(tables, geometry=geometry), 0, o, d, MOST))


def _truth(tree: Any, found: list[list[Any]], touching: bool, stated: list[Lists]) -> Truth:
    events = sorted(
        (t, k, enters) for k, some in enumerate(found) for t, _, enters in some if t > 0
    )
    states = [sum(1 if enters else -1 for t, _, enters in some if t <= 0) for some in found]
    times = nearest(np.array([t for t, _, _ in events], dtype=object))
    widths = np.array([_width(stated[k], t) for (_, k, _), t in zip(events, times, strict=True)])
    stretches = []
    reach = 0.0
    for j, (_, k, enters) in enumerate(events):
        # Twice the bound: where two are found apart by one bound each, they are further than that.
        start = times[j] - 2.0 * widths[j]
        if start > reach:
            stretches.append(Stretch(reach, float(start), evaluated(tree, states)))
        reach = max(reach, float(times[j] + 2.0 * widths[j]))
        states[k] += 1 if enters else -1
    stretches.append(Stretch(reach, np.inf, evaluated(tree, states)))
    # What a later crossing reaches back over is not resolved either.
    clear = [s for s in stretches if not np.any((times - 2 * widths < s.t0) & (times > s.t1))]
    operands = np.array([k for _, k, _ in events], np.int64)
    return Truth(clear, touching, times, widths, operands)


def _width(stated: Lists, t: float) -> float:
    """Of the operand's crossing at t; inf where none is stated, as two are too close together."""
    there = np.isfinite(stated.t)
    if not there.any():
        return np.inf
    k = int(np.argmin(np.abs(stated.t[there] - t)))
    width = float(stated.width[there][k])
    return width if abs(stated.t[there][k] - t) <= width else np.inf


def problem(truth: Truth, t: FloatArray) -> tuple[str, float] | None:
    """How crossings (k,) break the law, and the length of the wrong stretch; else None."""
    t = t[np.isfinite(t)]
    for x in t.tolist():
        if not np.any(np.abs(truth.crossings - x) <= 2.0 * truth.widths):
            return f"a crossing that is none, at {x.hex()}", float(x)
    for stretch in truth.stretches:
        # The last is without end: its middle is beyond all crossings.
        middle = 0.5 * (stretch.t0 + stretch.t1)
        if bool(np.sum(t < middle) % 2) != stretch.inside:
            lost = "lost" if stretch.inside else "false"
            length = 0.0 if stretch.t1 == np.inf else stretch.t1 - stretch.t0
            return f"a stretch is {lost}: from {stretch.t0.hex()} to {stretch.t1.hex()}", length
    for a, b in pairwise(t.tolist()):
        bound = sum(truth.widths[np.argmin(np.abs(truth.crossings - x))] for x in (a, b))
        if b - a < 0.5 * bound:
            return f"a film: from {float(a).hex()} to {float(b).hex()}", float(b - a)
    return None


def first_problem(truth: Truth, t: float) -> tuple[str, float] | None:
    """The same for a method that gives the first crossing alone."""
    for stretch in truth.stretches:
        if stretch.inside:
            if t > stretch.t1:
                return f"a stretch is lost: from {stretch.t0.hex()}", stretch.t1 - stretch.t0
            return None
        if stretch.t0 < t < stretch.t1 and t < np.inf:
            return f"a false crossing at {float(t).hex()}", stretch.t1 - stretch.t0
        following = [s for s in truth.stretches if s.t0 >= stretch.t1]
        if (
            t < np.inf
            and following
            and not following[0].inside
            and stretch.t1 <= t <= following[0].t0
        ):
            return f"a film at {float(t).hex()}", 0.0
    return None
