"""All materials: one file each; here, the choice among them.

To add a material: its file with description, table and kernels; a code in `material.py`; below, a
field of `Materials`, a line in `TABLES`, `AnyMaterial`, and one `if` in each dispatcher; a
translator function in `comparisons.translate`; a scene; a row in the tests' tuple.
"""

from typing import Annotated, NamedTuple

from pydantic import Field

from reference_rt.kernel import kernel
from reference_rt.materials import dielectric, diffuse, mirror
from reference_rt.materials.dielectric import Dielectric, Dielectrics
from reference_rt.materials.diffuse import Diffuse, Diffuses
from reference_rt.materials.emissive import Emissive
from reference_rt.materials.material import (
    BLACK,
    DIELECTRIC,
    DIFFUSE,
    MIRROR,
    Branches,
    BsdfSample,
    Material,
    no_branches,
    no_sample,
    sample_branch,
)
from reference_rt.materials.mirror import Mirror, Mirrors
from reference_rt.shapes.shape import IntArray
from reference_rt.vec3 import Vec3

AnyMaterial = Annotated[Diffuse | Mirror | Dielectric | Emissive, Field(discriminator="type")]


class Materials(NamedTuple):
    """kind (n,) and row (n,): which table each material is a row of; None for absent tables."""

    kind: IntArray
    row: IntArray
    diffuses: Diffuses | None
    mirrors: Mirrors | None
    dielectrics: Dielectrics | None


TABLES: tuple[tuple[int, str, type[Material], type], ...] = (
    (DIFFUSE, "diffuses", Diffuse, Diffuses),
    (MIRROR, "mirrors", Mirror, Mirrors),
    (DIELECTRIC, "dielectrics", Dielectric, Dielectrics),
)
"""(code, field of Materials, description, table)."""


@kernel
def is_smooth(materials: Materials, m: int) -> bool:
    """Whether the material scatters to a continuum of directions, so that lights can be sampled."""
    return bool(materials.kind[m] == DIFFUSE)


@kernel
def evaluate(materials: Materials, m: int, wo: Vec3, wi: Vec3) -> Vec3:
    """f(wo, wi) |cos wi|; zero for materials that only mirror or refract."""
    return _evaluate(materials.diffuses, materials.kind[m], materials.row[m], wo, wi)


@kernel
def _evaluate(diffuses: Diffuses | None, kind: int, i: int, wo: Vec3, wi: Vec3) -> Vec3:
    if diffuses is not None:
        if kind == DIFFUSE:
            return diffuse.evaluate(diffuses, i, wo, wi)
    return Vec3(0.0, 0.0, 0.0)


@kernel
def pdf(materials: Materials, m: int, wo: Vec3, wi: Vec3) -> float:
    """The density per solid angle with which `sample` picks `wi`; zero for discrete directions."""
    return _pdf(materials.diffuses, materials.kind[m], wo, wi)


@kernel
def _pdf(diffuses: Diffuses | None, kind: int, wo: Vec3, wi: Vec3) -> float:
    if diffuses is not None:
        if kind == DIFFUSE:
            return diffuse.pdf(wo, wi)
    return 0.0


@kernel
def sample(
    materials: Materials, m: int, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """A direction drawn for `wo`; pdf = 0 where the material scatters nothing."""
    kind = materials.kind[m]
    if kind == DIFFUSE:
        return _sample_diffuse(materials.diffuses, materials.row[m], wo, u0, u1)
    return sample_branch(branches(materials, m, wo), u_lobe)


@kernel
def _sample_diffuse(
    diffuses: Diffuses | None, i: int, wo: Vec3, u0: float, u1: float
) -> BsdfSample:
    if diffuses is None:
        return no_sample()
    return diffuse.sample(diffuses, i, wo, u0, u1)


@kernel
def branches(materials: Materials, m: int, wo: Vec3) -> Branches:
    """The mirrored and the refracted direction; black for materials that have none."""
    return _branches(
        materials.mirrors, materials.dielectrics, materials.kind[m], materials.row[m], wo
    )


@kernel
def _branches(
    mirrors: Mirrors | None, dielectrics: Dielectrics | None, kind: int, i: int, wo: Vec3
) -> Branches:
    if mirrors is not None:
        if kind == MIRROR:
            return mirror.branches(mirrors, i, wo)
    if dielectrics is not None:
        if kind == DIELECTRIC:
            return dielectric.branches(dielectrics, i, wo)
    return no_branches()


__all__ = [
    "BLACK",
    "TABLES",
    "AnyMaterial",
    "Branches",
    "BsdfSample",
    "Dielectric",
    "Diffuse",
    "Emissive",
    "Materials",
    "Mirror",
    "branches",
    "evaluate",
    "is_smooth",
    "pdf",
    "sample",
]
