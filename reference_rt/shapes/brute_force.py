"""Closest hits by brute force, without a BVH: faster for scenes of a few shapes.

One type of shape after another updates the nearest hit so far: of one ray (`nearest_of_type`), or
of a block of rays (`nearest_of_block`), of which VECTOR_WIDTH at once are tested against one shape
of the types that have a kernel `nearer`.
"""

from collections.abc import Callable
from typing import Any

from reference_rt.core.ray import (
    BLOCK,
    Crossing,
    Hit,
    HitBlock,
    Ray,
    RayBlock,
    hit_of,
    no_hit,
    put_hit,
    ray_of,
)
from reference_rt.jit.kernel import by_class, kernel, local_floats, local_integers
from reference_rt.jit.links import Link
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes.dispatch import found
from reference_rt.shapes.meshes.watertight import shear_of
from reference_rt.shapes.ray_simd import load, store
from reference_rt.shapes.tables import CODES, TABLES, TRIANGLE, Shapes, by_code

_KINDS = len(TABLES)

SIDE_BY_SIDE = tuple(code for module, code in CODES.items() if hasattr(module, "nearer"))
"""The types of which one shape is tested against VECTOR_WIDTH rays."""
ONE_BY_ONE = tuple(code for code in CODES.values() if code not in SIDE_BY_SIDE)


KIND = 2**40
"""Of types that are tested SIDE_BY_SIDE, `HitBlock.codes` are (kind + 1) * KIND + row until the hit
is completed: where it is read, among all else that depends on its type.  Completed for the whole
block, the Cornell box took 1.07 of the time (measured)."""


@kernel
def nearest(shapes: Shapes, ray: Ray) -> Hit:
    """The closest hit of one ray.  Of several at the same t, the first in the order of the codes,
    then of the scene."""
    closest = no_hit(ray)
    for kind in range(_KINDS):
        closest = nearest_of_type(shapes, kind, ray, closest)
    return closest


@kernel
def nearest_of_rays(shapes: Shapes, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
    """The closest hits of the first n of `rays`, which `completed` completes.  any_hit: only
    whether each hits anything, which is the sign of its code."""
    for j in range(min(BLOCK, n + VECTOR_WIDTH - 1)):  # lanes without a ray are traced too
        hits.numbers[j], hits.codes[j] = rays.numbers[6 * BLOCK + j], -1
    for kind in SIDE_BY_SIDE:
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)
    for kind in ONE_BY_ONE:
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)
    if not any_hit:
        _complete_behind_link(shapes, rays, hits, n)


@kernel
def completed(shapes: Shapes, ray: Ray, hits: HitBlock, j: int) -> Hit:
    """The hit of ray j of a block after `nearest_of_rays`."""
    code, t = hits.codes[j], hits.numbers[j]
    if code < KIND:
        return hit_of(hits, j)
    at = found(shapes, _kind_of(code), code % KIND, ray, t)
    return Hit(at.t, _kind_of(code), code % KIND, at.u, at.v, -1)


@kernel
def _kind_of(code: int) -> int:
    return code // KIND - 1 if code >= KIND else code


@kernel
def _complete(shapes: Any, rays: RayBlock, hits: HitBlock, n: int) -> None:
    for j in range(n):
        put_hit(hits, j, completed(shapes, ray_of(rays, j), hits, j))


@kernel
def _complete_later(shapes: Shapes, rays: RayBlock, hits: HitBlock, n: int) -> None:
    return


_complete_behind_link = by_class("complete", {Link: _complete, Shapes: _complete_later})
"""Completes the hits of a block, unless whoever reads them has the shapes' tables."""


# Rays against all shapes of one type.  What a kernel below calls of the type stands in these
# functions: a kernel that held it in a closure would have another name in each process.


_intersect = by_class("intersect", {table: module.intersect for _, _, table, module in TABLES})


def _nearer_by(module: Any) -> Callable[..., None]:
    """The kernel of `_nearer` for a type of shape."""
    nearer, arguments = module.nearer, module.arguments

    @kernel
    def of_row(table: Any, i: int, rays: Any, at: int, code: int, t: Any, codes: Any) -> None:
        nearer(rays, at, arguments(table, i), code, t, codes)

    return of_row


_nearer = by_class(
    "nearer", {table: _nearer_by(m) for code, _, table, m in TABLES if code in SIDE_BY_SIDE}
)
"""Tests row i of a table against VECTOR_WIDTH rays."""


@kernel
def _as_it_is(table: Any, ray: Ray) -> Ray:
    return ray


@kernel
def _sheared(table: Any, ray: Ray) -> Any:
    return shear_of(ray)


_prepared = by_class(
    "prepared",
    {table: _sheared if code == TRIANGLE else _as_it_is for code, _, table, _ in TABLES},
)
"""prepared(table, ray): what `intersect` takes, computed once for all shapes of a type."""


def _nearest_by(module: Any) -> Callable[..., Hit]:
    """The kernel of `nearest_of_type` for a type of shape."""
    kind = CODES[module]

    @kernel
    def of_table(table: Any, ray: Ray, closest: Hit) -> Hit:
        prepared = _prepared(table, ray)
        for i in range(len(table.face)):
            met: Crossing = _intersect(table, i, prepared)
            # Of a block's ray, types with SIMD kernels and greater codes are already in `closest`.
            if met.t < closest.t or (met.t == closest.t and kind < _kind_of(closest.kind)):
                closest = Hit(met.t, kind, i, met.u, met.v, -1)
        return closest

    return of_table


_NEAREST = {module: _nearest_by(module) for module in CODES}
_nearest_in = by_class("nearest_in", {table: _NEAREST[module] for _, _, table, module in TABLES})


@by_code(_NEAREST.get)
def nearest_of_type(shapes: Shapes, kind: int, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and a ray's hit with any shape of one type."""
    return closest


def _of_block_by(module: Any) -> Callable[..., None]:
    """The kernel of `nearest_of_block` for a type of shape."""
    kind = CODES[module]

    @kernel
    def one_by_one(table: Any, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool) -> None:
        for j in range(n):
            if not (any_hit and hits.codes[j] >= 0):
                put_hit(hits, j, _nearest_in(table, ray_of(rays, j), hit_of(hits, j)))

    @kernel
    def side_by_side(table: Any, rays: RayBlock, hits: HitBlock, n: int) -> None:
        t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
        for at in range(0, n, VECTOR_WIDTH):
            load(hits.numbers, hits.codes, at, t, codes)
            for i in range(len(table.face)):
                _nearer(table, i, rays.numbers, at, (kind + 1) * KIND + i, t, codes)
            store(t, codes, at, hits.numbers, hits.codes)

    return one_by_one if kind in ONE_BY_ONE else side_by_side


@by_code(_of_block_by)
def nearest_of_block(
    shapes: Shapes, kind: int, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool
) -> None:
    """Updates the hits of the first n of `rays` with the shapes of one type; of types that are
    tested SIDE_BY_SIDE only t and the code."""
