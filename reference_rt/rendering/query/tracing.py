"""First hits and crossings of arrays of rays: the entry kernels, and which of them trace how many.

They take a geometry, or a link to one with the operations that are named here."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from reference_rt.accel.array_query import (
    MOST_ADDED,
    Primitives,
    TraceScratch,
    closest_one_by_one,
    packet_place,
    rows_width,
    trace_packet,
)
from reference_rt.accel.crossing_order import nothing_at
from reference_rt.accel.geometry import Geometry, coordinates, owner, surface
from reference_rt.accel.next_crossing import next_crossing
from reference_rt.accel.packet import PACKET_SIZE, TILE
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.core.ray import (
    BLOCK,
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    Hit,
    HitBlock,
    RayBlock,
    at,
    is_representable,
    scaled,
)
from reference_rt.core.vec3 import row
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel, kernel, local_floats, local_integers
from reference_rt.rendering.kept_links import Linked, link_to_geometry


class HitArrays(NamedTuple):
    """The arrays of `Intersections`, which kernels fill; p, n, ns and uv may be left empty."""

    t: FloatArray
    shape: IdArray
    primitive: IdArray
    part: IdArray
    instance: IdArray
    p: FloatArray
    n: FloatArray
    ns: FloatArray
    uv: FloatArray


def empty_hits(n: int, surfaces: bool) -> HitArrays:
    """Uninitialised arrays for n hits, with or without p, n, ns and uv."""
    m = n if surfaces else 0
    shape, primitive, part, instance = np.empty((4, n), np.int32)
    p, normal, ns = np.empty((3, m, 3))
    return HitArrays(np.empty(n), shape, primitive, part, instance, p, normal, ns, np.empty((m, 2)))


def empty_primitives(n: int) -> Primitives:
    """Uninitialised arrays for n hits."""
    return Primitives(np.empty(n), np.empty((n, 3), np.int64), np.empty((n, 2)))


def no_primitives(n: int) -> Primitives:
    """n misses."""
    return Primitives(np.full(n, math.inf), np.full((n, 3), -1), np.zeros((n, 2)))


def rows_of(arrays: Any, k: slice | IntArray) -> Any:
    """Rows k of each array of a NamedTuple; empty arrays stay empty."""
    return type(arrays)(*(a[k] if len(a) > 0 else a for a in arrays))


EVERY_RAY = np.empty(0, np.int64)
"""In place of ray numbers: hit i is of ray i."""

NO_LIMIT = np.empty(0)
"""In place of t_max for each ray: no limit."""


IDS = ("owner",)
"""The operations that describe hits without p, n, ns and uv."""

SURFACES = (*IDS, "surface", "coordinates")
"""Those that describe hits with them."""

BLOCKS = ("closest_hits", "closest_of_packet")
"""Those of `closest`, besides."""

ONE_BY_ONE = ("closest_hit",)
"""Those of `closest_of_few`."""

CROSSING = ("next_crossing",)
"""Those of `cross`."""


TOGETHER = 1 << 10
"""Misses that are written before rays are traced, where these are not in bands: a multiple of
PACKET_SIZE, few enough to stay in the cache until hits replace them."""


@entry_kernel
def closest(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    t_max: FloatArray,
    found: Primitives,
    numbers: IntArray,
    out: HitArrays,
) -> int:
    """First hits of rays, into `out`; returns how many of them are in `found`.

    found, numbers: buffers of at least MOST_ADDED entries for hits and their rays.  With len(o) +
    MOST_ADDED entries they keep all hits.  Hits are described while they are in the processor's
    cache: a separate pass over all of them took a third longer (measured).
    """
    work = TraceScratch(
        RayBlock(local_floats(RAY_FLOATS)),
        HitBlock(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS)),
        RayBlock(local_floats(RAY_FLOATS)),
        local_integers(BLOCK),
    )
    for k in range(RAY_FLOATS):
        work.rays.numbers[k] = 1.0  # lanes without a ray are traced too
    waiting, filled, written = 0, 0, 0
    n, width = len(o), rows_width(o, d)
    for k in range(0, n, PACKET_SIZE):
        begin, across = packet_place(k, n, width)
        if k == written:
            written = min(k + (TOGETHER if across == TILE else width * TILE), n)
            _put_misses(out, k, written)
        count = min(PACKET_SIZE, n - k)
        if filled > len(numbers) - MOST_ADDED:
            filled = 0
        first = filled
        waiting, filled = trace_packet(
            geometry,
            o,
            d,
            begin,
            across,
            count,
            k + PACKET_SIZE >= n,
            work,
            waiting,
            found,
            numbers,
            filled,
        )
        for i in range(first, filled):
            _describe(geometry, o, d, numbers[i], t_max, found, i, out, numbers[i])
    return filled


@entry_kernel
def closest_of_few(geometry: Geometry, o: FloatArray, d: FloatArray, found: Primitives) -> None:
    closest_one_by_one(geometry, o, d, found)


FEW = 1 << 12
"""Up to this many rays are traced one by one: `closest` has the same result some milliseconds
earlier, but what it calls takes longer to compile."""


@entry_kernel
def describe(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    rays: IntArray,
    t_max: FloatArray,
    found: Primitives,
    out: HitArrays,
) -> None:
    """Fill `out` from the hits `found`.  rays: number of each hit's ray, or `EVERY_RAY`;  t_max
    (len(o),) or `NO_LIMIT`."""
    for i in range(len(out.t)):
        r = rays[i] if len(rays) > 0 else i
        _put_miss(out, i)
        _describe(geometry, o, d, r, t_max, found, i, out, i)


@kernel
def hit_of(found: Primitives, k: int) -> Hit:
    """Hit number k."""
    codes = found.codes
    return Hit(found.t[k], codes[k, 0], codes[k, 1], found.uv[k, 0], found.uv[k, 1], codes[k, 2])


@kernel
def _describe(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    r: int,
    t_max: FloatArray,
    found: Primitives,
    k: int,
    out: HitArrays,
    i: int,
) -> None:
    """Write hit k, of ray r, to row i of `out`, which is a miss so far: the one place where
    internal codes become shape indices."""
    hit = hit_of(found, k)
    if hit.kind < 0:
        return
    ray, unit, _ = scaled(row(o, r), row(d, r), math.inf)
    t, p = hit.t * unit, at(ray, hit.t)
    if len(t_max) > 0 and not t < t_max[r]:
        return
    if len(out.p) == 0:
        if not is_representable(t, p):
            return
    else:
        point = surface(geometry, ray, hit)
        if not is_representable(t, point.p):
            return
        where = coordinates(geometry, ray, hit)
        out.p[i, 0], out.p[i, 1], out.p[i, 2] = point.p
        out.n[i, 0], out.n[i, 1], out.n[i, 2] = point.n
        out.ns[i, 0], out.ns[i, 1], out.ns[i, 2] = point.ns
        out.uv[i, 0], out.uv[i, 1] = where.u, where.v
    whose = owner(geometry, hit)
    out.t[i], out.shape[i], out.primitive[i] = t, whose.shape, whose.face
    out.part[i], out.instance[i] = whose.part, whose.instance


@kernel
def _put_misses(out: HitArrays, begin: int, end: int) -> None:
    """Rows begin to end, array after array: LLVM writes several rows at once."""
    for i in range(np.uint64(begin), np.uint64(end)):
        out.t[i] = math.inf
    for column in (out.shape, out.primitive, out.part, out.instance):
        for i in range(np.uint64(begin), np.uint64(end)):
            column[i] = -1
    if len(out.p) > 0:
        for i in range(begin, end):
            _put_miss(out, i)


@kernel
def _put_miss(out: HitArrays, i: int) -> None:
    out.t[i], out.shape[i], out.primitive[i] = math.inf, -1, -1
    out.part[i], out.instance[i] = -1, -1
    if len(out.p) > 0:
        out.p[i, 0], out.p[i, 1], out.p[i, 2] = 0.0, 0.0, 0.0
        out.n[i, 0], out.n[i, 1], out.n[i, 2] = 0.0, 0.0, 0.0
        out.ns[i, 0], out.ns[i, 1], out.ns[i, 2] = 0.0, 0.0, 0.0
        out.uv[i, 0], out.uv[i, 1] = 0.0, 0.0


@entry_kernel
def cross(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    t_min: FloatArray,
    t_max: FloatArray,
    begin: int,
    most: int,
    counts: IntArray,
    rays: IntArray,
    found: Primitives,
) -> int:
    """The crossings of the rays from number `begin` on, at t_min < t < t_max, at most `most` per
    ray.  counts (len(o),): crossings of each ray;  rays, found: ray and hit of each crossing, one
    ray after another, until the arrays are full.  Returns the number of the first ray that no
    longer fits."""
    filled = 0
    for i in range(begin, len(o)):
        first = filled
        counts[i] = 0
        ray, unit, valid = scaled(row(o, i), row(d, i), t_max[i])
        if not valid:
            continue
        after = nothing_at(t_min[i] / unit)
        while filled - first < most:
            after = next_crossing(geometry, ray, after)
            hit, t = after.hit, after.hit.t * unit
            if hit.kind < 0 or not (t < t_max[i] and is_representable(t, at(ray, hit.t))):
                break
            if not t > t_min[i]:  # t_min / unit has underflowed
                continue
            if filled == len(rays):
                return i
            rays[filled], found.t[filled] = i, hit.t
            found.codes[filled, 0] = hit.kind
            found.codes[filled, 1] = hit.row
            found.codes[filled, 2] = hit.instance
            found.uv[filled, 0], found.uv[filled, 1] = hit.u, hit.v
            filled += 1
        counts[i] = filled - first
    return len(o)


# ---- which kernels trace how many rays -----------------------------------------------------------


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
