"""Rays and pictures out of a Mitsuba scene, as float64 NumPy arrays, in any variant.

llvm and cuda variants take all rays at once; scalar variants take one at a time: the functions that
are passed to `for_rays` are written once for both.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.mitsuba_backend import mitsuba
from reference_rt.query import Intersections
from reference_rt.shapes.shape import FloatArray, IntArray

_SHAPE = "shape_"
_LIGHT = "light_"


def shape_id(i: int) -> str:
    """Mitsuba's id of our shape i."""
    return f"{_SHAPE}{i}"


def shape_index(name: str) -> int:
    """Our index of Mitsuba's shape."""
    return int(name.removeprefix(_SHAPE))


def light_id(i: int) -> str:
    """Mitsuba's id of entry i of our scene's lights."""
    return f"{_LIGHT}{i}"


class SensorRays(NamedTuple):
    """Origins and unit directions (n, 3)."""

    o: FloatArray
    d: FloatArray


class Replicates(NamedTuple):
    """Independent pictures (replicates, height, width, 3), row 0 on top, and the wall-clock seconds
    (replicates,) of each."""

    pictures: FloatArray
    seconds: FloatArray


def for_rays(
    function: Callable[..., tuple[Any, ...]], *columns: npt.NDArray[Any]
) -> tuple[npt.NDArray[Any], ...]:
    """`function` of Mitsuba values, applied to arrays: (n, 3) become Vector3f, (n,) Float.

    What it returns, a tuple of Mitsuba numbers and vectors, comes back as arrays (n,) and (n, k).
    """
    mi = mitsuba()
    n = len(columns[0])
    if mi.variant().startswith("scalar"):
        rows = [
            [_scalar_result(x) for x in function(*arguments)]
            for arguments in zip(*(_scalars(mi, c) for c in columns), strict=True)
        ]
        return tuple(np.array(column) for column in zip(*rows, strict=True))
    wide = (mi.Vector3f(_float32(c).T) if c.ndim == 2 else mi.Float(_float32(c)) for c in columns)
    return tuple(_array(result, n) for result in function(*wide))


def _float32(column: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    return np.ascontiguousarray(column, dtype=np.float32)


def _scalars(mi: Any, column: npt.NDArray[Any]) -> list[Any]:
    rows = column.tolist()
    return [mi.Vector3f(row) for row in rows] if column.ndim == 2 else rows


def _scalar_result(value: Any) -> Any:
    return value if isinstance(value, bool | int | float) else list(value)


def _array(value: Any, n: int) -> npt.NDArray[Any]:
    """(n,) or (n, k); what does not depend on the ray is repeated."""
    array = np.array(value)
    if array.dtype == np.float32:
        array = array.astype(np.float64)
    return np.broadcast_to(array, (*array.shape[:-1], n)).T.copy()


def sensor_rays(mi_scene: Any, x: FloatArray, y: FloatArray) -> SensorRays:
    """The rays of the scene's sensor through film points, in pixels from the top left corner.

    Origins lie on the near plane.
    """
    mi = mitsuba()
    sensor = mi_scene.sensors()[0]
    width, height = (int(s) for s in sensor.film().crop_size())

    def ray(u: Any, v: Any) -> tuple[Any, ...]:
        found, _ = sensor.sample_ray_differential(0.0, 0.5, mi.Point2f(u, v), mi.Point2f(0.5, 0.5))
        return found.o, found.d

    return SensorRays(*for_rays(ray, x / width, y / height))


def trace(mi_scene: Any, o: FloatArray, d: FloatArray) -> Intersections:
    """What Mitsuba hits first, in the same record as `reference_rt.query.intersect` returns.

    `face` is Mitsuba's prim_index: a triangle's number in its mesh, of no meaning elsewhere.
    Mitsuba sees the rays rounded to float32.
    """
    mi = mitsuba()
    number = _shape_numbers(mi_scene)

    def hit(origin: Any, direction: Any) -> tuple[Any, ...]:
        si = mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(origin), direction))
        return si.t, number(si), si.prim_index, si.p, si.n, si.sh_frame.n, si.uv

    t, shape, face, p, n, ns, uv = for_rays(hit, o, d)
    shape = _decode_shapes(mi_scene, shape)
    missed = shape < 0
    for array in (face, p, n, ns, uv):
        array[missed] = 0
    return Intersections(
        t=np.where(missed, np.inf, t),
        shape=shape,
        face=np.where(missed, -1, face.astype(np.int64)),
        p=p,
        n=n,
        ns=ns,
        uv=uv,
    )


def _shape_numbers(mi_scene: Any) -> Callable[[Any], Any]:
    """How to tell the shape of a hit: its index in scalar variants, its registry id otherwise."""
    mi = mitsuba()
    if mi.variant().startswith("scalar"):
        return lambda si: -1 if si.shape is None else shape_index(si.shape.id())
    import drjit as dr

    return lambda si: dr.reinterpret_array(mi.UInt32, si.shape)


def _decode_shapes(mi_scene: Any, numbers: npt.NDArray[Any]) -> IntArray:
    mi = mitsuba()
    if mi.variant().startswith("scalar"):
        return numbers.astype(np.int64)
    import drjit as dr

    registered = np.array(dr.reinterpret_array(mi.UInt32, mi_scene.shapes_dr()))
    ours = np.full(int(max(registered, default=0)) + 1, -1)  # 0 is Mitsuba's "no shape"
    for registry_id, shape in zip(registered, mi_scene.shapes(), strict=True):
        ours[registry_id] = shape_index(shape.id())
    return np.asarray(ours[numbers])


def render(mi_scene: Any, replicates: int, spp: int, seed: int = 0) -> Replicates:
    """Pictures with the seeds seed, seed + 1, ...

    A small picture goes before and is thrown away: it compiles the kernels, which a run time must
    not count.
    """
    mi = mitsuba()
    pictures, seconds = [], []
    if not mi.variant().startswith("scalar"):
        # Dr.Jit divides by powers of two in another way: those are kernels of their own.
        alike = 1 if spp & (spp - 1) == 0 else 3
        np.array(mi.render(mi_scene, spp=alike, seed=seed + replicates))
    for k in range(replicates):
        start = time.perf_counter()
        # The array is what forces the lazy rendering to happen.
        pictures.append(np.array(mi.render(mi_scene, spp=spp, seed=seed + k), dtype=np.float64))
        seconds.append(time.perf_counter() - start)
    return Replicates(np.stack(pictures)[..., :3], np.array(seconds))


__all__ = [
    "Replicates",
    "SensorRays",
    "for_rays",
    "light_id",
    "render",
    "sensor_rays",
    "shape_id",
    "shape_index",
    "trace",
]
