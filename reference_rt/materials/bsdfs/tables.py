"""The tables of all BSDFs (materials that are not made of others), and the choice among them.

kind is the code of a table, i a row of it, `at` the place on the surface for texture lookups; wo
and wi are unit vectors in the shading frame.  The chains of `if kind == ...` are generated from
`TABLES`.  A function's body is for absent tables and for materials without the kernel: perfect
mirrors and glass have `branches` alone, most others have none.
"""

from typing import Any, NamedTuple

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.by_code import ByCode
from reference_rt.jit.kernel import kernel
from reference_rt.jit.links import LINK, declare
from reference_rt.materials.bsdfs import (
    conductor,
    dielectric,
    diffuse,
    gltf_pbr,
    mirror,
    phong,
    plastic,
    principled,
    principled_thin,
    rough_conductor,
    rough_dielectric,
    rough_plastic,
    thin_dielectric,
)
from reference_rt.materials.bsdfs.conductor import Conductor, Conductors
from reference_rt.materials.bsdfs.dielectric import Dielectric, Transparents
from reference_rt.materials.bsdfs.diffuse import Diffuse, Diffuses
from reference_rt.materials.bsdfs.gltf_pbr import GltfPbr, GltfPbrs
from reference_rt.materials.bsdfs.mirror import Mirror, Mirrors
from reference_rt.materials.bsdfs.phong import Phong, Phongs
from reference_rt.materials.bsdfs.plastic import Plastic, Plastics
from reference_rt.materials.bsdfs.principled import Principled, Principleds
from reference_rt.materials.bsdfs.principled_thin import PrincipledThin, ThinPrincipleds
from reference_rt.materials.bsdfs.rough_conductor import RoughConductor, RoughConductors
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric, RoughDielectrics
from reference_rt.materials.bsdfs.rough_plastic import RoughPlastic, RoughPlastics
from reference_rt.materials.bsdfs.thin_dielectric import ThinDielectric
from reference_rt.materials.material import (
    NO_BRANCHES,
    Branches,
    BsdfSample,
    Material,
    Scattered,
    sample_branch,
    straight_on,
)
from reference_rt.textures import At

# Codes of the tables.  CLEAR lets all light pass (a hole of a mask), BLACK scatters nothing.
(
    DIFFUSE,
    MIRROR,
    DIELECTRIC,
    CONDUCTOR,
    THIN_DIELECTRIC,
    ROUGH_CONDUCTOR,
    ROUGH_DIELECTRIC,
    PLASTIC,
    ROUGH_PLASTIC,
    PRINCIPLED,
    PHONG,
    PRINCIPLED_THIN,
    GLTF_PBR,
) = range(13)
CLEAR, BLACK = 100, 101


class Leaves(NamedTuple):
    """The table of every BSDF; None for those that the scene lacks."""

    diffuses: Diffuses | None
    mirrors: Mirrors | None
    dielectrics: Transparents | None
    conductors: Conductors | None
    thin_dielectrics: Transparents | None
    rough_conductors: RoughConductors | None
    rough_dielectrics: RoughDielectrics | None
    plastics: Plastics | None
    rough_plastics: RoughPlastics | None
    principleds: Principleds | None
    phongs: Phongs | None
    thin_principleds: ThinPrincipleds | None
    gltf_pbrs: GltfPbrs | None


TABLES: tuple[tuple[int, str, type[Material], type, Any], ...] = (
    (DIFFUSE, "diffuses", Diffuse, Diffuses, diffuse),
    (MIRROR, "mirrors", Mirror, Mirrors, mirror),
    (DIELECTRIC, "dielectrics", Dielectric, Transparents, dielectric),
    (CONDUCTOR, "conductors", Conductor, Conductors, conductor),
    (THIN_DIELECTRIC, "thin_dielectrics", ThinDielectric, Transparents, thin_dielectric),
    (ROUGH_CONDUCTOR, "rough_conductors", RoughConductor, RoughConductors, rough_conductor),
    (ROUGH_DIELECTRIC, "rough_dielectrics", RoughDielectric, RoughDielectrics, rough_dielectric),
    (PLASTIC, "plastics", Plastic, Plastics, plastic),
    (ROUGH_PLASTIC, "rough_plastics", RoughPlastic, RoughPlastics, rough_plastic),
    (PRINCIPLED, "principleds", Principled, Principleds, principled),
    (PHONG, "phongs", Phong, Phongs, phong),
    (PRINCIPLED_THIN, "thin_principleds", PrincipledThin, ThinPrincipleds, principled_thin),
    (GLTF_PBR, "gltf_pbrs", GltfPbr, GltfPbrs, gltf_pbr),
)
"""(code, field of Leaves, description, table, module with its kernels)."""


declare(Leaves, LINK)

by_code = ByCode((code, field, module) for code, field, _, _, module in TABLES)


@kernel
def _code(code: int, table: Any, last: int) -> int:
    return code


_last = by_code.in_turn(_code)


@kernel
def only(leaves: Leaves) -> int:
    """The code of the only table, for scenes with one: a constant, so that branches vanish."""
    code: int = _last(leaves, GLTF_PBR)
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
