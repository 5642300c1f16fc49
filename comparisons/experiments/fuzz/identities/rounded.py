"""Identities that hold up to rounding."""

import dataclasses
import itertools
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.finding import Finding
from comparisons.experiments.fuzz.identities.rays import Bench, Original, bench, ray_words, words
from comparisons.geometry.frame import Frame
from comparisons.mitsuba.translate.moved import moved as in_frame
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import UNIT_ROUNDOFF
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.shapes import Plane
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Solid
from reference_rt.util.errors import SceneError

ROUNDINGS = 64.0
"""How far rounding moves a surface, in roundoffs of the largest coordinate: about thirty operations
of the maps on either side, as in F9 of the stability families (`metamorphic.light.REACH`)."""

SPREAD = 4.0
"""How many times as much as under such a move a hit may change: the move is that of one point, and
a hit depends on the positions of three or four."""

AROUND = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)], np.float64)
"""Directions of the moves: to the faces, edges and corners of a cube."""

NORMAL = 1e-6
"""Allowed change of a unit normal besides that: roundings of 1e-13 of the size over the radii of
curvature of ordinary scenes are below 1e-9; a wrong formula is off by 1e-3 and more."""


def moved(original: Original) -> str | Finding:
    """Everything moved by the same vector."""
    at = original.bench
    offset = np.round(original.rng.uniform(-8.0, 8.0, 3), 3)
    other = in_frame(original.scene, Frame(tuple((-offset).tolist()), 1.0))
    hits = query.intersect(other.tables, at.o + offset, at.d)
    return _judged("moved", f"moved by {offset.tolist()}", at, hits, float(np.abs(offset).max()))


def grouped(original: Original) -> str | Finding | None:
    """Shapes under one more map each, against an instance of a group of them under that map."""
    scene, rng = original.scene, original.rng
    bounded = [s for s in scene.shapes if not isinstance(s, Plane)]
    if not bounded or any(isinstance(s, Solid) for s in bounded):
        return None
    if sum(isinstance(s, Instance) for s in scene.shapes) > 0 and rng.random() < 0.5:
        bounded = [s for s in bounded if not isinstance(s, Instance)] or bounded
    linear = np.eye(3) + 0.3 * rng.normal(size=(3, 3))
    if np.abs(np.linalg.det(linear)) < 0.3:
        return None
    rows = np.column_stack([linear, rng.uniform(-1.0, 1.0, 3)]).tolist()
    step = transform.Matrix.model_validate({"matrix": rows})
    try:
        shapes = [s.model_copy(update={"transform": (*s.transform, step)}) for s in bounded]
        baked = scene.changed(shapes=tuple(shapes))
        groups = dict(scene.groups) | {"all of it": tuple(bounded)}
        one = Instance(group="all of it", transform=(step,))
        other = scene.changed(groups=groups, shapes=(one,))
        tables = other.tables
    except SceneError:
        return None
    at = bench(baked, rng, original.rays)
    hits = query.intersect(tables, at.o, at.d)
    return _judged("grouped", f"under the map {rows}", at, hits, 0.0)


def _judged(name: str, how: str, at: Bench, hits: Intersections, offset: float) -> str | Finding:
    """Every ray that differs must be one that changes as much when it is moved as far as rounding
    moves surfaces."""
    size = ROUNDINGS * UNIT_ROUNDOFF
    # Rays that start on an infinite plane may be far outside of the scene's size.
    shift = size * (np.maximum(at.size, np.abs(at.o).max(axis=1)) + offset)
    hits = dataclasses.replace(hits, n=_facing(at.hits, hits))
    differs = _differs(at.hits, hits, size)
    wrong = [k for k in np.flatnonzero(differs).tolist() if not _excused(at, hits, k, shift[k])]
    if not wrong:
        return "agree"
    k = wrong[0]
    cause = "hits differ"
    if (hits.shape[k] < 0) != (at.hits.shape[k] < 0):
        cause = "a hit and a miss"
    elif np.abs(hits.n[k] - at.hits.n[k]).max() > NORMAL:
        cause = "normals differ"
    return Finding(
        rung=f"identity {name}",
        cause=cause,
        detail=f"{how}: {len(wrong)} of {len(at.o)} rays differ; the first, {ray_words(at, k)}: "
        f"{words(at.hits, k)}; then {words(hits, k)}",
    )


def _facing(one: Intersections, other: Intersections) -> FloatArray:
    """The normals (n, 3) of `other`, turned where it hit another face that lies back to back with
    that of `one`: either may be hit."""
    faces = [getattr(one, x) != getattr(other, x) for x in ("shape", "part", "primitive")]
    opposite = np.any(faces, axis=0) & (np.sum(one.n * other.n, axis=1) < 0.0)
    return np.where(opposite[:, None], -other.n, other.n)


def _differs(one: Intersections, other: Intersections, size: float) -> Any:
    """Where hits differ by more than a few roundings."""
    t, t2, n, n2 = one.t, other.t, one.n, other.n
    with np.errstate(invalid="ignore"):  # both may be infinite
        same_t = (t == t2) | (np.abs(t - t2) <= size * np.abs(t))
    missed = ~np.isfinite(t) & ~np.isfinite(t2)
    same_n = np.abs(n - n2).max(axis=1) <= NORMAL
    return ~(missed | (same_t & same_n))


def _excused(at: Bench, hits: Intersections, k: int, shift: float) -> bool:
    """Whether ray k, moved by `shift`, has a hit like the other scene's."""
    moves = np.concatenate([shift * AROUND, 0.4 * shift * AROUND, np.zeros((1, 3))])
    o = at.o[k] + moves
    near = query.intersect(at.tables, o, np.broadcast_to(at.d[k], o.shape))
    if not np.isfinite(hits.t[k]):
        return bool((~np.isfinite(near.t)).any())
    alike = np.isfinite(near.t) & (np.abs(near.n - hits.n[k]).max(axis=1) <= 1e-3)
    if not alike.any():
        return False
    t = near.t[alike]
    length = float(np.linalg.norm(at.d[k]))
    slack = SPREAD * float(t.max() - t.min()) + SPREAD * shift / length
    low, high = float(t.min()) - slack, float(t.max()) + slack
    if not low <= hits.t[k] <= high:
        return False
    spread = SPREAD * np.ptp(near.n[alike], axis=0).max() + NORMAL
    return bool((np.abs(near.n[alike] - hits.n[k]).max(axis=1) <= spread).any())
