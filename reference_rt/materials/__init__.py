"""All materials: one file each; here, their names.  What is asked of them is in `dispatch.py`.

To add a material: its file with description, table and kernels; in `leaves.py` a code, a field of
`Leaves`, a line in `TABLES` and a branch in the dispatchers; below, `AnyMaterial`; a translator
function in `comparisons.mitsuba.translate`; a scene; a row in the tests' tuple.  One that is made
of others (`wrappers.py`) needs a step in `nested/flattened.py` instead.
"""

from typing import Annotated

from pydantic import Field

from reference_rt.materials.bsdfs.conductor import Conductor
from reference_rt.materials.bsdfs.dielectric import Dielectric
from reference_rt.materials.bsdfs.diffuse import Diffuse
from reference_rt.materials.bsdfs.mirror import Mirror
from reference_rt.materials.bsdfs.phong import Phong
from reference_rt.materials.bsdfs.plastic import Plastic
from reference_rt.materials.bsdfs.principled import Principled
from reference_rt.materials.bsdfs.rough_conductor import RoughConductor
from reference_rt.materials.bsdfs.rough_dielectric import RoughDielectric
from reference_rt.materials.bsdfs.rough_plastic import RoughPlastic
from reference_rt.materials.bsdfs.tables import BLACK
from reference_rt.materials.bsdfs.thin_dielectric import ThinDielectric
from reference_rt.materials.dispatch import (
    Materials,
    ambient,
    any_smooth,
    any_transmits,
    asks_textures,
    both,
    branch_count,
    branches,
    chooses,
    evaluate,
    is_smooth,
    kept_floats,
    most_branches,
    pdf,
    prepare,
    sample,
    takes_light_from_behind,
)
from reference_rt.materials.emissive import Emissive
from reference_rt.materials.material import Branches, BsdfSample, Material
from reference_rt.materials.nested.bump import Bump
from reference_rt.materials.nested.normal_map import NormalMap
from reference_rt.materials.nested.wrappers import Blend, Mask, TwoSided, Wrapper
from reference_rt.materials.shading import Shading

AnyMaterial = Annotated[
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
    | Phong
    | Emissive
    | Mask
    | TwoSided
    | Blend
    | Bump
    | NormalMap,
    Field(discriminator="type"),
]

__all__ = [
    "BLACK",
    "AnyMaterial",
    "Blend",
    "Branches",
    "BsdfSample",
    "Bump",
    "Conductor",
    "Dielectric",
    "Diffuse",
    "Emissive",
    "Mask",
    "Material",
    "Materials",
    "Mirror",
    "NormalMap",
    "Phong",
    "Plastic",
    "Principled",
    "RoughConductor",
    "RoughDielectric",
    "RoughPlastic",
    "Shading",
    "ThinDielectric",
    "TwoSided",
    "Wrapper",
    "ambient",
    "any_smooth",
    "any_transmits",
    "asks_textures",
    "both",
    "branch_count",
    "branches",
    "chooses",
    "evaluate",
    "is_smooth",
    "kept_floats",
    "most_branches",
    "pdf",
    "prepare",
    "sample",
    "takes_light_from_behind",
]
