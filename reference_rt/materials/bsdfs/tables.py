"""The register of BSDFs (materials that are not made of others): their descriptions, and the tables
that hold them.

A new one has a line in `Bsdf` and one in `Leaves`; all else follows from these two.  Its import as
itself makes it a name of `reference_rt.materials`.
"""

from typing import Annotated, Any, NamedTuple

from reference_rt.jit.by_code import ByCode, described_in, tables_of
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
from reference_rt.materials.bsdfs.conductor import Conductor as Conductor
from reference_rt.materials.bsdfs.dielectric import Dielectric as Dielectric
from reference_rt.materials.bsdfs.diffuse import Diffuse as Diffuse
from reference_rt.materials.bsdfs.gltf_pbr import GltfPbr as GltfPbr
from reference_rt.materials.bsdfs.mirror import Mirror as Mirror
from reference_rt.materials.bsdfs.phong import Phong as Phong
from reference_rt.materials.bsdfs.plastic import Plastic as Plastic
from reference_rt.materials.bsdfs.principled import Principled as Principled
from reference_rt.materials.bsdfs.principled_thin import PrincipledThin as PrincipledThin
from reference_rt.materials.bsdfs.rough_conductor import RoughConductor as RoughConductor
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric as RoughDielectric
from reference_rt.materials.bsdfs.rough_plastic import RoughPlastic as RoughPlastic
from reference_rt.materials.bsdfs.thin_dielectric import ThinDielectric as ThinDielectric

Bsdf = (
    Diffuse
    | Mirror
    | Dielectric
    | Conductor
    | ThinDielectric
    | RoughConductor
    | RoughDielectric
    | Plastic
    | RoughPlastic
    | Principled
    | PrincipledThin
    | GltfPbr
    | Phong
)


class Leaves(NamedTuple):
    """The table of every BSDF; None for those that the scene lacks."""

    diffuses: Annotated[diffuse.Diffuses | None, diffuse]
    mirrors: Annotated[mirror.Mirrors | None, mirror]
    dielectrics: Annotated[dielectric.Transparents | None, dielectric]
    conductors: Annotated[conductor.Conductors | None, conductor]
    thin_dielectrics: Annotated[thin_dielectric.Panes | None, thin_dielectric]
    rough_conductors: Annotated[rough_conductor.RoughConductors | None, rough_conductor]
    rough_dielectrics: Annotated[rough_dielectric.RoughDielectrics | None, rough_dielectric]
    plastics: Annotated[plastic.Plastics | None, plastic]
    rough_plastics: Annotated[rough_plastic.RoughPlastics | None, rough_plastic]
    principleds: Annotated[principled.Principleds | None, principled]
    phongs: Annotated[phong.Phongs | None, phong]
    thin_principleds: Annotated[principled_thin.ThinPrincipleds | None, principled_thin]
    gltf_pbrs: Annotated[gltf_pbr.GltfPbrs | None, gltf_pbr]


TABLES: tuple[tuple[int, str, Any, Any, Any], ...] = tuple(
    (code, field, described_in(module, Bsdf), table, module)
    for code, field, table, module in tables_of(Leaves)
)
"""(code, field of Leaves, description, table, module with its kernels), in the order of the
codes."""

CLEAR, BLACK = 100, 101
"""In place of a code: CLEAR lets all light pass (a hole of a mask), BLACK scatters nothing."""

declare(Leaves, LINK)

by_code = ByCode(Leaves)
