"""First hits of rays, and occlusion."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.accel.array_query import occluded_one_by_one, occluded_rays
from reference_rt.accel.geometry import Geometry
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.kept_links import link_to_geometry
from reference_rt.rendering.query.rays import Rays, checked_rays, in_blocks, rays_of, shaped
from reference_rt.rendering.query.tracing import (
    BLOCKS,
    CROSSING,
    FEW,
    IDS,
    NO_LIMIT,
    FirstHits,
    empty_hits,
    empty_primitives,
    first_beyond,
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
