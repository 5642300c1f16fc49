"""The kernels that all BSDFs have in common: each calls that of the BSDF's type.

kind is the code of a table, i a row of it, `at` the place on the surface for texture lookups; wo
and wi are unit vectors in the shading frame.  The chains of `if kind == ...` are generated from
`Leaves`.  A function's body is for absent tables and for materials without the kernel: perfect
mirrors and glass have `branches` alone, most others have none.
"""

from typing import Any

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import BLOCK, PointBlock, RayBlock, vector_of
from reference_rt.core.vec3 import Vec3, is_black, to_local
from reference_rt.materials.bsdfs.tables import CLEAR, TABLES, Leaves, by_code
from reference_rt.materials.material import (
    NO_BRANCHES,
    Branches,
    BsdfSample,
    ScatterBlock,
    Scattered,
    asked_in,
    direction_towards,
    place_in,
    put_scattered,
    sample_branch,
    straight_on,
)
from reference_rt.materials.textured import Textured, evaluate_textures
from reference_rt.textures import At, Textures

KINDS = len(TABLES)


@by_code("eval_pdf")
def eval_pdf(leaves: Leaves, kind: int, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """f(wo, wi) |cos wi| and the density of `sample` per solid angle, without delta lobes."""
    return Scattered(Vec3(0.0, 0.0, 0.0), 0.0)


@by_code("branches")
def branches(leaves: Leaves, kind: int, i: int, at: At, wo: Vec3) -> Branches:
    """The perfectly reflected and refracted directions; factors of 0 if there are none."""
    return straight_on(wo) if kind == CLEAR else NO_BRANCHES


@by_code("sample")
def sample(
    leaves: Leaves, kind: int, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """A direction sampled for `wo`; pdf = 0 if nothing is scattered.  Of a material that has only
    `branches`, one of these."""
    return sample_branch(branches(leaves, kind, i, at, wo), u_lobe)


@by_code("ambient")
def ambient(leaves: Leaves, kind: int, i: int, at: At) -> Vec3:
    """The ambient reflectance k_a of the Phong model; black for others."""
    return Vec3(0.0, 0.0, 0.0)


@by_code.stage()
def scatter(
    table: Any,
    kind: int,
    block: ScatterBlock,
    rays: RayBlock,
    points: PointBlock,
    light: FloatArray,
    textured: Textured,
    textures: Textures | None,
    kept: FloatArray,
    n: int,
) -> None:
    """`eval_pdf` towards the light samples, and `sample`, for those of the first n paths that are
    at a material of one type."""
    for j in range(n):
        if block.codes[j] != kind:
            continue
        asked, i = asked_in(block, j, vector_of(points.numbers, 6, j)), block.codes[BLOCK + j]
        frame, wi = asked.frame, direction_towards(light, j)
        wo = to_local(frame, -vector_of(rays.numbers, 3, j))
        at = evaluate_textures(textured, points.codes[j], place_in(block, j, textures), kept)
        sent = Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
        if not is_black(wi):
            sent = eval_pdf(table, kind, i, at, wo, to_local(frame, wi))
        drawn = sample(table, kind, i, at, wo, asked.u_lobe, asked.u0, asked.u1)
        put_scattered(block, j, frame, sent, drawn)
