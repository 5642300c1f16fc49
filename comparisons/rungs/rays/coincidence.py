"""Rays that meet two surfaces in one place, of which each tracer takes its own."""

from typing import Any

import numpy as np

from comparisons.mitsuba.counterpart import Twin, trace
from comparisons.mitsuba.hits import Answers, BoolArray, rows_of
from comparisons.rungs.rays.bounds import slide
from comparisons.rungs.rays.comparer import DISCRETE, Comparer
from comparisons.rungs.rays.rays import Rays
from reference_rt.core.arrays import IntArray
from reference_rt.core.transform import Translate
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

COINCIDENCES = 8
"""Shapes that are looked behind: each costs building the tables again."""


def coincident(
    scene: Scene, twin: Twin, comparer: Comparer, answered: Any, numbers: IntArray
) -> BoolArray:
    """Which of the rays `numbers` (m,) meet two surfaces in one place, of which ours found one,
    Mitsuba the other.

    Two operands of a solid: where the solid's twin has our answer if it passes crossings at once
    that float32 cannot tell apart, or none at once; or where t and the normals agree, as those of
    the solid do whichever is taken.  Two shapes: where ours gives Mitsuba's answer once its own
    shape is far away, at the same t.
    """
    found = np.zeros(len(numbers), bool)
    if len(numbers) == 0:
        return found
    rays, ours, theirs = answered.rays, answered.ours, answered.theirs
    if twin.solids:
        for tolerance in (None, 0.0, 1.0):
            rest = np.flatnonzero(~found)
            k = numbers[rest]
            some, mine = Rays(rays.o[k], rays.d[k]), rows_of(ours, k)
            again = rows_of(theirs, k)
            if tolerance is not None:
                again = trace(twin, some.o, some.d, tolerance)
            _as_one_part(twin, some, mine, again)
            found[rest] = (comparer.ratios(some, mine, again) <= 1.0).all(axis=1)
    left = ours.shape[numbers][~found]
    for shape in np.unique(left[left >= 0])[:COINCIDENCES].tolist():
        rest = np.flatnonzero(~found & (ours.shape[numbers] == shape))
        k = numbers[rest]
        some = Rays(rays.o[k], rays.d[k])
        others = build_tables(_without(scene, shape, float(comparer.sizes.reach.max())))
        behind = query.intersect(others, some.o, some.d)
        agrees = (comparer.ratios(some, behind, rows_of(theirs, k)) <= 1.0).all(axis=1)
        e = slide(comparer.sizes, some.o, some.d, behind)
        with np.errstate(invalid="ignore"):
            found[rest] = agrees & (np.abs(behind.t - ours.t[k]) <= e)
    return found


def in_one_place(comparer: Comparer, answered: Any, numbers: IntArray) -> BoolArray:
    """Which of the rays `numbers` (m,) meet two surfaces that touch along their whole: at the same
    t, with the same normal or the opposite one."""
    ours, theirs = rows_of(answered.ours, numbers), rows_of(answered.theirs, numbers)
    rays = Rays(answered.rays.o[numbers], answered.rays.d[numbers])
    e = slide(comparer.sizes, rays.o, rays.d, ours, theirs.sag)
    length = np.linalg.norm(rays.d, axis=1)
    with np.errstate(invalid="ignore"):
        near = np.abs(theirs.t - ours.t) * length <= e
    parallel = np.abs(np.sum(ours.n * theirs.n, axis=1)) >= 1.0 - 1e-6
    other = (answered.ratios[numbers, :DISCRETE] > 1.0).any(axis=1)
    return np.asarray(near & parallel & other & (ours.shape >= 0) & (theirs.shape >= 0))


def _as_one_part(twin: Twin, rays: Rays, ours: Intersections, theirs: Answers) -> None:
    """Puts the operand that ours found in place of Mitsuba's, where Mitsuba meets that too."""
    for solid in twin.solids:
        shape, instance = solid.place
        rows = (theirs.shape == shape) & (theirs.instance == instance)
        rows &= (ours.shape == shape) & (ours.instance == instance)
        rows &= (ours.part != theirs.part) | (ours.primitive != theirs.primitive)
        some = np.flatnonzero(rows)
        if len(some) == 0:
            continue
        part, primitive = ours.part[some], ours.primitive[some]
        o, t = twin.frame.into(rays.o[some]), ours.t[some] * twin.frame.scale
        met = solid.meets(o, rays.d[some], part, t, primitive)
        theirs.part[some[met]], theirs.primitive[some[met]] = part[met], primitive[met]
        theirs.has_uv[some[met]] = False


def _without(scene: Scene, index: int, reach: float) -> Scene:
    """The scene with one shape far away.  Left out, it would make kernels compile again."""
    far = 1e6 * max(reach, 1.0)
    shapes = list(scene.shapes)
    steps = (*shapes[index].transform, Translate(translate=(far, far, far)))
    shapes[index] = shapes[index].model_copy(update={"transform": steps})
    return scene.changed(shapes=tuple(shapes))
