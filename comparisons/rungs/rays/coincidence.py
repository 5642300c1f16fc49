"""Rays that hit coincident surfaces, of which each tracer may report either."""

import dataclasses
from typing import Any

import numpy as np

from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.hits import BoolArray, MitsubaHits, rows_of
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays.comparer import DISCRETE, KINDS, Comparer
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.slide import slide
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.transform import Translate
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

COINCIDENCES = 8
"""Most shapes that are moved away to trace what lies behind: each needs new tables."""


def coincident(
    scene: Scene, counterpart: Counterpart, comparer: Comparer, traced: Any, numbers: IntArray
) -> BoolArray:
    """Which of the rays with the indices `numbers` (m,) hit two coincident surfaces, of which we
    report one and Mitsuba the other.

    Two operands of a solid: t and the normals agree, or Mitsuba's solid has our hit with another
    tolerance for merging crossings that float32 cannot separate.  Two faces of a shape: our ray
    crosses Mitsuba's face too, at the same t.  Two shapes: with our shape moved far away, our
    tracer has Mitsuba's hit at the same t.
    """
    together = np.zeros(len(numbers), bool)
    if len(numbers) == 0:
        return together
    rays, ours, theirs = traced.rays, traced.ours, traced.theirs
    if counterpart.solids:
        for tolerance in (None, 0.0, 1.0):
            rest = np.flatnonzero(~together)
            k = numbers[rest]
            some, mine = rays.rows(k), rows_of(ours, k)
            again = rows_of(theirs, k)
            if tolerance is not None:
                again = trace(counterpart, some.o, some.d, tolerance)
            _as_one_part(counterpart, some, mine, again)
            together[rest] = (comparer.ratios(some, mine, again) <= 1.0).all(axis=1)
    rest = np.flatnonzero(~together)
    k = numbers[rest]
    together[rest] = _on_two_faces(
        scene, comparer, rays.rows(k), rows_of(ours, k), rows_of(theirs, k)
    )
    left = ours.shape[numbers][~together]
    for shape in np.unique(left[left >= 0])[:COINCIDENCES].tolist():
        rest = np.flatnonzero(~together & (ours.shape[numbers] == shape))
        k = numbers[rest]
        some = rays.rows(k)
        others = build_tables(_without(scene, shape, float(comparer.sizes.reach.max())))
        behind = query.intersect(others, some.o, some.d)
        agrees = (comparer.ratios(some, behind, rows_of(theirs, k)) <= 1.0).all(axis=1)
        e = slide(comparer.sizes, some.o, some.d, behind)
        with np.errstate(invalid="ignore"):
            at_one_t = np.abs(behind.t - ours.t[k]) <= e
        # Where nothing lies behind, t and e are infinite: Mitsuba misses what we hit.
        together[rest] = agrees & (behind.shape >= 0) & at_one_t
    return together


def _on_two_faces(
    scene: Scene, comparer: Comparer, rays: Rays, ours: Intersections, theirs: MitsubaHits
) -> BoolArray:
    """Which rays cross the face that Mitsuba reports at the same t as another face of the same
    shape, which we report: as where a mesh has a triangle twice, or two shapes of an instanced
    group lie in one plane."""
    crossing = np.zeros(len(ours.t), bool)
    other_face = _is_other(ours, theirs)
    rows = np.flatnonzero(other_face & (ours.shape >= 0) & (ours.shape == theirs.shape))
    if len(rows) == 0:
        return crossing
    some, mine, other = rays.rows(rows), rows_of(ours, rows), rows_of(theirs, rows)
    e = slide(comparer.sizes, some.o, some.d, mine, other.sag) / np.linalg.norm(some.d, axis=1)
    crossed = query.crossings(scene.tables, some.o, some.d)
    all_of_them = _as_hits(crossed)
    ray = crossed.ray
    near = np.abs(all_of_them.t - mine.t[ray]) <= e[ray]
    like = np.column_stack(
        [getattr(all_of_them, name) == getattr(other, name)[ray] for name in KINDS[1:DISCRETE]]
    ).all(axis=1)
    for k in np.flatnonzero(near & like).tolist():
        one = int(ray[k])
        ratios = comparer.ratios(
            some.rows(np.array([one])),
            rows_of(all_of_them, np.array([k])),
            rows_of(other, np.array([one])),
        )
        crossing[rows[one]] |= bool((ratios <= 1.0).all())
    return crossing


def _as_hits(crossed: query.Crossings) -> Intersections:
    """Crossings as hits of their rays."""
    names = [field.name for field in dataclasses.fields(Intersections)]
    return Intersections(**{name: getattr(crossed, name) for name in names})


def in_one_place(comparer: Comparer, traced: Any, numbers: IntArray) -> BoolArray:
    """Which of the rays with the indices `numbers` (m,) hit two surfaces that coincide: at the same
    t, with the same normal or the opposite one."""
    ours, theirs = rows_of(traced.ours, numbers), rows_of(traced.theirs, numbers)
    rays = traced.rays.rows(numbers)
    near = _at_one_t(comparer.sizes, rays, ours, theirs)
    parallel = np.abs(np.sum(ours.n * theirs.n, axis=1)) >= 1.0 - 1e-6
    other = (traced.ratios[numbers, :DISCRETE] > 1.0).any(axis=1)
    return np.asarray(near & parallel & other & (ours.shape >= 0) & (theirs.shape >= 0))


def _is_other(ours: Intersections, theirs: MitsubaHits) -> BoolArray:
    """(n,): whether the hits are of different shapes, instances, parts or faces."""
    pairs = ((getattr(ours, name), getattr(theirs, name)) for name in KINDS[1:DISCRETE])
    return np.asarray(np.any([mine != other for mine, other in pairs], axis=0))


def _at_one_t(sizes: ShapeSizes, rays: Rays, ours: Intersections, theirs: MitsubaHits) -> BoolArray:
    """(n,): whether rays hit at the same t, within float32's error; not where either misses."""
    e = slide(sizes, rays.o, rays.d, ours, theirs.sag)
    with np.errstate(invalid="ignore"):  # misses
        off = np.abs(theirs.t - ours.t) * np.linalg.norm(rays.d, axis=1)
        return np.asarray(off <= e)


def on_two_surfaces(
    sizes: ShapeSizes, tables: SceneTables, rays: Rays, ours: Intersections, theirs: MitsubaHits
) -> BoolArray:
    """(n,): whether a ray hits two surfaces of ours in one place, of which each renderer reports
    another one: they may have different materials, and the rung of geometry judges them."""
    here = _at_one_t(sizes, rays, ours, theirs)
    rows = np.flatnonzero(_is_other(ours, theirs) & here)
    two = np.zeros(len(here), bool)
    two[rows] = _are_two(sizes, tables, rays.rows(rows), ours.t[rows])
    return two


def is_doubled(
    sizes: ShapeSizes, tables: SceneTables, p: FloatArray, target: FloatArray
) -> BoolArray:
    """(n,): whether the line from p to `target`, (n, 3) each, crosses two surfaces at the target
    that float32 cannot tell apart: lamps that are thinner than its error, with a dark back."""
    return _are_two(sizes, tables, Rays(p, target - p), np.ones(len(p)))


def together_along(sizes: ShapeSizes, tables: SceneTables, rays: Rays) -> tuple[IntArray, IntArray]:
    """Which rays (m,) cross which two shapes (m, 2), one behind the other, in one place, within
    float32's error."""
    crossed = query.crossings(tables, rays.o, rays.d)
    e = slide(sizes, rays.o[crossed.ray], rays.d[crossed.ray], _as_hits(crossed))
    apart = np.diff(crossed.t) * np.linalg.norm(rays.d[crossed.ray[1:]], axis=1)
    near = (np.diff(crossed.ray) == 0) & (apart <= e[1:] + e[:-1])
    shapes = np.stack([crossed.shape[:-1], crossed.shape[1:]], axis=1)
    return crossed.ray[1:][near], shapes[near]


def _are_two(sizes: ShapeSizes, tables: SceneTables, rays: Rays, t: FloatArray) -> BoolArray:
    """(n,): whether rays cross two surfaces at t (n,), within float32's error."""
    crossed = query.crossings(tables, rays.o, rays.d)
    ray = crossed.ray
    e = slide(sizes, rays.o[ray], rays.d[ray], _as_hits(crossed))
    near = np.abs(crossed.t - t[ray]) * np.linalg.norm(rays.d[ray], axis=1) <= e
    return np.asarray(np.bincount(ray[near], minlength=len(t)) > 1)


def _as_one_part(
    counterpart: Counterpart, rays: Rays, ours: Intersections, theirs: MitsubaHits
) -> None:
    """Replace Mitsuba's operand by ours where Mitsuba crosses our operand at the same t too."""
    for solid in counterpart.solids:
        shape, instance = solid.place
        rows = (theirs.shape == shape) & (theirs.instance == instance)
        rows &= (ours.shape == shape) & (ours.instance == instance)
        rows &= (ours.part != theirs.part) | (ours.primitive != theirs.primitive)
        some = np.flatnonzero(rows)
        if len(some) == 0:
            continue
        part, primitive = ours.part[some], ours.primitive[some]
        o, t = counterpart.frame.into(rays.o[some]), ours.t[some] * counterpart.frame.scale
        met = solid.meets(o, rays.d[some], part, t, primitive)
        theirs.part[some[met]], theirs.primitive[some[met]] = part[met], primitive[met]
        theirs.has_uv[some[met]] = False


def _without(scene: Scene, index: int, reach: float) -> Scene:
    """The scene with one shape moved far away: removing it would compile the kernels again."""
    far = 1e6 * max(reach, 1.0)
    shapes = list(scene.shapes)
    steps = (*shapes[index].transform, Translate(translate=(far, far, far)))
    shapes[index] = shapes[index].model_copy(update={"transform": steps})
    return scene.changed(shapes=tuple(shapes))
