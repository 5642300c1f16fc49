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
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.geometry import Geometry, closest_hit, owner, surface
from reference_rt.integrators import radiance as radiance_along
from reference_rt.integrators.integrator import direct
from reference_rt.kernel import entry_kernel, local_floats
from reference_rt.materials import kept_floats
from reference_rt.ray import Ray
from reference_rt.ray_arrays import closest_of_rays, occluded_rays
from reference_rt.sampling.grid import GridSample
from reference_rt.scaled_ray import is_told, scaled
from reference_rt.shading import shade
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.tables import SceneTables
from reference_rt.vec3 import Vec3, row


@dataclass(frozen=True)
class Intersections:
    """What n rays hit first.

    t (n,): inf for a miss;  shape (n,): index in the scene's shapes, -1 for a miss;  primitive
    (n,): number of the triangle in its mesh, among all that the file has, those that are left out
    too (see `MeshData`), or of the face of a solid (of a box: axis, + 3 on the positive side);
    part (n,): number of the operand in its solid, or of the shape in its group;  instance (n,):
    number of the copy that the shape stands for, -1 outside groups;
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


# Three kernels take the geometry alone: scenes of other materials and lights share them.
@entry_kernel
def _intersect(geometry: Geometry, o: FloatArray, d: FloatArray, out: FloatArray) -> None:
    for i in range(len(o)):
        out[i, 0] = math.inf
        for k in range(1, 5):
            out[i, k] = -1.0
        ray, unit, valid = scaled(row(o, i), row(d, i), math.inf)
        if not valid:
            continue
        hit = closest_hit(geometry, ray)
        if hit.kind < 0:
            continue
        point = surface(geometry, ray, hit)
        if not is_told(hit.t * unit, point.p):
            continue
        whose = owner(geometry, ray, hit)
        out[i, 0], out[i, 1], out[i, 2] = hit.t * unit, whose.shape, whose.face
        out[i, 3], out[i, 4] = whose.part, whose.instance
        out[i, 5], out[i, 6], out[i, 7] = point.p
        out[i, 8], out[i, 9], out[i, 10] = point.n
        out[i, 11], out[i, 12], out[i, 13] = point.ns
        out[i, 14], out[i, 15] = whose.u, whose.v


@entry_kernel
def _closest(
    geometry: Geometry,
    o: FloatArray,
    d: FloatArray,
    t: FloatArray,
    kind: IntArray,
    rows: IntArray,
    uv: FloatArray,
) -> None:
    closest_of_rays(geometry, o, d, t, kind, rows, uv)


@entry_kernel
def _occluded(
    geometry: Geometry, o: FloatArray, d: FloatArray, t_max: FloatArray, out: npt.NDArray[np.bool_]
) -> None:
    occluded_rays(geometry, o, d, t_max, out)


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


def checked_rays(
    origins: npt.ArrayLike, directions: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Both as float64 arrays (n, 3)."""
    # Kernels are compiled for writable arrays: those that are so already are not copied.
    o, d = (np.require(a, np.float64, ("C", "A", "W")) for a in (origins, directions))
    if o.shape != d.shape or o.ndim != 2 or o.shape[1] != 3:
        raise ValueError(f"expected two (n, 3) arrays, got {o.shape} and {d.shape}")
    return o, d


def intersect(
    scene: SceneTables, origins: npt.ArrayLike, directions: npt.ArrayLike
) -> Intersections:
    """The closest hit of each ray."""
    o, d = checked_rays(origins, directions)
    out = np.zeros((len(o), 16))
    with np.errstate(all="ignore"):
        _intersect(scene.geometry, o, d, out)
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
    o, d = checked_rays(origins, directions)
    n = len(o)
    found = Closest(np.empty(n), np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, 2)))
    t, kind, rows, uv = found.t, found.kind, found.row, found.uv

    def trace(k: slice) -> None:
        _closest(scene.geometry, o[k], d[k], t[k], kind[k], rows[k], uv[k])

    _in_blocks(trace, n, threads)
    return found


def occluded(
    scene: SceneTables,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_max: npt.ArrayLike = math.inf,
    threads: int | None = None,
) -> npt.NDArray[np.bool_]:
    """Whether anything lies on each ray at 0 < t < t_max (a number, or one for each ray); on
    `threads` threads (default: all cores)."""
    o, d = checked_rays(origins, directions)
    out = np.zeros(len(o), np.bool_)
    if np.ndim(t_max) == 0:
        t_max = np.full(len(o), t_max, np.float64)
    ends = np.require(t_max, np.float64, ("C", "A", "W"))
    if ends.shape != (len(o),):
        raise ValueError(f"t_max: expected a number or {len(o)} numbers, got {ends.shape}")

    def trace(k: slice) -> None:
        _occluded(scene.geometry, o[k], d[k], ends[k], out[k])

    _in_blocks(trace, len(o), threads)
    return out


_LEAST, _MOST = 1 << 12, 1 << 16
"""Rays that a thread takes at once.  To hand them over it has to wait for Python's lock: with 2^14
at once two threads took 43 ns of both together for a camera ray, with 2^16 and more 34, one thread
31 (measured, a million rays)."""


def _in_blocks(trace: Callable[[slice], None], n: int, threads: int | None) -> None:
    """`trace` of all of n rays, on threads: kernels release the GIL."""

    def run(k: slice) -> None:
        with np.errstate(all="ignore"):
            trace(k)

    threads = threads or os.cpu_count() or 1
    # Eight shares of each thread: then none waits long for another's last.
    size = min(max(n // (8 * threads), _LEAST), _MOST)
    blocks = [slice(k, min(k + size, n)) for k in range(0, n, size)]
    if len(blocks) < 2 or threads == 1:
        for k in blocks:
            run(k)
        return
    with ThreadPoolExecutor(threads) as pool:
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
    o, d = checked_rays(origins, directions)
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
    o, d = checked_rays(origins, directions)
    out = np.zeros((len(o), 3))
    with np.errstate(all="ignore"):
        _radiance(scene, integrator, o, d, out)
    return out
