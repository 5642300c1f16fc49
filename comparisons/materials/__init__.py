"""Materials: one type, one file, with all that the comparison knows of it
(`material.MaterialType`).

`translate` and `reading` are those of a scene, to and from Mitsuba.  To add a type: its file, and a
member of MATERIALS.
"""

from comparisons.materials.blend import BLEND
from comparisons.materials.bump import BUMP
from comparisons.materials.conductor import CONDUCTOR
from comparisons.materials.dielectric import DIELECTRIC
from comparisons.materials.diffuse import DIFFUSE
from comparisons.materials.emissive import EMISSIVE
from comparisons.materials.gltf_pbr import GLTF_PBR
from comparisons.materials.mask import MASK
from comparisons.materials.material import MaterialType
from comparisons.materials.mirror import MIRROR
from comparisons.materials.none import NO_SURFACE
from comparisons.materials.normal_map import NORMAL_MAP
from comparisons.materials.phong import PHONG
from comparisons.materials.plastic import PLASTIC
from comparisons.materials.principled import PRINCIPLED
from comparisons.materials.principled_thin import PRINCIPLED_THIN
from comparisons.materials.rough_conductor import ROUGH_CONDUCTOR
from comparisons.materials.rough_dielectric import ROUGH_DIELECTRIC
from comparisons.materials.rough_plastic import ROUGH_PLASTIC
from comparisons.materials.thin_dielectric import THIN_DIELECTRIC
from comparisons.materials.two_sided import TWO_SIDED
from comparisons.mitsuba.context import UntranslatableError
from reference_rt.materials import Material

MATERIALS = (
    *(DIFFUSE, MIRROR, CONDUCTOR, ROUGH_CONDUCTOR, DIELECTRIC, THIN_DIELECTRIC, ROUGH_DIELECTRIC),
    *(PLASTIC, ROUGH_PLASTIC, PRINCIPLED, PRINCIPLED_THIN, GLTF_PBR, PHONG, EMISSIVE),
    *(NO_SURFACE, MASK, BLEND, TWO_SIDED, BUMP, NORMAL_MAP),
)
"""All types of materials."""

_BY_DESCRIPTION = {one.description: one for one in MATERIALS}

READERS = {plugin: read for one in MATERIALS for plugin, read in one.from_mitsuba.items()}
"""By Mitsuba's plugin, what reads it."""


def type_of(material: Material) -> MaterialType:
    """What is known of a material's type.  Raises UntranslatableError for one not in MATERIALS."""
    if type(material) not in _BY_DESCRIPTION:
        raise UntranslatableError(material, "material")
    return _BY_DESCRIPTION[type(material)]


__all__ = ["MATERIALS", "READERS", "MaterialType", "type_of"]
