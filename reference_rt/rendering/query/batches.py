"""First hits of arrays of rays: which kernels trace how many of them."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from reference_rt.accel.array_query import MOST_ADDED, Primitives
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.query.linked import Linked, link_to_geometry
from reference_rt.rendering.query.tracing import (
    BLOCKS,
    CROSSING,
    EVERY_RAY,
    FEW,
    IDS,
    NO_LIMIT,
    ONE_BY_ONE,
    SURFACES,
    HitArrays,
    closest,
    closest_of_few,
    cross,
    describe,
    empty_hits,
    empty_primitives,
    no_primitives,
)


class FirstHits:
    """Traces the first hits of the n rays of a query, which may be divided into blocks."""

    def __init__(self, scene: SceneTables, n: int, surfaces: bool) -> None:
        self._scene, self._is_few = scene, n <= FEW
        self._described = SURFACES if surfaces else IDS
        traversal = ONE_BY_ONE if self._is_few else BLOCKS
        self._linked = link_to_geometry(scene, *traversal, *self._described)

    def trace(
        self,
        o: FloatArray,
        d: FloatArray,
        t_min: FloatArray | None,
        t_max: FloatArray,
        out: HitArrays,
        rows: bool = False,
    ) -> Primitives:
        """First hits at t_min < t < t_max, into `out`; with `rows` (or few rays) also as
        primitives."""
        geometry, found = self._linked.tables, empty_primitives(0)
        if self._is_few:
            found = empty_primitives(len(o))
            closest_of_few(geometry, o, d, found)
            describe(geometry, o, d, EVERY_RAY, t_max, found, out)
        elif rows:
            found = trace_in_ray_order(geometry, o, d, t_max, out)
        else:
            buffer = empty_primitives(MOST_ADDED), np.empty(MOST_ADDED, np.int64)
            closest(geometry, o, d, t_max, *buffer, out)
        if t_min is not None:
            again = np.flatnonzero(out.t <= t_min)
            if len(again) > 0:
                limits = np.full(len(o), math.inf) if t_max is NO_LIMIT else t_max
                rays = o[again], d[again], t_min[again], limits[again]
                crossed = link_to_geometry(self._scene, *CROSSING, *self._described)
                _replace(crossed, rays, again, found, out)
        return found


def trace_in_ray_order(
    geometry: Any, o: FloatArray, d: FloatArray, t_max: FloatArray, out: HitArrays
) -> Primitives:
    """First hits by `closest`, into `out`; also as primitives, in the order of the rays."""
    size = len(o) + MOST_ADDED
    unordered, numbers = empty_primitives(size), np.empty(size, np.int64)
    count = closest(geometry, o, d, t_max, unordered, numbers, out)
    found = no_primitives(len(o))
    for ordered, values in zip(found, unordered, strict=True):
        ordered[numbers[:count]] = values[:count]
    return found


def _replace(
    crossed: Linked,
    rays: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    which: IntArray,
    found: Primitives,
    out: HitArrays,
) -> None:
    """Replaces the hits `which` by the first crossings of rays (o, d, t_min, t_max)."""
    beyond = first_beyond(crossed, *rays)
    hits = empty_hits(len(which), len(out.p) > 0)
    describe(crossed.tables, rays[0], rays[1], EVERY_RAY, rays[3], beyond, hits)
    pairs: Iterable[tuple[Any, Any]] = zip((*found, *out), (*beyond, *hits), strict=True)
    for whole, part in pairs:
        if len(whole) > 0:
            whole[which] = part


def first_beyond(
    crossed: Linked, o: FloatArray, d: FloatArray, t_min: FloatArray, t_max: FloatArray
) -> Primitives:
    """The first crossing of each ray at t_min < t < t_max.  crossed: the geometry with the
    operations `CROSSING`."""
    n = len(o)
    met, rays, counts = empty_primitives(n), np.empty(n, np.int64), np.empty(n, np.int64)
    cross(crossed.tables, o, d, t_min, t_max, 0, 1, counts, rays, met)
    m = int(counts.sum())
    found = no_primitives(n)
    for whole, part in zip(found, met, strict=True):
        whole[rays[:m]] = part[:m]
    return found
