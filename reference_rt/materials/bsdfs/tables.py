"""The materials that scatter by a law of their own: the choice among their kernels.

`At` is where on the surface textures are asked.  Every kernel of a table that the scene lacks, and
one that a material lacks (smooth ones have no `branches`, perfect mirrors nothing else), is
replaced by the one that finds nothing, at compile time.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import ByClass, kernel
from reference_rt.materials.bsdfs import (
    conductor,
    dielectric,
    diffuse,
    mirror,
    phong,
    plastic,
    principled,
    rough_conductor,
    rough_dielectric,
    rough_plastic,
    thin_dielectric,
)
from reference_rt.materials.bsdfs.conductor import Conductor, Conductors
from reference_rt.materials.bsdfs.dielectric import Dielectric, Dielectrics
from reference_rt.materials.bsdfs.diffuse import Diffuse, Diffuses
from reference_rt.materials.bsdfs.mirror import Mirror, Mirrors
from reference_rt.materials.bsdfs.phong import Phong, Phongs
from reference_rt.materials.bsdfs.plastic import Plastic, Plastics
from reference_rt.materials.bsdfs.principled import Principled, Principleds
from reference_rt.materials.bsdfs.rough_conductor import RoughConductor, RoughConductors
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric, RoughDielectrics
from reference_rt.materials.bsdfs.rough_plastic import RoughPlastic, RoughPlastics
from reference_rt.materials.bsdfs.thin_dielectric import ThinDielectric, ThinDielectrics
from reference_rt.materials.material import (
    Branches,
    BsdfSample,
    Material,
    Scattered,
    no_branches,
    no_sample,
    sample_branch,
    straight_on,
)
from reference_rt.textures import At

# Codes of the tables; CLEAR is what is not there, BLACK scatters nothing.
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
) = range(11)
CLEAR, BLACK = 100, 101


class Leaves(NamedTuple):
    """The tables of all materials that are not made of others; None for absent ones."""

    diffuses: Diffuses | None
    mirrors: Mirrors | None
    dielectrics: Dielectrics | None
    conductors: Conductors | None
    thin_dielectrics: ThinDielectrics | None
    rough_conductors: RoughConductors | None
    rough_dielectrics: RoughDielectrics | None
    plastics: Plastics | None
    rough_plastics: RoughPlastics | None
    principleds: Principleds | None
    phongs: Phongs | None


TABLES: tuple[tuple[int, str, type[Material], type, Any], ...] = (
    (DIFFUSE, "diffuses", Diffuse, Diffuses, diffuse),
    (MIRROR, "mirrors", Mirror, Mirrors, mirror),
    (DIELECTRIC, "dielectrics", Dielectric, Dielectrics, dielectric),
    (CONDUCTOR, "conductors", Conductor, Conductors, conductor),
    (THIN_DIELECTRIC, "thin_dielectrics", ThinDielectric, ThinDielectrics, thin_dielectric),
    (ROUGH_CONDUCTOR, "rough_conductors", RoughConductor, RoughConductors, rough_conductor),
    (ROUGH_DIELECTRIC, "rough_dielectrics", RoughDielectric, RoughDielectrics, rough_dielectric),
    (PLASTIC, "plastics", Plastic, Plastics, plastic),
    (ROUGH_PLASTIC, "rough_plastics", RoughPlastic, RoughPlastics, rough_plastic),
    (PRINCIPLED, "principleds", Principled, Principleds, principled),
    (PHONG, "phongs", Phong, Phongs, phong),
)
"""(code, field of Leaves, description, table, module with its kernels)."""


def _of_table(name: str, without: Callable[..., Any]) -> Callable[..., Any]:
    """The kernel `name` of the module of the table that is the first argument."""
    choice = ByClass(name)
    choice.register(type(None), without)
    for _, _, _, table, module in TABLES:
        choice.register(table, getattr(module, name, without))
    return choice.function


@kernel
def _nothing(table: Any, i: int, at: At, wo: Vec3, wi: Vec3) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


@kernel
def _never(table: Any, i: int, at: At, wo: Vec3, wi: Vec3) -> float:
    return 0.0


@kernel
def _apart(table: Any, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    return Scattered(_evaluate(table, i, at, wo, wi), _pdf(table, i, at, wo, wi))


@kernel
def _nowhere(
    table: Any, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    return no_sample()


@kernel
def _no_branches(table: Any, i: int, at: At, wo: Vec3) -> Branches:
    return no_branches()


@kernel
def _no_ambient(table: Any, i: int, at: At) -> Vec3:
    return Vec3(0.0, 0.0, 0.0)


_evaluate = _of_table("evaluate", _nothing)
_pdf = _of_table("pdf", _never)
_both = _of_table("both", _apart)
_sample = _of_table("sample", _nowhere)
_branches = _of_table("branches", _no_branches)
_ambient = _of_table("ambient", _no_ambient)


@kernel
def only(leaves: Leaves) -> int:
    """The code of the table where there is but one: a constant, so that choices vanish."""
    kind = PHONG
    if leaves.diffuses is not None:
        kind = DIFFUSE
    elif leaves.mirrors is not None:
        kind = MIRROR
    elif leaves.dielectrics is not None:
        kind = DIELECTRIC
    elif leaves.conductors is not None:
        kind = CONDUCTOR
    elif leaves.thin_dielectrics is not None:
        kind = THIN_DIELECTRIC
    elif leaves.rough_conductors is not None:
        kind = ROUGH_CONDUCTOR
    elif leaves.rough_dielectrics is not None:
        kind = ROUGH_DIELECTRIC
    elif leaves.plastics is not None:
        kind = PLASTIC
    elif leaves.rough_plastics is not None:
        kind = ROUGH_PLASTIC
    elif leaves.principleds is not None:
        kind = PRINCIPLED
    return kind


@kernel
def evaluate(leaves: Leaves, kind: int, i: int, at: At, wo: Vec3, wi: Vec3) -> Vec3:
    """f(wo, wi) |cos wi| of one leaf, without what it mirrors or refracts perfectly."""
    value = Vec3(0.0, 0.0, 0.0)
    if kind == DIFFUSE:
        value = _evaluate(leaves.diffuses, i, at, wo, wi)
    elif kind == ROUGH_CONDUCTOR:
        value = _evaluate(leaves.rough_conductors, i, at, wo, wi)
    elif kind == ROUGH_DIELECTRIC:
        value = _evaluate(leaves.rough_dielectrics, i, at, wo, wi)
    elif kind == PLASTIC:
        value = _evaluate(leaves.plastics, i, at, wo, wi)
    elif kind == ROUGH_PLASTIC:
        value = _evaluate(leaves.rough_plastics, i, at, wo, wi)
    elif kind == PRINCIPLED:
        value = _evaluate(leaves.principleds, i, at, wo, wi)
    elif kind == PHONG:
        value = _evaluate(leaves.phongs, i, at, wo, wi)
    return value


@kernel
def pdf(leaves: Leaves, kind: int, i: int, at: At, wo: Vec3, wi: Vec3) -> float:
    """The density of `sample` per solid angle; discrete directions do not count."""
    density = 0.0
    if kind == DIFFUSE:
        density = _pdf(leaves.diffuses, i, at, wo, wi)
    elif kind == ROUGH_CONDUCTOR:
        density = _pdf(leaves.rough_conductors, i, at, wo, wi)
    elif kind == ROUGH_DIELECTRIC:
        density = _pdf(leaves.rough_dielectrics, i, at, wo, wi)
    elif kind == PLASTIC:
        density = _pdf(leaves.plastics, i, at, wo, wi)
    elif kind == ROUGH_PLASTIC:
        density = _pdf(leaves.rough_plastics, i, at, wo, wi)
    elif kind == PRINCIPLED:
        density = _pdf(leaves.principleds, i, at, wo, wi)
    elif kind == PHONG:
        density = _pdf(leaves.phongs, i, at, wo, wi)
    return density


@kernel
def both(leaves: Leaves, kind: int, i: int, at: At, wo: Vec3, wi: Vec3) -> Scattered:
    """`evaluate` and `pdf`, which share much of their work."""
    found = Scattered(Vec3(0.0, 0.0, 0.0), 0.0)
    if kind == DIFFUSE:
        found = _both(leaves.diffuses, i, at, wo, wi)
    elif kind == ROUGH_CONDUCTOR:
        found = _both(leaves.rough_conductors, i, at, wo, wi)
    elif kind == ROUGH_DIELECTRIC:
        found = _both(leaves.rough_dielectrics, i, at, wo, wi)
    elif kind == PLASTIC:
        found = _both(leaves.plastics, i, at, wo, wi)
    elif kind == ROUGH_PLASTIC:
        found = _both(leaves.rough_plastics, i, at, wo, wi)
    elif kind == PRINCIPLED:
        found = _both(leaves.principleds, i, at, wo, wi)
    elif kind == PHONG:
        found = _both(leaves.phongs, i, at, wo, wi)
    return found


@kernel
def sample(
    leaves: Leaves, kind: int, i: int, at: At, wo: Vec3, u_lobe: float, u0: float, u1: float
) -> BsdfSample:
    """A direction drawn for `wo`; pdf = 0 where the leaf scatters nothing."""
    if kind == DIFFUSE:
        found: BsdfSample = _sample(leaves.diffuses, i, at, wo, u_lobe, u0, u1)
    elif kind == ROUGH_CONDUCTOR:
        found = _sample(leaves.rough_conductors, i, at, wo, u_lobe, u0, u1)
    elif kind == ROUGH_DIELECTRIC:
        found = _sample(leaves.rough_dielectrics, i, at, wo, u_lobe, u0, u1)
    elif kind == PLASTIC:
        found = _sample(leaves.plastics, i, at, wo, u_lobe, u0, u1)
    elif kind == ROUGH_PLASTIC:
        found = _sample(leaves.rough_plastics, i, at, wo, u_lobe, u0, u1)
    elif kind == PRINCIPLED:
        found = _sample(leaves.principleds, i, at, wo, u_lobe, u0, u1)
    elif kind == PHONG:
        found = _sample(leaves.phongs, i, at, wo, u_lobe, u0, u1)
    else:
        found = sample_branch(branches(leaves, kind, i, at, wo), u_lobe)
    return found


@kernel
def branches(leaves: Leaves, kind: int, i: int, at: At, wo: Vec3) -> Branches:
    """The perfectly mirrored and refracted directions; black where there are none."""
    found: Branches = no_branches()
    if kind == MIRROR:
        found = _branches(leaves.mirrors, i, at, wo)
    elif kind == DIELECTRIC:
        found = _branches(leaves.dielectrics, i, at, wo)
    elif kind == CONDUCTOR:
        found = _branches(leaves.conductors, i, at, wo)
    elif kind == THIN_DIELECTRIC:
        found = _branches(leaves.thin_dielectrics, i, at, wo)
    elif kind == PLASTIC:
        found = _branches(leaves.plastics, i, at, wo)
    elif kind == PHONG:
        found = _branches(leaves.phongs, i, at, wo)
    elif kind == CLEAR:
        found = straight_on(wo)
    return found


@kernel
def ambient(leaves: Leaves, kind: int, i: int, at: At) -> Vec3:
    """The text-book's k_a of one leaf."""
    if kind == PHONG:
        value: Vec3 = _ambient(leaves.phongs, i, at)
        return value
    return Vec3(0.0, 0.0, 0.0)
