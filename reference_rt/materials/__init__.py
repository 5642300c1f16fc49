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

To add a material: a file in `bsdfs/`, and its lines in `bsdfs/tables.py`; or, if it is made of
others, one in `nested/`, and its line in `AnyMaterial` below.  Step by step: docs/extending.md.
"""

from typing import Annotated

from pydantic import Field

from reference_rt.materials.bsdfs.tables import *
from reference_rt.materials.bsdfs.tables import Bsdf as Bsdf
from reference_rt.materials.dispatch import Materials as Materials
from reference_rt.materials.dispatch import ambient as ambient
from reference_rt.materials.dispatch import are_flattened as are_flattened
from reference_rt.materials.dispatch import branch_count as branch_count
from reference_rt.materials.dispatch import branches as branches
from reference_rt.materials.dispatch import eval_pdf as eval_pdf
from reference_rt.materials.dispatch import evaluate as evaluate
from reference_rt.materials.dispatch import is_oriented as is_oriented
from reference_rt.materials.dispatch import is_smooth as is_smooth
from reference_rt.materials.dispatch import most_branches as most_branches
from reference_rt.materials.dispatch import pdf as pdf
from reference_rt.materials.dispatch import prepare as prepare
from reference_rt.materials.dispatch import sample as sample
from reference_rt.materials.dispatch import scatter as scatter
from reference_rt.materials.dispatch import scatters as scatters
from reference_rt.materials.dispatch import scratch_floats as scratch_floats
from reference_rt.materials.dispatch import takes_light_from_behind as takes_light_from_behind
from reference_rt.materials.dispatch import uses_textures as uses_textures
from reference_rt.materials.dispatch import uses_u_lobe as uses_u_lobe
from reference_rt.materials.material import SCATTER_FLOATS as SCATTER_FLOATS
from reference_rt.materials.material import SCATTER_INTEGERS as SCATTER_INTEGERS
from reference_rt.materials.material import Asked as Asked
from reference_rt.materials.material import Branches as Branches
from reference_rt.materials.material import BsdfSample as BsdfSample
from reference_rt.materials.material import Emissive as Emissive
from reference_rt.materials.material import Material as Material
from reference_rt.materials.material import ScatterBlock as ScatterBlock
from reference_rt.materials.material import Scattered as Scattered
from reference_rt.materials.material import Shading as Shading
from reference_rt.materials.material import asked_in as asked_in
from reference_rt.materials.material import direction_towards as direction_towards
from reference_rt.materials.material import drawn_in as drawn_in
from reference_rt.materials.material import lit_in as lit_in
from reference_rt.materials.material import put_asked as put_asked
from reference_rt.materials.material import put_place as put_place
from reference_rt.materials.material import put_scattered as put_scattered
from reference_rt.materials.nested.tilted import Bump as Bump
from reference_rt.materials.nested.tilted import NormalMap as NormalMap
from reference_rt.materials.nested.wrappers import Blend as Blend
from reference_rt.materials.nested.wrappers import Mask as Mask
from reference_rt.materials.nested.wrappers import TwoSided as TwoSided
from reference_rt.materials.nested.wrappers import Wrapper as Wrapper
from reference_rt.materials.none import NoSurface as NoSurface

AnyMaterial = Annotated[
    Bsdf | Emissive | NoSurface | Mask | TwoSided | Blend | Bump | NormalMap,
    Field(discriminator="type"),
]
