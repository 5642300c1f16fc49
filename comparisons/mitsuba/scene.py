"""Hits and pictures from a Mitsuba scene, as float64 NumPy arrays, in any variant.

llvm and cuda variants process all rays at once, scalar variants one at a time: functions passed to
`for_rays` work for both.
"""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.mitsuba.backend import mitsuba
from comparisons.renderers import ReferenceSampler, Replicates
from reference_rt.core.arrays import FloatArray, IntArray

_SHAPE = "shape_"
_LIGHT = "light_"


def shape_id(i: int) -> str:
    """Mitsuba's id of our shape i."""
    return f"{_SHAPE}{i}"


def light_id(i: int) -> str:
    """Mitsuba's id of entry i of our scene's lights."""
    return f"{_LIGHT}{i}"


def for_rays(
    function: Callable[..., tuple[Any, ...]], *columns: npt.NDArray[Any]
) -> tuple[npt.NDArray[Any], ...]:
    """Apply a function of Mitsuba values to arrays: (n, 3) become Vector3f, (n,) Float.

    The tuple of Mitsuba numbers and vectors that it returns is converted to arrays (n,) and (n, k).
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
    # Unpacking takes a tenth of the time of `list(value)`.
    return value if isinstance(value, (bool, int, float, tuple)) else [*value]


def _array(value: Any, n: int) -> npt.NDArray[Any]:
    """(n,) or (n, k); values that do not depend on the ray are repeated."""
    array = np.array(value)
    if array.dtype == np.float32:
        array = array.astype(np.float64)
    return np.broadcast_to(array, (*array.shape[:-1], n)).T.copy()


class RawHits(NamedTuple):
    """Hits as Mitsuba returns them.

    t (n,): inf for a miss;  which (n,): number of the shape's id, -1 for a miss;  prim (n,):
    Mitsuba's prim_index;  p, n, ns (n, 3), uv (n, 2): 0 for a miss.
    """

    t: FloatArray
    which: IntArray
    prim: IntArray
    p: FloatArray
    n: FloatArray
    ns: FloatArray
    uv: FloatArray


def first_hits(mi_scene: Any, ids: Mapping[str, int], o: FloatArray, d: FloatArray) -> RawHits:
    """Mitsuba's first hits;  ids: the numbers of its shapes, by id; an instance has its own number.

    Mitsuba gets the rays rounded to float32.
    """
    mi = mitsuba()
    number = _shape_numbers(ids)
    scalar = mi.variant().startswith("scalar")

    def hit(origin: Any, direction: Any) -> tuple[Any, ...]:
        si = mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(origin), direction))
        if scalar and si.t == math.inf:
            return _MISS  # reading what a miss leaves unset takes half of its time
        return si.t, number(si), si.prim_index, si.p, si.n, si.sh_frame.n, si.uv

    t, number_found, prim, p, n, ns, uv = for_rays(hit, o, d)
    which = _decoded(mi_scene, ids, number_found)
    missed = which < 0
    for array in (prim, p, n, ns, uv):
        array[missed] = 0
    return RawHits(np.where(missed, np.inf, t), which, prim.astype(np.int64), p, n, ns, uv)


_NOTHING = (0.0, 0.0, 0.0)
_MISS = (math.inf, -1, 0, _NOTHING, _NOTHING, _NOTHING, _NOTHING[:2])
"""What `first_hits` reads of a miss, in scalar variants."""


def _shape_numbers(ids: Mapping[str, int]) -> Callable[[Any], Any]:
    """The function that gives the shape, or instance, of a hit: its number in scalar variants, its
    registry id otherwise."""
    mi = mitsuba()
    if mi.variant().startswith("scalar"):

        def number(hit: Any) -> int:
            met = hit.shape if hit.instance is None else hit.instance
            return -1 if met is None else ids[met.id()]

        return number
    import drjit as dr

    def registry_id(hit: Any) -> Any:
        shape = dr.reinterpret_array(mi.UInt32, hit.shape)
        instance = dr.reinterpret_array(mi.UInt32, hit.instance)
        return dr.select(instance != 0, instance, shape)

    return registry_id


def _decoded(mi_scene: Any, ids: Mapping[str, int], numbers: npt.NDArray[Any]) -> IntArray:
    mi = mitsuba()
    if mi.variant().startswith("scalar"):
        return numbers.astype(np.int64)
    import drjit as dr

    registered = np.array(dr.reinterpret_array(mi.UInt32, mi_scene.shapes_dr()))
    ours = np.full(int(max(registered, default=0)) + 1, -1)  # 0 is Mitsuba's "no shape"
    for registry_id, shape in zip(registered, mi_scene.shapes(), strict=True):
        ours[registry_id] = ids[shape.id()]
    return np.asarray(ours[numbers])


SPREAD = 0x9E3779B1
"""2^32 over the golden ratio: the multiples of it, modulo 2^32, are as far apart as so many numbers
can be.  The permutation of samples that `multijitter` gives to a pixel depends on the seed plus the
pixel's number times the samples per pixel.  So a replicate whose seed is larger by these samples
has the permutations of its neighbour, moved by a pixel: their correlation is 0.4."""


def render(
    mi_scene: Any,
    replicates: int,
    spp: int,
    seed: int = 0,
    sampler: ReferenceSampler = "independent",
    warm_up: bool = True,
) -> Replicates:
    """Pictures with the seeds seed, seed + 1, ..., those of `multijitter` times SPREAD;  sampler:
    the scene's.

    warm_up: render a small picture first and discard it: it compiles the kernels, which the
    measured time must not include.
    """
    scalar = mitsuba().variant().startswith("scalar")
    # Scalar variants multiply seeds by the number of pixels themselves.
    factor = SPREAD if sampler == "multijitter" and not scalar else 1
    if warm_up and not scalar:
        # Dr.Jit divides by powers of two in another way, and then compiles another kernel.
        warm_up_spp = 1 if spp & (spp - 1) == 0 else 3
        picture(mi_scene, warm_up_spp, factor * (seed + replicates))
    pictures, seconds = [], []
    for k in range(replicates):
        start = time.perf_counter()
        pictures.append(picture(mi_scene, spp, factor * (seed + k)))
        seconds.append(time.perf_counter() - start)
    # `multijitter` rounds up: it takes 35 for 32.
    in_one = getattr(mi_scene.integrator(), "most_rays", None) is None
    taken = int(mi_scene.sensors()[0].sampler().sample_count()) if in_one else spp
    return Replicates(np.stack(pictures), np.array(seconds), taken)


_APART = 1 << 20
"""Difference of the seeds of a picture's parts: larger than that of any two pictures."""


def picture(mi_scene: Any, spp: int, seed: int, integrator: Any = None) -> FloatArray:
    """One picture (height, width, 3), by the scene's integrator or another; in parts of fewer
    samples where the integrator has a limit of rays, `most_rays`."""
    integrator = mi_scene.integrator() if integrator is None else integrator
    width, height = mi_scene.sensors()[0].film().crop_size()
    limit = getattr(integrator, "most_rays", None)
    most = spp if limit is None else max(1, limit // (int(width) * int(height)))
    total: Any = 0.0
    for k, begun in enumerate(range(0, spp, most)):
        count = min(most, spp - begun)
        # The conversion to an array forces the lazy evaluation.
        part = (seed + k * _APART) % (1 << 32)
        pixels = np.array(mitsuba().render(mi_scene, spp=count, seed=part, integrator=integrator))
        total = total + count / spp * pixels.astype(np.float64)[..., :3]
    return np.asarray(total)
