"""What rays meet first, and whether they meet anything."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.accel.array_query import occluded_rays
from reference_rt.accel.geometry import Geometry
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.query.rays import Rays, checked_rays, in_blocks, rays_of, shaped
from reference_rt.rendering.query.tracing import (
    NO_LIMIT,
    find,
    first_beyond,
    many,
    no_answers,
    no_primitives,
    part_of,
)

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Hits:
    """Which surfaces n rays meet.

    t (n,): inf for a miss;  shape (n,): index in the scene's shapes, -1 for a miss;  primitive
    (n,): number of the triangle in its mesh, counting those of the file that are left out too (see
    `MeshData`), or of the face of a solid (of a box: axis, + 3 on the positive side);  part (n,):
    number of the operand in its solid, or of the shape in its group;  instance (n,): number of the
    copy that the shape stands for, -1 outside groups.
    """

    t: FloatArray
    shape: IntArray
    primitive: IntArray
    part: IntArray
    instance: IntArray

    @property
    def hit(self) -> BoolArray:
        """Whether each ray meets anything (n,)."""
        return self.shape >= 0


@dataclass(frozen=True)
class Intersections(Hits):
    """Which surfaces n rays meet, and where.

    p, n, ns (n, 3): point, unit geometric and shading normal, 0 for a miss;  uv (n, 2): the surface
    coordinates.  n points outwards, or to where a mesh's winding says; it is not turned towards the
    ray.
    """

    p: FloatArray
    n: FloatArray
    ns: FloatArray
    uv: FloatArray


@entry_kernel
def _occluded(
    geometry: Geometry, o: FloatArray, d: FloatArray, t_max: FloatArray, out: BoolArray
) -> None:
    occluded_rays(geometry, o, d, t_max, out)


def _trace(scene: SceneTables, rays: Rays, threads: int | None, surfaces: bool) -> list[Any]:
    """The columns of `Answers`, as the rays were shaped."""
    low, high, n = rays.t_min, rays.t_max, len(rays.o)
    out = no_answers(n, surfaces)

    def trace(k: slice) -> None:
        find(
            scene.geometry,
            rays.o[k],
            rays.d[k],
            None if low is None else low[k],
            NO_LIMIT if high is None else high[k],
            part_of(out, k),
            n,
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
    """What each ray meets first at t_min < t < t_max, and where.

    Origins and directions (..., 3) broadcast: one origin serves many directions, and a single ray
    gives numbers and (3,) vectors.  t_min >= 0 and t_max: numbers, or one for each ray, in units of
    |d|.  On `threads` threads (default: all cores); their number changes no bit.  Raises ValueError
    for arrays of other shapes, and for what is not numbers.

    With t_min > 0 every surface in between counts as not there, to the last bit of t: the next
    crossing of the same shape is found, no ray is moved.
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

    def trace(k: slice) -> None:
        o, d, end = rays.o[k], rays.d[k], ends[k]
        _occluded(scene.geometry, o, d, end, out[k])
        if low is not None:
            again = np.flatnonzero(out[k] & (low[k] > 0.0))
            found = first_beyond(scene.geometry, o[again], d[again], low[k][again], end[again])
            out[k][again] = found.codes[:, 0] >= 0

    in_blocks(trace, n, threads)
    return shaped(out, rays.shape)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Closest:
    """What n rays meet first, by the rows of internal tables: for tests of traversal.

    t (n,): inf for a miss;  kind, row (n,): the table of `SceneTables.geometry.shapes` by the code
    that `reference_rt.shapes` gives it, and the row in it, -1 for a miss;  uv (n, 2): the
    coordinates that the test itself found, of a triangle its barycentrics.
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
    found, out = no_primitives(len(o)), no_answers(len(o), surfaces=False)

    def trace(k: slice) -> None:
        met = many(scene.geometry, o[k], d[k], NO_LIMIT, part_of(out, k))
        for whole, part in zip(found, met, strict=True):
            whole[k] = part

    in_blocks(trace, len(o), threads)
    # What float64 has no numbers for is no hit.
    missed = out.shape < 0
    found.codes[missed], found.uv[missed] = -1, 0.0
    return Closest(out.t, found.codes[:, 0].copy(), found.codes[:, 1].copy(), found.uv)
