"""Tests every primitive for every ray; hierarchies must agree with that bit for bit."""

from collections.abc import Callable
from typing import Any

import numpy as np

import reference_rt as rt
from comparisons.experiments.relations import HIERARCHIES
from comparisons.experiments.stability.harness.outcomes import FloatArray, Outcome, outcome
from comparisons.geometry.exact.dyadic import BoolArray
from reference_rt import shapes as any_shape
from reference_rt.core.arrays import IntArray
from reference_rt.core.ray import Hit, is_representable
from reference_rt.core.ray import at as point_at
from reference_rt.core.ray import scaled as scaled_ray
from reference_rt.core.vec3 import row
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.rendering import query
from reference_rt.rendering.query import Closest
from reference_rt.shapes import Shapes
from reference_rt.shapes.meshes.watertight import shear_of


@kernel
def _comes_first(shapes: Shapes, a: Hit, b: Hit) -> bool:
    """Which of two hits at one t counts: by kind, then by shape, then by face."""
    if a.kind != b.kind:
        return a.kind < b.kind
    of_a, of_b = any_shape.owner(shapes, a.kind, a.row), any_shape.owner(shapes, b.kind, b.row)
    if of_a != of_b:
        return bool(of_a < of_b)
    return bool(any_shape.face(shapes, a) < any_shape.face(shapes, b))


@entry_kernel
def _every(
    shapes: Shapes,
    references: IntArray,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    kinds: IntArray,
    rows: IntArray,
    uv: FloatArray,
) -> None:
    for i in range(len(o)):
        # As all queries do: squares of extreme directions would leave float64's range.
        ray, unit, valid = scaled_ray(row(o, i), row(d, i), np.inf)
        t[i], kinds[i], rows[i], uv[i, 0], uv[i, 1] = np.inf, -1, -1, 0.0, 0.0
        if not valid:
            continue
        shear = shear_of(ray)
        closest = Hit(np.inf, -1, -1, 0.0, 0.0, -1)
        for k in range(len(references)):
            kind: Any = np.int64(references[k, 0])
            number: Any = np.int64(references[k, 1])
            found = any_shape.intersect(shapes, kind, number, ray, shear)
            if found.t < np.inf and found.t <= closest.t:
                hit = Hit(found.t, kind, number, found.u, found.v, -1)
                if found.t < closest.t or _comes_first(shapes, hit, closest):
                    closest = hit
        if closest.kind >= 0 and is_representable(closest.t * unit, point_at(ray, closest.t)):
            t[i], kinds[i], rows[i] = closest.t * unit, closest.kind, closest.row
            uv[i, 0], uv[i, 1] = closest.u, closest.v


def every(tables: SceneTables, o: FloatArray, d: FloatArray) -> Closest:
    """The closest hits, by no hierarchy: of scenes without solids and groups."""
    geometry = tables.geometry
    assert geometry.bvh is not None
    n = len(o)
    found = Closest(np.empty(n), np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, 2)))
    with np.errstate(all="ignore"):
        _every(
            geometry.shapes,
            geometry.bvh.references.astype(np.int64),
            np.ascontiguousarray(o),
            np.ascontiguousarray(d),
            found.t,
            found.kind,
            found.row,
            found.uv,
        )
    return found


def named(tables: SceneTables, found: Closest) -> FloatArray:
    """(n, 6): t, kind, owner, face, u, v, which are the same whatever order tables have."""
    owner, face = np.full((2, len(found.t)), -1)
    for code, field, _, _ in any_shape.TABLES:
        mine = found.kind == code
        if mine.any():
            table = getattr(tables.geometry.shapes, field)
            owner[mine] = table.owner[np.minimum(found.row[mine], len(table.owner) - 1)]
            face[mine] = table.face[found.row[mine]]
    return np.column_stack([found.t, found.kind, owner, face, found.uv])


def differ(a: FloatArray, b: FloatArray) -> BoolArray:
    """Which rows are not the same bits."""
    return np.asarray((a.view(np.int64) != b.view(np.int64)).any(axis=1))


def any_hit_differs(tables: SceneTables, o: FloatArray, d: FloatArray, t: FloatArray) -> BoolArray:
    """Whether `occluded` does not agree with hits at t: on the whole ray, up to t, and just
    beyond."""
    hit = np.isfinite(t)
    wrong = query.occluded(tables, o, d) != hit
    wrong |= query.occluded(tables, o, d, t) != (t > np.inf)
    wrong |= query.occluded(tables, o, d, np.nextafter(t, np.inf)) != hit
    return np.asarray(wrong)


def compare(scene: rt.Scene, o: FloatArray, d: FloatArray, singly: bool) -> Outcome:
    """All four hierarchies of a scene;  singly: against every primitive by itself, else against
    "none", one leaf with everything, which tests eight triangles at once."""

    def found(tables: SceneTables) -> FloatArray:
        return named(tables, query.closest_primitives(tables, o, d))

    def truth(tables: SceneTables) -> FloatArray:
        return named(tables, every(tables, o, d))

    return _compared(scene, o, d, found, truth if singly else None)


def compare_all(scene: rt.Scene, o: FloatArray, d: FloatArray) -> Outcome:
    """The same of any scene, against "none": everything that is known of a hit."""

    def found(tables: SceneTables) -> FloatArray:
        hits = vars(query.intersect(tables, o, d))
        return np.column_stack([np.asarray(a, np.float64) for a in hits.values()])

    return _compared(scene, o, d, found, None)


Find = Callable[[SceneTables], FloatArray]
"""The hits of rays in a scene as rows (n, k), t first."""


def _compared(
    scene: rt.Scene, o: FloatArray, d: FloatArray, find: Find, truth: Find | None
) -> Outcome:
    """Each ray is a case for each hierarchy.  truth: by default what "none" finds."""
    total = Outcome(0, 0)
    expected = None
    for method in HIERARCHIES:
        tables = rt.build_tables(scene.changed(hierarchy=method))
        got = find(tables)
        if expected is None:
            expected = truth(tables) if truth else got
        wrong = differ(got, expected) | any_hit_differs(tables, o, d, expected[:, 0])
        shown = {"hierarchy": method, "origin": o, "direction": d}
        total += outcome(wrong, shown | {"expected": expected, "found": got})
    return total
