"""First hits of arrays of rays: which kernels trace how many of them."""

import math
from typing import Any

import numpy as np

from reference_rt.accel.array_query import MOST_ADDED, Primitives
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.query.linked import Linked, link_to_geometry
from reference_rt.rendering.query.tracing import (
    BLOCKS,
    BUFFER,
    CROSSING,
    EVERY_RAY,
    FEW,
    NO_LIMIT,
    ONE_BY_ONE,
    HitArrays,
    closest,
    closest_of_few,
    cross,
    describe,
    empty_hits,
    empty_primitives,
)


class FirstHits:
    """Traces the first hits of the n rays of a query, which may be divided into blocks."""

    def __init__(self, scene: SceneTables, n: int) -> None:
        self._scene, self._is_few = scene, n <= FEW
        self._linked = link_to_geometry(scene, *(ONE_BY_ONE if self._is_few else BLOCKS))

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
            buffer = empty_primitives(BUFFER), np.empty(BUFFER, np.int64)
            closest(geometry, o, d, t_max, *buffer, out)
        if t_min is not None:
            again = np.flatnonzero(out.t <= t_min)
            if len(again) > 0:
                limits = np.full(len(o), math.inf) if t_max is NO_LIMIT else t_max
                rays = o[again], d[again], t_min[again], limits[again]
                _replace(self._scene, rays, again, found, out)
        return found


def trace_in_ray_order(
    geometry: Any, o: FloatArray, d: FloatArray, t_max: FloatArray, out: HitArrays
) -> Primitives:
    """First hits by `closest`, into `out`; also as primitives, in the order of the rays."""
    size = len(o) + MOST_ADDED
    unordered, numbers = empty_primitives(size), np.empty(size, np.int64)
    closest(geometry, o, d, t_max, unordered, numbers, out)
    found = empty_primitives(len(o))
    for ordered, values in zip(found, unordered, strict=True):
        ordered[numbers[: len(o)]] = values[: len(o)]
    return found


def _replace(
    scene: SceneTables,
    rays: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    which: IntArray,
    found: Primitives,
    out: HitArrays,
) -> None:
    """Replaces the hits `which` by the first crossings of rays (o, d, t_min, t_max)."""
    crossed = link_to_geometry(scene, *CROSSING)
    beyond = first_beyond(crossed, *rays)
    hits = empty_hits(len(which), len(out.p) > 0)
    describe(crossed.tables, rays[0], rays[1], EVERY_RAY, rays[3], beyond, hits)
    for whole, part in zip((*found, *out), (*beyond, *hits), strict=True):
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
    found = empty_primitives(n)
    found.codes[:] = -1
    for whole, part in zip(found, met, strict=True):
        whole[rays[:m]] = part[:m]
    return found
