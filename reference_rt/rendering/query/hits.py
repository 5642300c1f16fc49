"""First hits of rays, occlusion, and all crossings along a ray."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.accel.array_query import occluded_one_by_one, occluded_rays
from reference_rt.accel.geometry import Geometry
from reference_rt.accel.next_crossing import crossings_of_solid
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.core.ray import Ray
from reference_rt.core.vec3 import row
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.query.rays import Rays, checked_rays, in_blocks, rays_of, shaped
from reference_rt.rendering.query.tracing import (
    BLOCKS,
    CROSSING,
    FEW,
    IDS,
    NO_LIMIT,
    SURFACES,
    FirstHits,
    HitArrays,
    cross,
    describe,
    empty_hits,
    empty_primitives,
    first_beyond,
    link_to_geometry,
    rows_of,
    trace_in_ray_order,
)
from reference_rt.util.errors import Brief

BoolArray = npt.NDArray[np.bool_]

OCCLUDED, OCCLUDED_BY_BLOCKS = ("occluded",), ("any_hits",)
"""The operations of `occluded_of_few` and of `occluded_by_blocks`."""


@dataclass(frozen=True)
class Hits(metaclass=Brief):
    """The surfaces that n rays hit.

    t (n,): inf for a miss;  shape (n,): index in the scene's shapes, -1 for a miss;  primitive
    (n,): number of the triangle in its mesh file, counting triangles that the reader drops (see
    `MeshData`), or of the face of a shape (box: axis, + 3 on the positive side);  part (n,): number
    of the operand in its solid, or of the shape in its group, where the operands of a solid count
    one by one;  instance (n,): number of the group's copy, -1 outside groups.
    """

    t: FloatArray
    shape: IdArray
    primitive: IdArray
    part: IdArray
    instance: IdArray

    @property
    def hit(self) -> BoolArray:
        """Whether each ray hits anything (n,)."""
        return self.shape >= 0


@dataclass(frozen=True)
class Intersections(Hits):
    """The surfaces that n rays hit, and where.

    p, n, ns (n, 3): point, unit geometric normal and unit shading normal, 0 for a miss;  uv (n, 2):
    surface coordinates.  n points outwards, for a mesh by its winding; it is not flipped towards
    the ray.
    """

    p: FloatArray
    n: FloatArray
    ns: FloatArray
    uv: FloatArray


@entry_kernel
def occluded_by_blocks(
    geometry: Geometry, o: FloatArray, d: FloatArray, t_max: FloatArray, out: BoolArray
) -> None:
    occluded_rays(geometry, o, d, t_max, out)


@entry_kernel
def occluded_of_few(
    geometry: Geometry, o: FloatArray, d: FloatArray, t_max: FloatArray, out: BoolArray
) -> None:
    occluded_one_by_one(geometry, o, d, t_max, out)


def _trace(scene: SceneTables, rays: Rays, threads: int | None, surfaces: bool) -> list[Any]:
    """The columns of `HitArrays`, in the shape of the given rays."""
    low, high, n = rays.t_min, rays.t_max, len(rays.o)
    out, query = empty_hits(n, surfaces), FirstHits(scene, n, surfaces)

    def trace(k: slice) -> None:
        query.trace(
            rays.o[k],
            rays.d[k],
            None if low is None else low[k],
            NO_LIMIT if high is None else high[k],
            rows_of(out, k),
        )

    in_blocks(trace, n, threads)
    return [shaped(column, rays.shape) for column in (out if surfaces else out[:5])]


def intersect(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = math.inf,
    threads: int | None = None,
) -> Intersections:
    """The first hit of each ray at t_min < t < t_max, with points, normals and uv.

    Origins and directions (..., 3) broadcast: one origin serves many directions, and a single ray
    gives numbers and (3,) vectors.  t_min >= 0 and t_max: numbers, or one for each ray, in units of
    |d|.  threads: default all cores; their number changes no bit.  Raises ValueError for arrays of
    other shapes, and for arrays that are not numeric.

    t_min is exact to the last bit of t: origins are not moved, and all crossings at t <= t_min are
    skipped, so that the same shape may be hit further along.
    """
    rays = rays_of(origins, directions, t_min, t_max)
    return Intersections(*_trace(scene, rays, threads, surfaces=True))


def first_hits(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_min: npt.ArrayLike = 0.0,
    t_max: npt.ArrayLike = math.inf,
    threads: int | None = None,
) -> Hits:
    """`intersect` without points, normals and uv, in less time."""
    rays = rays_of(origins, directions, t_min, t_max)
    return Hits(*_trace(scene, rays, threads, surfaces=False))


def occluded(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_max: npt.ArrayLike = math.inf,
    threads: int | None = None,
    t_min: npt.ArrayLike = 0.0,
) -> BoolArray:
    """Whether anything lies on each ray at t_min < t < t_max: see `intersect`."""
    rays = rays_of(origins, directions, t_min, t_max)
    low, high, n = rays.t_min, rays.t_max, len(rays.o)
    ends = np.full(n, math.inf) if high is None else high
    out = np.zeros(n, np.bool_)
    few = n <= FEW
    kernel = occluded_of_few if few else occluded_by_blocks
    found = link_to_geometry(scene, *(OCCLUDED if few else OCCLUDED_BY_BLOCKS))

    def trace(k: slice) -> None:
        o, d, end = rays.o[k], rays.d[k], ends[k]
        kernel(found.tables, o, d, end, out[k])
        if low is not None:
            again = np.flatnonzero(out[k] & (low[k] > 0.0))
            crossed = link_to_geometry(scene, *CROSSING)
            beyond = first_beyond(crossed, o[again], d[again], low[k][again], end[again])
            out[k][again] = beyond.codes[:, 0] >= 0

    in_blocks(trace, n, threads)
    return shaped(out, rays.shape)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Closest(metaclass=Brief):
    """First hits of n rays as rows of internal tables: for tests of traversal.

    t (n,): inf for a miss;  kind, row (n,): code in `reference_rt.shapes` of the table in
    `SceneTables.geometry.shapes`, and the row in it, -1 for a miss;  uv (n, 2): the coordinates
    that the intersection test computes, for triangles barycentrics.
    """

    t: FloatArray
    kind: IntArray
    row: IntArray
    uv: FloatArray


def closest_primitives(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    threads: int | None = None,
) -> Closest:
    """See `Closest`."""
    o, d = checked_rays(origins, directions)
    found, out = empty_primitives(len(o)), empty_hits(len(o), surfaces=False)
    traced = link_to_geometry(scene, *BLOCKS, *IDS)

    def trace(k: slice) -> None:
        met = trace_in_ray_order(traced.tables, o[k], d[k], NO_LIMIT, rows_of(out, k))
        for whole, part in zip(found, met, strict=True):
            whole[k] = part

    in_blocks(trace, len(o), threads)
    # A hit beyond the range of float64 is a miss.
    missed = out.shape < 0
    found.codes[missed], found.uv[missed] = -1, 0.0
    return Closest(out.t, found.codes[:, 0].copy(), found.codes[:, 1].copy(), found.uv)


# ---- all crossings, in order along each ray ------------------------------------------------------


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


# ---- all crossings of one solid, with error bounds: for tests of its laws ------------------------

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
