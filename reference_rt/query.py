"""The tracer as an oracle on arrays of rays: intersections, occlusion, light, radiance.

All arrays are float64 or int64; origins and directions are (n, 3) in world coordinates and scene
units; directions need not have unit length: t counts in units of |d|.  A ray of which a number is
not finite, or whose direction is 0, meets nothing; neither does one that would at a point, or a t,
beyond float64's range.
"""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.csg.evaluate import crossings as solid_crossings
from reference_rt.geometry import Geometry, closest_hit, owner, surface
from reference_rt.geometry import occluded as is_occluded
from reference_rt.integrators import radiance as radiance_along
from reference_rt.integrators.integrator import direct
from reference_rt.kernel import entry_kernel, kernel, local_floats
from reference_rt.materials import kept_floats
from reference_rt.ray import Ray, at
from reference_rt.sampling.grid import GridSample
from reference_rt.shading import shade
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.tables import SceneTables
from reference_rt.vec3 import Vec3, is_finite, max_abs, row


@dataclass(frozen=True)
class Intersections:
    """What n rays hit first.

    t (n,): inf for a miss;  shape (n,): index in the scene's shapes, -1 for a miss;  primitive
    (n,): number of the triangle in its mesh, or of the face of a solid (of a box: axis, + 3 on the
    positive side);  part (n,): number of the operand in its solid, or of the shape in its group;
    instance (n,): number of the copy that the shape stands for, -1 outside groups;
    p, n, ns (n, 3): point, unit geometric and shading normal, 0 for a miss;  uv (n, 2).
    """

    t: FloatArray
    shape: IntArray
    primitive: IntArray
    part: IntArray
    instance: IntArray
    p: FloatArray
    n: FloatArray
    ns: FloatArray
    uv: FloatArray


@dataclass(frozen=True)
class SolidCrossings:
    """Where n rays go in and out of a solid, in order, over all t > 0.

    t (n, k): inf where there are fewer than k;  width (n, k): how far rounding may have moved t:
    crossings closer together than the sum of theirs are passed at once, and what is between them,
    material or gap, is not told;  part (n, k): number of the operand that shows;  count (n,).
    """

    t: FloatArray
    width: FloatArray
    part: IntArray
    count: IntArray


@dataclass(frozen=True)
class Closest:
    """Where n rays hit first, without what is known of the surface there.

    t (n,): inf for a miss;  kind, row (n,): the table of `SceneTables.geometry.shapes` by the code
    that `reference_rt.shapes` gives it, and the row in it, -1 for a miss;  uv (n, 2): the
    coordinates that the test itself found, of a triangle its barycentrics.
    """

    t: FloatArray
    kind: IntArray
    row: IntArray
    uv: FloatArray


@dataclass(frozen=True)
class DirectLight:
    """Direct light of one light at what n rays hit first.

    target (n, 3): the point on the light, or the direction towards an environment;  pdf (n,): its
    density per solid angle, 1 for a point light, 0 where no light can arrive or nothing was hit;
    contribution (n, 3): f cos L (for a point light f cos I / r²), 0 in shadow.
    """

    target: FloatArray
    pdf: FloatArray
    contribution: FloatArray


class _Scaled(NamedTuple):
    """A ray whose direction is 1 / unit times as long as what was asked with, so that t counts in
    units `unit` times as large;  valid: whether it is a ray, of finite numbers and d != 0."""

    ray: Ray
    unit: float
    valid: bool


@kernel
def _scaled(o: Vec3, d: Vec3, t_max: float) -> _Scaled:
    """By a power of two, which changes no bit of what is computed: squares of directions that are
    very long or short would leave the range of float64."""
    unit, valid = 1.0, is_finite(o) and is_finite(d) and max_abs(d) > 0.0
    if valid and not _SHORT <= max_abs(d) <= 1.0 / _SHORT:
        _, exponent = math.frexp(max_abs(d))
        unit = math.ldexp(1.0, -min(max(exponent, -1000), 1000))
        d = d * unit
    return _Scaled(Ray(o, d, t_max / unit), unit, valid)


_SHORT = 2.0**-64
"""Of a direction: its square, and that of the same of an instance 2^400 times as large, are not 0.
What is neither shorter nor longer than the inverse is left alone."""


@kernel
def _is_told(t: float, p: Vec3) -> bool:
    """Whether float64 has numbers for a hit."""
    return 0.0 < t < math.inf and is_finite(p)


@entry_kernel
def _intersect(scene: SceneTables, o: FloatArray, d: FloatArray, out: FloatArray) -> None:
    for i in range(len(o)):
        out[i, 0] = math.inf
        for k in range(1, 5):
            out[i, k] = -1.0
        ray, unit, valid = _scaled(row(o, i), row(d, i), math.inf)
        if not valid:
            continue
        hit = closest_hit(scene.geometry, ray)
        if hit.kind < 0:
            continue
        point = surface(scene.geometry, ray, hit)
        if not _is_told(hit.t * unit, point.p):
            continue
        whose = owner(scene.geometry, ray, hit)
        out[i, 0], out[i, 1], out[i, 2] = hit.t * unit, whose.shape, whose.face
        out[i, 3], out[i, 4] = whose.part, whose.instance
        out[i, 5], out[i, 6], out[i, 7] = point.p
        out[i, 8], out[i, 9], out[i, 10] = point.n
        out[i, 11], out[i, 12], out[i, 13] = point.ns
        out[i, 14], out[i, 15] = whose.u, whose.v


@entry_kernel
def _closest(
    scene: SceneTables,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    kind: IntArray,
    rows: IntArray,
    uv: FloatArray,
) -> None:
    for i in range(len(o)):
        t[i], kind[i], rows[i], uv[i, 0], uv[i, 1] = math.inf, -1, -1, 0.0, 0.0
        ray, unit, valid = _scaled(row(o, i), row(d, i), math.inf)
        if not valid:
            continue
        hit = closest_hit(scene.geometry, ray)
        if hit.kind < 0 or not _is_told(hit.t * unit, at(ray, hit.t)):
            continue
        t[i], kind[i], rows[i] = hit.t * unit, hit.kind, hit.row
        uv[i, 0], uv[i, 1] = hit.u, hit.v


@entry_kernel
def _crossings(
    geometry: Geometry,
    solid: int,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    width: FloatArray,
    part: IntArray,
    count: IntArray,
) -> None:
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        count[i] = solid_crossings(
            geometry.solids, geometry.shapes, geometry.bvh, solid, ray, t[i], width[i], part[i]
        )


@entry_kernel
def _occluded(
    scene: SceneTables, o: FloatArray, d: FloatArray, t_max: FloatArray, out: npt.NDArray[np.bool_]
) -> None:
    for i in range(len(o)):
        ray, _, valid = _scaled(row(o, i), row(d, i), t_max[i])
        out[i] = valid and is_occluded(scene.geometry, ray)


@entry_kernel
def _direct(
    scene: SceneTables, o: FloatArray, d: FloatArray, k: int, u: float, v: float, out: FloatArray
) -> None:
    kept = local_floats(kept_floats(scene.materials))
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        hit = closest_hit(scene.geometry, ray)
        if hit.kind < 0:
            continue
        found = direct(scene, shade(scene, ray, hit, kept), k, u, v)
        out[i, 0], out[i, 1], out[i, 2] = found.light.target
        out[i, 3] = found.light.pdf
        out[i, 4], out[i, 5], out[i, 6] = found.contribution


@entry_kernel
def _radiance(
    scene: SceneTables, integrator: Any, o: FloatArray, d: FloatArray, out: FloatArray
) -> None:
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        arriving: Vec3 = radiance_along(integrator, scene, ray, GridSample(0.5, 0.5))
        out[i, 0], out[i, 1], out[i, 2] = arriving


def _rays(origins: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    # Kernels are compiled for writable arrays: those that are so already are not copied.
    o, d = (np.require(a, np.float64, ("C", "A", "W")) for a in (origins, directions))
    if o.shape != d.shape or o.ndim != 2 or o.shape[1] != 3:
        raise ValueError(f"expected two (n, 3) arrays, got {o.shape} and {d.shape}")
    return o, d


def intersect(
    scene: SceneTables, origins: npt.ArrayLike, directions: npt.ArrayLike
) -> Intersections:
    """The closest hit of each ray."""
    o, d = _rays(origins, directions)
    out = np.zeros((len(o), 16))
    with np.errstate(all="ignore"):
        _intersect(scene, o, d, out)
    shape, primitive, part, instance = out[:, 1:5].astype(np.int64).T
    return Intersections(
        t=out[:, 0],
        shape=shape,
        primitive=primitive,
        part=part,
        instance=instance,
        p=out[:, 5:8],
        n=out[:, 8:11],
        ns=out[:, 11:14],
        uv=out[:, 14:16],
    )


def closest(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    threads: int | None = None,
) -> Closest:
    """The closest hit of each ray and no more, on `threads` threads (default: all cores)."""
    o, d = _rays(origins, directions)
    n = len(o)
    found = Closest(np.empty(n), np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, 2)))
    t, kind, rows, uv = found.t, found.kind, found.row, found.uv

    def trace(k: slice) -> None:
        _closest(scene, o[k], d[k], t[k], kind[k], rows[k], uv[k])

    _in_blocks(trace, n, threads)
    return found


def crossings(
    scene: SceneTables,
    solid: int,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    most: int = 64,
) -> SolidCrossings:
    """All crossings of each ray with the solid of that number, in the scene's order; `most` of
    them, though `count` counts all."""
    solids = scene.geometry.solids
    if solids is None or not 0 <= solid < len(solids.first):
        known = 0 if solids is None else len(solids.first)
        raise ValueError(f"there is no solid {solid}; expected one of the scene's {known}")
    o, d = _rays(origins, directions)
    t, width = np.full((2, len(o), most), math.inf)
    part = np.full((len(o), most), -1)
    count = np.zeros(len(o), np.int64)
    with np.errstate(all="ignore"):
        _crossings(scene.geometry, solid, o, d, t, width, part, count)
    return SolidCrossings(t, width, part, count)


def occluded(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_max: npt.ArrayLike = math.inf,
    threads: int | None = None,
) -> npt.NDArray[np.bool_]:
    """Whether anything lies on each ray at 0 < t < t_max (a number, or one for each ray); on
    `threads` threads (default: all cores)."""
    o, d = _rays(origins, directions)
    out = np.zeros(len(o), np.bool_)
    ends = np.full(len(o), t_max, dtype=np.float64)

    def trace(k: slice) -> None:
        _occluded(scene, o[k], d[k], ends[k], out[k])

    _in_blocks(trace, len(o), threads)
    return out


_BLOCK = 1 << 14
"""Rays that a thread takes at once: some 10 ms, long against what handing them over costs."""


def _in_blocks(trace: Callable[[slice], None], n: int, threads: int | None) -> None:
    """`trace` of all of n rays, on threads: kernels release the GIL."""

    def run(k: slice) -> None:
        with np.errstate(all="ignore"):
            trace(k)

    blocks = [slice(k, min(k + _BLOCK, n)) for k in range(0, n, _BLOCK)]
    if len(blocks) < 2:
        for k in blocks:
            run(k)
        return
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        for _ in pool.map(run, blocks):
            pass


def direct_light(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    light: int,
    u: tuple[float, float] = (0.5, 0.5),
) -> DirectLight:
    """Light from entry `light` of `scene.lights.choice`, at its point that `u` picks."""
    o, d = _rays(origins, directions)
    choice = scene.lights.choice
    if choice is None or choice.probability[light] == 0.0:
        raise ValueError(f"light {light} cannot be sampled; expected one that can be picked")
    out = np.zeros((len(o), 7))
    with np.errstate(all="ignore"):
        _direct(scene, o, d, light, u[0], u[1], out)
    return DirectLight(target=out[:, 0:3], pdf=out[:, 3], contribution=out[:, 4:7])


def whitted_radiance(
    scene: SceneTables, integrator: Any, origins: npt.ArrayLike, directions: npt.ArrayLike
) -> FloatArray:
    """Radiance (n, 3) along unit rays by a deterministic integrator's `setup()`."""
    o, d = _rays(origins, directions)
    out = np.zeros((len(o), 3))
    with np.errstate(all="ignore"):
        _radiance(scene, integrator, o, d, out)
    return out
