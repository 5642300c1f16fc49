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
from reference_rt.jit.simd import VECTOR_WIDTH
from reference_rt.shapes.dispatch import intersect
from reference_rt.shapes.meshes.watertight import shear_of
from reference_rt.shapes.ray_simd import load, store
from reference_rt.shapes.tables import CODES, TABLES, Shapes, by_code

_KINDS = len(TABLES)

SIDE_BY_SIDE = tuple(code for module, code in CODES.items() if hasattr(module, "nearer"))
"""The types of which one shape is tested against VECTOR_WIDTH rays."""
ONE_BY_ONE = tuple(code for code in CODES.values() if code not in SIDE_BY_SIDE)


KIND = 2**40
"""Of types that are tested SIDE_BY_SIDE, `HitBlock.codes` are (kind + 1) * KIND + row until all
types are done and the hits are completed."""


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
    """The closest hits of the first n of `rays`.  any_hit: only whether each hits anything, which
    is the sign of its code."""
    for j in range(min(BLOCK, n + VECTOR_WIDTH - 1)):  # lanes without a ray are traced too
        hits.numbers[j], hits.codes[j] = rays.numbers[6 * BLOCK + j], -1
    for kind in SIDE_BY_SIDE:
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)
    for kind in ONE_BY_ONE:
        nearest_of_block(shapes, kind, rays, hits, n, any_hit)
    if not any_hit:
        for kind in SIDE_BY_SIDE:
            complete(shapes, kind, rays, hits, n)


@by_code.stage(only=SIDE_BY_SIDE)
def complete(table: Any, kind: int, rays: RayBlock, hits: HitBlock, n: int) -> None:
    """Completes those of the first n hits that are on shapes of one type."""
    first = (kind + 1) * KIND
    for j in range(n):
        code, t = hits.codes[j], hits.numbers[j]
        if first <= code < first + KIND:
            at = _found(table, code - first, ray_of(rays, j), t)
            put_hit(hits, j, Hit(at.t, kind, code - first, at.u, at.v, -1))


@kernel
def _kind_of(code: int) -> int:
    return code // KIND - 1 if code >= KIND else code


# Rays against all shapes of one type.  What a kernel below calls of the type stands in these
# functions: a kernel that held it in a closure would have another name in each process.


_found = by_class("found", {of: m.found for code, _, of, m in TABLES if code in SIDE_BY_SIDE})
"""The crossing with row i of a table that a SIMD test (`ray_simd.py`) has found at t."""


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
def _nearest(table: Any, kind: int, ray: Ray, closest: Hit) -> Hit:
    shear = shear_of(ray)  # which triangles alone need
    for i in range(len(table.face)):
        met: Crossing = intersect(table, kind, i, ray, shear)
        # Of a block's ray, types with SIMD kernels and greater codes are already in `closest`.
        if met.t < closest.t or (met.t == closest.t and kind < _kind_of(closest.kind)):
            closest = Hit(met.t, kind, i, met.u, met.v, -1)
    return closest


@by_code(lambda module: _nearest)
def nearest_of_type(shapes: Shapes, kind: int, ray: Ray, closest: Hit) -> Hit:
    """The nearest of `closest` and a ray's hit with any shape of one type."""
    return closest


@kernel
def _one_by_one(
    table: Any, kind: int, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool
) -> None:
    for j in range(n):
        if not (any_hit and hits.codes[j] >= 0):
            put_hit(hits, j, nearest_of_type(table, kind, ray_of(rays, j), hit_of(hits, j)))


@kernel
def _side_by_side(table: Any, kind: int, rays: RayBlock, hits: HitBlock, n: int) -> None:
    t, codes = local_floats(VECTOR_WIDTH), local_integers(VECTOR_WIDTH)
    for at in range(0, n, VECTOR_WIDTH):
        load(hits.numbers, hits.codes, at, t, codes)
        for i in range(len(table.face)):
            _nearer(table, i, rays.numbers, at, (kind + 1) * KIND + i, t, codes)
        store(t, codes, at, hits.numbers, hits.codes)


@by_code(lambda module: _side_by_side if CODES[module] in SIDE_BY_SIDE else _one_by_one)
def nearest_of_block(
    shapes: Shapes, kind: int, rays: RayBlock, hits: HitBlock, n: int, any_hit: bool
) -> None:
    """Updates the hits of the first n of `rays` with the shapes of one type; of types that are
    tested SIDE_BY_SIDE only t and the code."""
