"""Every primitive of a scene for every ray: what hierarchies must agree with, bit for bit."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

import reference_rt as rt
from comparisons.experiments.stability.harness.family import EXAMPLES, FloatArray, Outcome
from reference_rt import shapes as any_shape
from reference_rt.accel import bvh
from reference_rt.core.arrays import IntArray
from reference_rt.core.ray import Hit, at
from reference_rt.core.scaled_ray import is_told, scaled
from reference_rt.core.vec3 import row
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.rendering import query
from reference_rt.rendering.query import Closest
from reference_rt.shapes import Shapes
from reference_rt.shapes.meshes.watertight import shear_of

BoolArray = npt.NDArray[np.bool_]

METHODS: tuple[bvh.Method, ...] = ("sah", "median", "spatial", "none")


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
        ray, unit, valid = scaled(row(o, i), row(d, i), np.inf)
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
        if closest.kind >= 0 and is_told(closest.t * unit, at(ray, closest.t)):
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
            owner[mine] = table.owner[found.row[mine]]
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
    total = Outcome(0, 0)
    expected = None
    for method in reversed(METHODS):
        tables = rt.build_tables(scene.changed(hierarchy=method))
        found = query.closest_primitives(tables, o, d)
        got = named(tables, found)
        if expected is None:
            expected = named(tables, every(tables, o, d)) if singly else got
        wrong = differ(got, expected) | any_hit_differs(tables, o, d, expected[:, 0])
        total += outcome(method, o, d, wrong, got, expected)
    return total


def compare_all(scene: rt.Scene, o: FloatArray, d: FloatArray) -> Outcome:
    """The same of any scene, against "none": everything that is known of a hit."""
    total = Outcome(0, 0)
    expected: Any = None
    for method in reversed(METHODS):
        tables = rt.build_tables(scene.changed(hierarchy=method))
        hits = vars(query.intersect(tables, o, d))
        got = np.column_stack([np.asarray(a, np.float64) for a in hits.values()])
        expected = got if expected is None else expected
        wrong = differ(got, expected) | any_hit_differs(tables, o, d, expected[:, 0])
        total += outcome(method, o, d, wrong, got, expected)
    return total


def outcome(
    method: str,
    o: FloatArray,
    d: FloatArray,
    wrong: BoolArray,
    got: FloatArray,
    expected: FloatArray,
) -> Outcome:
    """Of rays, each of which is a case for each hierarchy."""

    def example(k: int) -> Mapping[str, Any]:
        return {
            "hierarchy": method,
            "origin": [x.hex() for x in o[k].tolist()],
            "direction": [x.hex() for x in d[k].tolist()],
            "expected": [x.hex() for x in expected[k].tolist()],
            "found": [x.hex() for x in got[k].tolist()],
        }

    which = np.flatnonzero(wrong)
    return Outcome(
        cases=len(o),
        failures=len(which),
        examples=tuple(example(k) for k in which[:EXAMPLES].tolist()),
    )
