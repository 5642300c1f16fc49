"""Materials: how the surfaces of a scene scatter light.

- `bsdfs/`: the BSDFs, one file each, and the tables that hold them;
- `nested/`: materials made of others, which are flattened into weighted BSDFs;
- `microfacet/`: Fresnel's equations and the distributions of microfacets;
- `dispatch.py`: the kernels that integrators call, for any material of a scene.

Contract: directions are unit vectors in the shading frame (z is the shading normal) and point away
from the surface, `wo` towards the viewer and `wi` towards the light.  Colours are linear sRGB.
Call `prepare` once at each hit, before the others.  Then

- `eval_pdf` returns f(wo, wi) |cos wi| and the density of `sample` at wi, per solid angle (1/sr),
  without delta lobes; a value of zero means that nothing is scattered from wi to wo;
- `sample` takes three numbers from [0, 1) and returns a direction with f |cos wi| / pdf; pdf = 0
  means that sampling failed and the path ends here;
- `branches` returns the delta lobes, as directions with factors on radiance, black for none.

To add a material: a file in `bsdfs/` or, if it is made of others, in `nested/`, whose docstrings
say what else is needed; a member of `AnyMaterial` below; a translator in
`comparisons.translator`; a scene; a row in the tests' tuple.  Step by step:
docs/extending.md.
"""

from typing import Annotated

from pydantic import Field

from reference_rt.materials.bsdfs.conductor import Conductor
from reference_rt.materials.bsdfs.dielectric import Dielectric
from reference_rt.materials.bsdfs.diffuse import Diffuse
from reference_rt.materials.bsdfs.gltf_pbr import GltfPbr
from reference_rt.materials.bsdfs.mirror import Mirror
from reference_rt.materials.bsdfs.phong import Phong
from reference_rt.materials.bsdfs.plastic import Plastic
from reference_rt.materials.bsdfs.principled import Principled
from reference_rt.materials.bsdfs.principled_thin import PrincipledThin
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
    branch_count,
    branches,
    eval_pdf,
    evaluate,
    is_oriented,
    is_smooth,
    most_branches,
    pdf,
    prepare,
    sample,
    scratch_floats,
    takes_light_from_behind,
    uses_textures,
    uses_u_lobe,
)
from reference_rt.materials.material import Branches, BsdfSample, Emissive, Material, Shading
from reference_rt.materials.nested.tilted import Bump, NormalMap
from reference_rt.materials.nested.wrappers import Blend, Mask, TwoSided, Wrapper

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
    | PrincipledThin
    | GltfPbr
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
    "GltfPbr",
    "Mask",
    "Material",
    "Materials",
    "Mirror",
    "NormalMap",
    "Phong",
    "Plastic",
    "Principled",
    "PrincipledThin",
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
    "branch_count",
    "branches",
    "eval_pdf",
    "evaluate",
    "is_oriented",
    "is_smooth",
    "most_branches",
    "pdf",
    "prepare",
    "sample",
    "scratch_floats",
    "takes_light_from_behind",
    "uses_textures",
    "uses_u_lobe",
]
