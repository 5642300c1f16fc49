"""All crossings along rays, in order."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.accel.geometry import Geometry
from reference_rt.accel.next_crossing import crossings_of_solid
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import row
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.kept_links import link_to_geometry
from reference_rt.rendering.query.hits import Intersections
from reference_rt.rendering.query.rays import checked_rays, in_blocks, rays_of
from reference_rt.rendering.query.tracing import (
    CROSSING,
    NO_LIMIT,
    SURFACES,
    HitArrays,
    cross,
    describe,
    empty_hits,
    empty_primitives,
    rows_of,
)


@dataclass(frozen=True)
class Crossings(Intersections):
    """All m crossings of n rays, sorted by ray and along each ray (CSR layout).

    first (n + 1,): ray i has the crossings first[i] to first[i + 1] - 1;  ray (m,): the ray of each
    crossing.  The other arrays are those of `Intersections`, one entry per crossing.
    """

    first: IntArray
    ray: IntArray

    @property
    def count(self) -> IntArray:
        """How many crossings each ray has (n,)."""
        return np.diff(self.first)


EXPECTED = 4
"""Initial capacity of the buffers, in crossings per ray."""


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

    The first crossing is the hit of `intersect`.  A ray from outside crosses a closed surface an
    even number of times; where it touches a curved one, both crossings have the same t.  A CSG
    solid is crossed at its own surface, not at those of its operands.  Coincident surfaces of
    several shapes are all reported.  Rays as for `intersect`; in arrays other than (n, 3), rays are
    numbered along the rows.  Raises ValueError.
    """
    rays = rays_of(origins, directions, t_min, t_max)
    n = len(rays.o)
    starts = np.zeros(n) if rays.t_min is None else rays.t_min
    ends = np.full(n, math.inf) if rays.t_max is None else rays.t_max
    counts = np.zeros(n, np.int64)
    crossed = link_to_geometry(scene, *CROSSING, *SURFACES)
    parts: dict[int, list[tuple[IntArray, HitArrays]]] = {}

    def trace(k: slice) -> None:
        arguments = crossed.tables, rays.o[k], rays.d[k], starts[k], ends[k]
        n, begin = len(counts[k]), 0
        found: list[tuple[IntArray, HitArrays]] = []
        room = EXPECTED * n
        while begin < n:
            which, met = np.empty(room, np.int64), empty_primitives(room)
            end = cross(*arguments, begin, np.iinfo(np.int64).max, counts[k], which, met)
            filled = int(counts[k][begin:end].sum())
            hits = empty_hits(filled, surfaces=True)
            describe(*arguments[:3], which[:filled], NO_LIMIT, rows_of(met, slice(filled)), hits)
            found.append((which[:filled] + k.start, hits))
            if end == begin:  # a single ray has more crossings than fit
                room *= 2
            begin = end
        parts[k.start] = found

    in_blocks(trace, n, threads, least=1 << 10)
    found = [part for start in sorted(parts) for part in parts[start]]
    empty = [(np.empty(0, np.int64), empty_hits(0, surfaces=True))]
    which, hits = zip(*(found or empty), strict=True)
    columns: list[Any] = [np.concatenate(column) for column in zip(*hits, strict=True)]
    columns += [np.concatenate([[0], np.cumsum(counts)]), np.concatenate(which)]
    return Crossings(*columns)


# All crossings of one solid, with error bounds: for tests of its laws.

SOLIDS = ("crossings_of_solid",)
"""The operation on the geometry."""


@dataclass(frozen=True)
class SolidCrossings:
    """The crossings of n rays with the surface of a solid, in order, at all t > 0.

    t (n, k): inf where there are fewer than k;  width (n, k): error bound of t: crossings closer
    than the sum of their widths are merged, so that material or a gap between them is not reported;
    part (n, k): number of the operand whose surface is crossed;  count (n,): number of crossings.
    """

    t: FloatArray
    width: FloatArray
    part: IntArray
    count: IntArray


@entry_kernel
def crossings_kernel(
    geometry: Geometry,
    solid: int,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    widths: FloatArray,
    part: IntArray,
    count: IntArray,
) -> None:
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        count[i] = crossings_of_solid(geometry, solid, ray, t[i], widths[i], part[i])


def solid_crossings(
    scene: SceneTables,
    solid: int,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    most: int = 64,
) -> SolidCrossings:
    """All crossings of each ray with solid number `solid`, in the scene's order of solids.  At most
    `most` per ray are returned; `count` counts all."""
    solids = scene.geometry.solids
    if solids is None or not 0 <= solid < len(solids.first):
        known = 0 if solids is None else len(solids.first)
        raise ValueError(f"there is no solid {solid}; expected one of the scene's {known}")
    o, d = checked_rays(origins, directions)
    t, widths = np.full((2, len(o), most), math.inf)
    part = np.full((len(o), most), -1)
    count = np.zeros(len(o), np.int64)
    crossed = link_to_geometry(scene, *SOLIDS)
    with np.errstate(all="ignore"):
        crossings_kernel(crossed.tables, solid, o, d, t, widths, part, count)
    return SolidCrossings(t, widths, part, count)
