"""The kernels that all BSDFs have in common: each calls that of the BSDF's type.

kind is the code of a table, i a row of it, `at` the place on the surface for texture lookups; wo
and wi are unit vectors in the shading frame.  The chains of `if kind == ...` are generated from
`Leaves`.  A function's body is for absent tables and for materials without the kernel: perfect
mirrors and glass have `branches` alone, most others have none.
"""

from typing import Any

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import kernel
from reference_rt.materials.bsdfs.tables import CLEAR, TABLES, Leaves, by_code
from reference_rt.materials.material import (
    NO_BRANCHES,
    Branches,
    BsdfSample,
    Scattered,
    sample_branch,
    straight_on,
)
from reference_rt.textures import At


@kernel
def _code(code: int, table: Any, last: int) -> int:
    return code


_last = by_code.in_turn(_code)
_LAST = len(TABLES) - 1


@kernel
def only(leaves: Leaves) -> int:
    """The code of the only table, for scenes with one: a constant, so that branches vanish."""
    code: int = _last(leaves, _LAST)
    return code


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
