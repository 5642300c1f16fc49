"""All crossings of rays with the scene's surfaces."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.core.arrays import IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.query.hits import Intersections
from reference_rt.rendering.query.rays import in_blocks, rays_of
from reference_rt.rendering.query.tracing import (
    NO_LIMIT,
    Answers,
    cross,
    describe,
    no_answers,
    no_primitives,
    part_of,
)


@dataclass(frozen=True)
class Crossings(Intersections):
    """All crossings of n rays, m in all, one ray after another, each ray's in order.

    first (n + 1,): those of ray i are number first[i] to first[i + 1] - 1;  ray (m,): number of
    each crossing's ray.  The other arrays are those of `Intersections`, one entry a crossing.
    """

    first: IntArray
    ray: IntArray

    @property
    def count(self) -> IntArray:
        """How many crossings each ray has (n,)."""
        return np.diff(self.first)


EXPECTED = 4
"""Crossings of a ray that there is room for at first."""


def crossings(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = math.inf,
    threads: int | None = None,
) -> Crossings:
    """Every crossing of each ray with the surfaces of all shapes at t_min < t < t_max, in order of
    t and, at the same t, in the order of the scene.

    The first is what `intersect` finds.  A closed surface is crossed an even number of times from
    outside; where a ray touches a curved one, both crossings have the same t.  Of a solid those of
    its own surface are told, not those of its operands; surfaces of several shapes that coincide
    are all told.  Rays as for `intersect`; of arrays that are not (n, 3), rays are counted along
    the rows.  Raises ValueError.
    """
    rays = rays_of(origins, directions, t_min, t_max)
    n = len(rays.o)
    starts = np.zeros(n) if rays.t_min is None else rays.t_min
    ends = np.full(n, math.inf) if rays.t_max is None else rays.t_max
    counts = np.zeros(n, np.int64)
    parts: dict[int, list[tuple[IntArray, Answers]]] = {}

    def trace(k: slice) -> None:
        arguments = scene.geometry, rays.o[k], rays.d[k], starts[k], ends[k]
        n, begin = len(counts[k]), 0
        found: list[tuple[IntArray, Answers]] = []
        room = EXPECTED * n
        while begin < n:
            which, met = np.empty(room, np.int64), no_primitives(room)
            end = cross(*arguments, begin, np.iinfo(np.int64).max, counts[k], which, met)
            filled = int(counts[k][begin:end].sum())
            answers = no_answers(filled, surfaces=True)
            describe(*arguments[:3], which[:filled], NO_LIMIT, part_of(met, slice(filled)), answers)
            found.append((which[:filled] + k.start, answers))
            if end == begin:  # a single ray has more
                room *= 2
            begin = end
        parts[k.start] = found

    in_blocks(trace, n, threads, least=1 << 10)
    found = [part for start in sorted(parts) for part in parts[start]]
    empty = [(np.empty(0, np.int64), no_answers(0, surfaces=True))]
    which, answers = zip(*(found or empty), strict=True)
    columns: list[Any] = [np.concatenate(column) for column in zip(*answers, strict=True)]
    columns += [np.concatenate([[0], np.cumsum(counts)]), np.concatenate(which)]
    return Crossings(*columns)
