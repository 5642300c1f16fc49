"""SoA buffers for one block of rays and for their hits."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reference_rt.core.ray import BLOCK, Hit, Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

RAY_FLOATS = 7 * BLOCK
HIT_FLOATS, HIT_INTEGERS = 3 * BLOCK, 3 * BLOCK


class RayBlock(NamedTuple):
    """Up to BLOCK rays as SoA: numbers (RAY_FLOATS,), o.x of all rays, then o.y, o.z, d.x, d.y, d.z
    and t_max."""

    numbers: FloatArray


class HitBlock(NamedTuple):
    """Up to BLOCK hits as SoA: numbers (HIT_FLOATS,), t of all hits, then u and v;  codes
    (HIT_INTEGERS,), kind of all hits, then row and instance."""

    numbers: FloatArray
    codes: IntArray


@kernel
def vector_of(numbers: FloatArray, column: int, j: int) -> Vec3:
    """Vector j of those stored in three columns, from `column` on, of BLOCK numbers each.

    The index is unsigned, as in `vec3.row` (measured: 2 % of spheres under a sky).
    """
    at, next_column = np.uint64(column * BLOCK + j), np.uint64(BLOCK)
    return Vec3(numbers[at], numbers[at + next_column], numbers[at + next_column + next_column])


@kernel
def put_vector(numbers: FloatArray, column: int, j: int, v: Vec3) -> None:
    at, next_column = np.uint64(column * BLOCK + j), np.uint64(BLOCK)
    numbers[at], numbers[at + next_column], numbers[at + next_column + next_column] = v


@kernel
def add_vector(numbers: FloatArray, column: int, j: int, v: Vec3) -> None:
    put_vector(numbers, column, j, vector_of(numbers, column, j) + v)


@kernel
def ray_of(rays: RayBlock, j: int) -> Ray:
    """Ray j."""
    numbers = rays.numbers
    return Ray(vector_of(numbers, 0, j), vector_of(numbers, 3, j), numbers[6 * BLOCK + j])


@kernel
def put_ray(rays: RayBlock, j: int, ray: Ray) -> None:
    put_vector(rays.numbers, 0, j, ray.o)
    put_vector(rays.numbers, 3, j, ray.d)
    rays.numbers[6 * BLOCK + j] = ray.t_max


@kernel
def hit_of(hits: HitBlock, j: int) -> Hit:
    """Hit j."""
    numbers, codes = hits.numbers, hits.codes
    return Hit(
        numbers[j],
        codes[j],
        codes[BLOCK + j],
        numbers[BLOCK + j],
        numbers[2 * BLOCK + j],
        codes[2 * BLOCK + j],
    )


@kernel
def put_hit(hits: HitBlock, j: int, hit: Hit) -> None:
    numbers, codes = hits.numbers, hits.codes
    numbers[j], numbers[BLOCK + j], numbers[2 * BLOCK + j] = hit.t, hit.u, hit.v
    codes[j], codes[BLOCK + j], codes[2 * BLOCK + j] = hit.kind, hit.row, hit.instance
